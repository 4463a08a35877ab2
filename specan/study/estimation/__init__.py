"""Fitting a model to observations: least squares, starting values, intervals.

Decisions: docs/decisions/fits.md.
"""
