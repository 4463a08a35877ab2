"""Parts of the hidden-effect bench; `hidden_effects.py` beside this package runs it."""
