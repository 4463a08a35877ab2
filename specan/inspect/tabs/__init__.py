"""The tabs of a recording's page."""
