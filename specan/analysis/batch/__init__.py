"""The main job: a directory of recordings in, tables of results out.

Decisions: docs/decisions/batch.md.
"""
