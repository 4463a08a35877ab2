"""Eight machines as a user of specan would model them, with the truth in other formulas; see `run.py`."""
