"""The frequency of a signal that holds one line at a time, against time: sweeps and steps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from specan.dsp.windows import window

Real = NDArray[np.float64]
Path = Literal["sweep", "steps", "moves", "none"]

_SHORTEST, _LEAST_FRAMES = 64, 8
_SIDE = 2  # lines on either side that hold a tone under the Hann window
_NEARLY_MOST = 0.8
_HELD = 0.3  # part of the power of a frame in one line: a tone down to some 3 dB below noise
# Median over mean of the steps from frame to frame: 1 for a linear sweep, above 0.5 for a logarithmic one of a
# section, 0 for a tone that stands still between a few steps.
_SMOOTH, _STEPWISE = 0.5, 0.3
_MONOTONE, _ALIKE = 0.97, 0.75
# Ways shorter than this part of the frequency are a drift; nobody measures a transfer function with them.
_DRIFT = 0.02


class Track(NamedTuple):
    """Frequency against time of one section.

    Attributes
    ----------
    frequency_hz : ndarray
        Of each frame.
    line_hz : float
        Distance of the lines in which it was looked for.
    held : float
        Part of the power in the strongest line, median over the frames.
    evenness : float
        Median over mean of the steps from frame to frame, in the frames that show the least: a sweep moves in frames of
        any length, steps stand still in short ones.
    """

    frequency_hz: Real
    line_hz: float
    held: float
    evenness: float

    @property
    def direction(self) -> int:
        """+1 or -1 where its thirds rise or fall, else 0."""
        steps = np.sign(np.diff([np.median(third) for third in np.array_split(self.frequency_hz, 3)]))
        return int(steps[0]) if steps[0] == steps[1] else 0


def track(section: Real, rate: float) -> Track | None:
    """The strongest line of every frame; in the longest frames in which that line holds about most.

    None where in no length one line holds most frames.
    """
    found = []
    length = _SHORTEST
    while length * _LEAST_FRAMES <= len(section):
        found.append(_track(section, rate, length))
        length *= 2
    most = max((one.held for one in found), default=0.0)
    if most < _HELD:
        return None
    # Short frames hold much in one line because their lines are wide.
    good = [one for one in found if one.held > _NEARLY_MOST * most]
    # A frame of hardly a period has no frequency that could move.
    resolved = [one for one in good if np.median(one.frequency_hz) > 2 * _SIDE * one.line_hz]
    return good[-1]._replace(evenness=min(one.evenness for one in resolved or good[-1:]))


def _track(section: Real, rate: float, length: int) -> Track:
    frames = section[: len(section) // length * length].reshape(-1, length)
    power = np.abs(np.fft.rfft((frames - frames.mean(axis=1, keepdims=True)) * window("hann", length))) ** 2
    whole = power.sum(axis=1)
    power = power[whole > 0.01 * whole.max()]
    peak = np.clip(np.argmax(power, axis=1), _SIDE, power.shape[1] - 1 - _SIDE)
    around = peak[:, None] + np.arange(-_SIDE, _SIDE + 1)
    lobe = np.take_along_axis(power, around, axis=1)
    held = lobe.sum(axis=1) / np.maximum(power.sum(axis=1), 1e-300)
    centre = (lobe * around).sum(axis=1) / np.maximum(lobe.sum(axis=1), 1e-300)
    steps = np.abs(np.diff(centre))
    even = float(np.median(steps) / max(np.mean(steps), 1e-300)) if steps.size else 0.0
    return Track(centre * rate / length, rate / length, float(np.median(held)), even)


def path(tracks: Sequence[Track], steady: Sequence[bool], section_s: float, apart_s: float) -> Path:
    """What the frequency does over the sections of a record.

    Parameters
    ----------
    tracks : sequence of Track
        Of the sections in which there is a signal, in their order.
    steady : sequence of bool
        Whether one steady sine explains the section.
    section_s, apart_s : float
        Length of a section, and time between the beginnings of the first and the last one, in seconds.

    Returns
    -------
    {"sweep", "steps", "moves", "none"}
        A sweep moves in one direction all the time; steps stand still in between. What moves otherwise
        (frequency modulation, a drift) only "moves".
    """
    if not tracks:
        return "none"
    every = np.concatenate([t.frequency_hz for t in tracks])
    middles = np.array([np.median(t.frequency_hz) for t in tracks])
    way = float(np.ptp(middles)) if all(steady) else float(np.ptp(np.percentile(every, [2, 98])))
    if way < _DRIFT * np.median(every):
        return "moves" if np.ptp(middles) > 0.1 / section_s else "none"
    moving = [t for t, still in zip(tracks, steady) if not still]
    if 2 * len(moving) > len(tracks) and _monotone(every):  # a slow beginning may look steady
        sign = 1 if middles[-1] + every[-1] > middles[0] + every[0] else -1
        smooth = np.median([t.evenness for t in moving]) > _SMOOTH
        if smooth and np.mean([t.direction == sign for t in moving]) > _ALIKE:
            return "sweep"
    if not all(t.evenness < _STEPWISE for t in moving):
        return "moves"
    # Steady sines of several frequencies are steps, unless a sweep that slow would look steady as well.
    if not moving and way * section_s / max(apart_s, section_s) * section_s < 0.5:
        return "moves"
    return "steps"


def _monotone(values: Real) -> bool:
    """Rank correlation with time (Spearman)."""
    rank = np.argsort(np.argsort(values, kind="stable"), kind="stable")
    return bool(abs(np.corrcoef(rank, np.arange(len(rank)))[0, 1]) > _MONOTONE)
