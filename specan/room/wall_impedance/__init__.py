"""Surface impedance and absorption of the walls of a room, from a study of its sound field.

Decisions: docs/decisions/impedance.md.
"""
