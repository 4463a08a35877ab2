"""The tabs of a recording's page, one a file."""
