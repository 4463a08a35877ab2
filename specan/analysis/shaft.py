"""The shaft that orders are counted by: of a known speed, or tracked by a tacho."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from specan.arrays import Real
from specan.data.channel import Channel
from specan.data.orders import TachoReport
from specan.data.recording import Recording
from specan.dsp.tacho import COUNTABLE, pulse_times, repair, shaft_angle
from specan.errors import InputError, RequestError
from specan.units import number

DRIFT_PERCENT = 1.0  # range of the speed from which on the result says so


@dataclass(frozen=True)
class Shaft:
    """Turns of the reference shaft against time.

    Attributes
    ----------
    turns, speed : callables
        Turns, and turns per second, at instants in s from the recording's first sample.
    start_s, stop_s : float
        Between which they are known.
    tacho : TachoReport
        Without the speeds, which are those of what is analysed.
    silent : tuple of (float, float)
        From when to when there are no pulses.
    """

    turns: Callable[[Real], Real]
    speed: Callable[[Real], Real]
    start_s: float
    stop_s: float
    tacho: TachoReport
    silent: tuple[tuple[float, float], ...] = ()

    @property
    def notes(self) -> tuple[str, ...]:
        """What was repaired, and where the angle is not known."""
        found, tacho = [], self.tacho
        if tacho.missing + tacho.double:
            found.append(
                f"{tacho.channel}: {tacho.missing} missing and {tacho.double} double pulses among {tacho.pulses} "
                "repaired"
            )
        if self.silent:
            gaps = ", ".join(f"{first:.3f} to {last:.3f} s" for first, last in self.silent)
            found.append(
                f"{tacho.channel}: no pulses from {gaps}: the shaft stands still or the tacho fails; analysed is "
                f"{max(self.start_s, 0.0):.3f} to {self.stop_s:.3f} s"
            )
        return tuple(found)


def steady_shaft(speed_hz: float) -> Shaft:
    """A shaft of one known speed; turn zero is the first sample."""
    speed = partial(np.full_like, fill_value=speed_hz, dtype=float)
    return Shaft(lambda t: speed_hz * np.asarray(t), speed, -math.inf, math.inf, TachoReport())


def tracked_shaft(
    recording: Recording,
    name: str | None = None,
    pulses_per_turn: float | None = None,
    ratio: float = 1.0,
    section_s: tuple[float, float | None] = (0.0, None),
) -> Shaft:
    """The reference shaft from a tacho on it, or on one that is geared to it.

    Parameters
    ----------
    name : str, optional
        Tacho channel; the recording's only one by default.
    pulses_per_turn : float, optional
        Of the tacho's own shaft; its property ``PulsesPerRevolution`` by default.
    ratio : float
        Turns of the tacho's shaft per turn of the reference shaft.
    section_s : tuple
        Start and stop of what is analysed. Where the shaft stands still between, the longest part is taken.

    Raises
    ------
    RequestError
        No tacho or several, or nothing says how many pulses it gives.
    InputError
        The tacho is unusable.
    """
    channel = tacho_of(recording, name)
    count = pulses_per_turn if pulses_per_turn is not None else _pulses_of(recording, channel)
    first, last = section_s[0], math.inf if section_s[1] is None else section_s[1]
    try:
        times = pulse_times(recording.read([channel])[0], channel.sampling_rate) - channel.delay_s
        pulses = repair(times, first, last)
        found = shaft_angle(pulses, count * ratio)
    except InputError as fault:
        raise fault.within(f"{recording.label}, {channel.label}") from None
    spacing, end = np.diff(found.time), channel.duration_s - channel.delay_s
    ends = ((-channel.delay_s, times[0], spacing[0]), (times[-1], end, spacing[-1]))
    silent = [*pulses.silent, *((a, b) for a, b, usual in ends if b - a > COUNTABLE * usual)]
    silent = sorted((float(max(a, first)), float(min(b, last))) for a, b in silent if a < last and b > first)
    begin, stop = found.time[[0, -1]] + [-spacing[0], spacing[-1]]
    return Shaft(
        found.at,
        found.speed,
        float(max([begin, *(b for _, b in silent if b <= found.time[0])])),
        float(min([end, stop, *(a for a, _ in silent if a >= found.time[-1])])),
        TachoReport(channel.label, pulses.time.size, pulses.missing, pulses.double, found.jitter_s),
        tuple(silent),
    )


def tacho_of(recording: Recording, name: str | None) -> Channel:
    """The named channel, or the only tacho."""
    if name is not None:
        return recording.channel(name)
    found = [c for c in recording.by_role("tacho") if c.n_samples and c.sampling_rate]
    if len(found) == 1:
        return found[0]
    if found:
        names = ", ".join(c.label for c in found)
        raise RequestError(f"{recording.label} has the tachos {names}", remedy="name one of them")
    raise RequestError(
        f"{recording.label} has no tacho",
        remedy="name the tacho (--tacho CH) or the speed of the shaft (--speed HZ)",
    )


def _pulses_of(recording: Recording, channel: Channel) -> float:
    """What the channel's property says."""
    value = number(channel.properties.get("PulsesPerRevolution"))
    if value is not None and 0 < value < math.inf:
        return value
    raise RequestError(
        f"{recording.label}: the pulses per revolution of {channel.label} are unknown",
        expected="the property PulsesPerRevolution",
        remedy="give the pulses per revolution",
    )
