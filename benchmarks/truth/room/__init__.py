"""A room with a loudspeaker in its wall whose truth is known: time runs, and the field follows.

The models sum over shapes of vibration at one frequency after another; here the wave equation is marched on
spectral elements, the walls and what stands in them obey equations of motion, and the recording follows by
convolution.
"""

from truth.room.case import RoomCase, background, simulate, write
from truth.room.effects import EFFECTS
from truth.room.response import impulse_responses
from truth.room.truth import HiddenRoomEffect, Truth

__all__ = [
    "EFFECTS",
    "HiddenRoomEffect",
    "RoomCase",
    "Truth",
    "background",
    "impulse_responses",
    "simulate",
    "write",
]
