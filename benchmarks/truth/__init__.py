"""Truth simulators that share no formula with the models."""
