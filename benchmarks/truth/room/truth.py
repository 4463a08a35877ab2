"""The truth about a simulated room and its instruments, and the form of what can be hidden in it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from specan.errors import RequestError, nearest
from truth.room.box import WALLS
from truth.room.field import Part, Room
from truth.room.layout import Layout
from truth.room.line import Real


@dataclass(frozen=True)
class Shaking:
    """A structure that shakes microphones: one resonance, driven by the diaphragm.

    Attributes
    ----------
    pressure : array (microphones,)
        Indicated pressure at the resonance over the diaphragm's velocity, Pa s/m.
    frequency_hz, quality : float
        Of the structure.
    """

    pressure: Real
    frequency_hz: float
    quality: float


@dataclass(frozen=True)
class Truth:
    """The room and the instruments as they are.

    Attributes
    ----------
    gain_dB, delay_s : array (microphones,)
        Errors that the calibration left; positive delays are late.
    vibrometer_gain, vibrometer_delay_s : float
        Relative error, and how late the vibrometer is.
    vibrometer_noise : float
        RMS of its additional noise over the RMS of the velocity.
    breakup : tuple of float
        Strength, frequency (Hz) and loss factor of the diaphragm's own resonance.
    details : dict
        Per hidden effect what was drawn for it.
    drift_K : float
        How much warmer the air is at the end of the recording than at its beginning; `temperature_C` is the mean.
    shaking : Shaking, optional
        What shakes microphones.
    """

    layout: Layout
    room: Room
    temperature_C: float
    gain_dB: Real
    delay_s: Real
    vibrometer_gain: float
    vibrometer_delay_s: float
    vibrometer_noise: float
    breakup: tuple[float, float, float]
    details: dict[str, dict[str, float | str]]
    drift_K: float = 0.0
    shaking: Shaking | None = None


Details = dict[str, float | str]
Install = Callable[[Truth, float, str, np.random.Generator], tuple[Truth, Details]]


@dataclass(frozen=True)
class HiddenRoomEffect:
    """One effect that can be hidden.

    Attributes
    ----------
    unit : str
        Of its strength.
    low, high : float
        A usual range of it.
    install : callable
        What it does to the truth.
    candidate : str or None
        Effect of the models' catalogue that describes it; none does where this is empty.
    both_signs : bool
        Whether strengths below zero make sense.
    """

    unit: str
    low: float
    high: float
    install: Install
    candidate: str | None
    both_signs: bool = False


def free_wall(truth: Truth, at: str, rng: np.random.Generator) -> str:
    """The wall that is asked for, or a random one; never the piston's."""
    free = [wall for wall in WALLS if wall != truth.layout.piston.wall]
    drawn = free[rng.integers(len(free))]
    if at and at not in free:
        raise RequestError(f"nothing can be hidden in the wall {at!r}", remedy=nearest(at, free))
    return at or drawn


def with_part(truth: Truth, *parts: Part) -> Truth:
    """The truth with something more in a wall."""
    return replace(truth, room=replace(truth.room, parts=(*truth.room.parts, *parts)))
