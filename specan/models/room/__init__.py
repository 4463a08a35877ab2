"""The sound field of a room with a vibrating piston in one of its walls."""

from specan.models.room.build import build

__all__ = ["build"]
