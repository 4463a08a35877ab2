"""Effects of the worm gear, one a file."""
