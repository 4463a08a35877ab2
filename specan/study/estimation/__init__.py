"""Fitting a model to observations: least squares, starting values, intervals."""
