"""Which effects a model is missing: score tests, refits, acceptance, alternatives.

Decisions: docs/decisions/selection.md.
"""
