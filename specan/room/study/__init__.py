"""From measured files to observations with their covariance.

Decisions: docs/decisions/study_data.md.
"""
