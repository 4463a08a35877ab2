"""Effects that a room model may lack, one a file."""
