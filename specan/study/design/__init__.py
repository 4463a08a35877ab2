"""Which measurement to make next.

Decisions: docs/decisions/localisation.md.
"""
