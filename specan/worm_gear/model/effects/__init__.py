"""Effects of the worm gear, by machine element and place in the measuring chain."""
