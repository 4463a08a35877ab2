"""Physics: quantities, parameters, effects and the models made of them."""
