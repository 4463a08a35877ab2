"""Where a model fails.

Decisions: docs/decisions/localisation.md.
"""
