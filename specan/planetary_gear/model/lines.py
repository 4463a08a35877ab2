"""Which order lines a model predicts, and what a recording tells about them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class OrderLines:
    """Order lines of vibration sensors, counted per turn of the carrier.

    Attributes
    ----------
    order : array (lines,)
        Orders that the machine can show.
    harmonic : array of int (lines,)
        Number of the harmonic that each belongs to: what lies between machine and sensor gives the lines of one
        harmonic one unknown gain.
    passages : array of int (lines,)
        How many passages of a planet a turn it lies beside what a single planet's meshes would have there.
    family : tuple of str
        What each line is called together with those of the other harmonics: ``66h+-3.75 (sun)``.
    sun_turns : float
        Turns of the sun per turn of the carrier.
    torque : float
        On the carrier where a recording does not tell it, N m.
    period : int
        Turns of the carrier after which the machine repeats itself. Which of them a recording begins with,
        nobody knows.
    discrepancy : float
        Relative standard uncertainty of the model, common to lines within a few orders.
    path : float
        Relative standard uncertainty of lines three passages away: how strongly they are heard depends on the path
        to the sensor, which differs from harmonic to harmonic.
    response : float
        Relative standard uncertainty of lines that the ideal machine does not have, against those that it has; common
        to the lines of a harmonic.
    """

    order: Array
    harmonic: NDArray[np.intp]
    passages: NDArray[np.intp]
    family: tuple[str, ...]
    sun_turns: float
    torque: float
    period: int
    discrepancy: float
    path: float
    response: float
