"""Which channels and which samples an analysis looks at, and results of few channels joined."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from specan.data.channel import Channel
from specan.data.recording import Recording
from specan.errors import InputError, RequestError

_GRID = 1 << 15


def section(
    recording: Recording, channels: Sequence[Channel], start_s: float = 0.0, stop_s: float | None = None
) -> tuple[int, int]:
    """First and last-plus-one sample of a time section; the end is that of the shortest channel.

    Raises
    ------
    RequestError
        The section is empty or begins after the end of the recording.
    """
    rate, length = channels[0].sampling_rate, min(c.n_samples for c in channels)
    start = round(start_s * rate)
    stop = length if stop_s is None else min(length, round(stop_s * rate))
    if start < 0 or start >= stop:
        wanted = f"{start_s:g} s to " + ("its end" if stop_s is None else f"{stop_s:g} s")
        raise RequestError(
            f"{recording.label}: the section from {wanted} holds no sample",
            expected=f"a section of its {length / rate:g} s",
        )
    return start, stop


def constant_part(
    recording: Recording, channels: Sequence[Channel], start: int, stop: int
) -> NDArray[np.float64]:
    """Mean of all samples of a section, shape (channels,): what every level is taken about.

    Sums run over a fixed grid of blocks, from the first sample on: a channel whose samples are all equal has
    exactly that mean.
    """
    origin = recording.read(channels, start, min(start + 1, stop))
    total = np.zeros(len(channels))
    with np.errstate(invalid="ignore", over="ignore"):  # a channel may hold NaN
        for block in recording.blocks(channels, _GRID, start, stop):
            total += np.add.reduce(block - origin, axis=1)
        return np.asarray(origin[:, 0] + total / max(stop - start, 1))


def of_one_rate(
    recording: Recording, patterns: Sequence[str], like: Channel | None = None
) -> tuple[tuple[Channel, ...], tuple[str, ...]]:
    """Channels of the patterns that share the sampling rate of `like`, or of the first; and notes on those left out.

    Raises
    ------
    InputError
        The recording has no channel with samples and a sampling rate.
    """
    chosen = recording.select(patterns)
    usable = [c for c in chosen if c.sampling_rate > 0 and c.n_samples > 0]
    if not usable:
        raise InputError(
            f"{recording.label}: no chosen channel has samples and a sampling rate",
            remedy="name other channels, or state the sampling rate",
        )
    rate = (like or usable[0]).sampling_rate
    kept = tuple(c for c in usable if c.sampling_rate == rate)
    used, whole = {id(c) for c in kept}, {id(c) for c in usable}
    notes = tuple(
        f"{c.name} is left out: "
        + (
            f"it is sampled at {c.sampling_rate:g} Hz, not at {rate:g} Hz"
            if id(c) in whole
            else "it has no samples"
        )
        for c in chosen
        if id(c) not in used
    )
    return kept, notes


def weightable(
    recording: Recording, patterns: Sequence[str], weighting: str, like: Channel | None = None
) -> tuple[tuple[Channel, ...], tuple[str, ...]]:
    """`of_one_rate`, of sound pressure where a frequency weighting asks for it, and notes on the others.

    Raises
    ------
    RequestError
        A channel that was named, or every channel, is not sound pressure.
    """
    chosen, notes = of_one_rate(recording, patterns, like)
    if weighting == "Z":
        return chosen, notes
    pressure = tuple(c for c in chosen if c.target_unit == "Pa")
    other = [c for c in chosen if c.target_unit != "Pa"]
    if not pressure or (patterns and other):
        raise RequestError(
            f"{recording.label}: {other[0].name} is in {other[0].target_unit}",
            expected=f"sound pressure in Pa for the {weighting} weighting",
            remedy="choose the microphones, give their sensitivities, or use the Z weighting",
        )
    return pressure, (
        *notes,
        *(f"{c.name} is left out: {weighting} is for Pa, not {c.target_unit}" for c in other),
    )


def reference_channel(recording: Recording, name: str | None) -> Channel:
    """The named channel, or the vibrometer.

    Raises
    ------
    InputError
        There is no vibrometer and no name was given.
    """
    if name is not None:
        return recording.channel(name)
    found = recording.by_role("vibrometer")
    if not found:
        raise InputError(
            f"{recording.label} has no vibrometer channel",
            expected="a reference",
            remedy="name a channel as the reference",
        )
    return found[0]


# Channels whose bands are found together. A channel takes up to 8 MB for its lags and transforms at every stage of
# decimation; the bands of one do not depend on the others.
AT_ONCE = 32


Found = TypeVar("Found")


def slices(count: int) -> Iterator[slice]:
    """Groups of at most `AT_ONCE` of `count` channels.

    Examples
    --------
    >>> [(few.start, few.stop) for few in slices(70)]
    [(0, 32), (32, 64), (64, 96)]
    """
    return (slice(first, first + AT_ONCE) for first in range(0, count, AT_ONCE))


def joined(parts: Sequence[Found], by_channel: Sequence[str]) -> Found:
    """One result of the results of groups; what is not `by_channel` is the same in all of them."""
    first: Any = parts[0]
    if len(parts) == 1:
        return parts[0]
    return replace(first, **{name: _stacked([getattr(p, name) for p in parts]) for name in by_channel})


def _stacked(values: Sequence[Any]) -> Any:
    first = values[0]
    if first is None:
        return None
    if isinstance(first, tuple):
        return tuple(each for value in values for each in value)
    if isinstance(first, Mapping):
        return {key: _stacked([value[key] for value in values]) for key in first}
    if isinstance(first, np.ndarray):
        return np.concatenate(values)
    return joined(values, ("level_dB", "overall_dB"))
