"""Effects that a planetary gear may be missing, by part of the gear and of the measuring chain."""
