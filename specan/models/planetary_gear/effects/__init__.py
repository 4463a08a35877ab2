"""Effects that a planetary gear may be missing, one a file."""
