"""The sound field of a room with a vibrating piston in one of its walls."""
