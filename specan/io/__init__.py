"""Files to data and back, one file per format; headers first, samples on demand.

Decisions: docs/decisions/reading.md.
"""
