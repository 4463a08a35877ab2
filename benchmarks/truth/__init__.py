"""Truth simulators that share no formula with the models.

Decisions: docs/decisions/simulators.md.
"""
