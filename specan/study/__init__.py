"""The only place where a measurement and a model meet."""
