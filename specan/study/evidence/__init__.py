"""How probable each explanation of the data is: nothing missing, an effect, something else, a fault of the data.

Decisions: docs/decisions/evidence.md.
"""
