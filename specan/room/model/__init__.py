"""The sound field of a room with a vibrating piston in one of its walls."""

from specan.room.model.build import build
from specan.room.model.rig import EXAMPLE_RIG

__all__ = ["EXAMPLE_RIG", "build"]
