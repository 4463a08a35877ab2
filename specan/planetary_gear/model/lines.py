"""Which order lines a model predicts, and what a recording tells about them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specan.arrays import Real

# Uncertainty of the answer to unlike planets about each harmonic, over that of the rig file: against springs of another
# form over the pitch lines were right within a tenth about the first, within a factor 3 about the others.
UNLIKE = (1.0, 2.0, 2.0)
# Passages of the planets from which on a path is as little known as it gets.
FAR = 3


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
    mode : array of int (lines,)
        Kind of the modes that are heard there: 0 all planets move alike, and the central members turn; 1 these move to
        a side; from 2 on the planets move alone (Lin and Parker, J. Vib. Acoust. 121 (1999) 316).
    family : array of str (lines,)
        What each line is called together with those of the other harmonics: ``66h+-3.75 (sun)``.
    sun_turns : float
        Turns of the sun per turn of the carrier.
    torque : float
        On the carrier where a recording does not tell it, N m.
    period : int
        Turns of the carrier after which the machine repeats itself. Which of them a recording begins with,
        nobody knows.
    near, path, response : float
        What the model is declared not to know of its lines, relative standard uncertainties of either component.
        `near` varies smoothly with the order; each recording and sensor has its own. `path` is that of lines three
        passages of the planets or more beside what a machine with one planet has, in proportion nearer by: how a planet
        that passes is heard differs from harmonic to harmonic and from sensor to sensor, and is the same in recordings
        at one speed. `response` is that of lines that the ideal machine does not have, times `UNLIKE`, one a speed: how
        strongly the machine answers to what its equal parts do not do alike is known less well than how it answers to
        the rest; it is common to lines of a harmonic and a kind of mode that lie within a resonance.
    """

    order: Real
    harmonic: NDArray[np.intp]
    passages: NDArray[np.intp]
    mode: NDArray[np.intp]
    family: NDArray[np.str_]
    sun_turns: float
    torque: float
    period: int
    near: float
    path: float
    response: float

    @property
    def far(self) -> Real:
        """How far each line lies beside what one planet has, from 0 to 1: how little is known of its path."""
        return np.minimum(np.abs(self.passages), FAR) / FAR

    @property
    def frame(self) -> Real:
        """Order of the motion that is heard, in the frame of the carrier."""
        return np.round(self.order - self.passages, 6)

    @property
    def unlike(self) -> Real:
        """Uncertainty of the answer to unlike planets, of each line."""
        return self.response * np.array(UNLIKE)[self.harmonic - 1]
