"""Effects that a room model may lack, by part of the room and of the measuring chain."""
