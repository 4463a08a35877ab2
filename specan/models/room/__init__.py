"""The sound field of a room with a vibrating piston in one of its walls."""

from specan.models.room.build import build
from specan.models.room.rig import EXAMPLE_RIG

__all__ = ["EXAMPLE_RIG", "build"]
