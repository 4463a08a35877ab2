"""Which channels and which samples an analysis looks at, and results of few channels joined."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, replace
from typing import Any, TypeVar

import numpy as np
from pydantic import Field

from specan.arrays import Real
from specan.data.channel import Channel
from specan.data.recording import Recording
from specan.dsp.record_edges import SlowPart, drift_length, drift_spread
from specan.errors import InputError, RequestError
from specan.schema import Settings

_GRID = 1 << 15


class SectionSettings(Settings):
    """Which channels (names or patterns; all by default) and which time section, of every analysis."""

    channels: tuple[str, ...] = ()
    start_s: float = Field(default=0.0, ge=0.0)
    stop_s: float | None = Field(default=None, gt=0.0)

    def origin(
        self,
        recording: Recording,
        channels: Sequence[Channel],
        notes: Iterable[str],
        units: Sequence[str] | None = None,
    ) -> dict[str, Any]:
        """What every result says of where it comes from; units are those of the channels if nothing else is said."""
        return {
            "label": recording.label,
            "channels": tuple(c.label for c in channels),
            "groups": tuple(c.group for c in channels),
            "units": tuple(c.target_unit for c in channels) if units is None else tuple(units),
            "notes": tuple(notes),
            "settings": self.model_dump(mode="json"),
        }


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
    ends = np.array([start_s * rate, length if stop_s is None else stop_s * rate])
    start, stop = (round(end) for end in np.clip(np.nan_to_num(ends, nan=-1.0), -1, length).tolist())
    if start < 0 or start >= stop:
        wanted = f"{start_s:g} s to " + ("its end" if stop_s is None else f"{stop_s:g} s")
        raise RequestError(
            f"{recording.label}: the section from {wanted} holds no sample",
            expected=f"a section of its {length / rate:g} s",
        )
    return start, stop


def slow_part(
    recording: Recording, channels: Sequence[Channel], start: int, stop: int, lowest_hz: float = 0.0
) -> SlowPart:
    """Mean of all samples of a section, what every level is taken about, and its drift at the ends.

    Sums run over a fixed grid of blocks, from the first sample on: a channel whose samples are all equal has
    exactly that mean. No oscillation from `lowest_hz` on is taken for a drift; at 0 there is none.
    """
    rate, total = channels[0].sampling_rate, np.zeros(len(channels))
    spread = drift_spread(stop - start, rate, lowest_hz) if lowest_hz else 0.0
    seen, at = drift_length(spread), start
    first, last, origin = [], [], None
    with np.errstate(invalid="ignore", over="ignore"):  # a channel may hold NaN
        for block in recording.blocks(channels, _GRID, start, stop):
            origin = block[:, :1].copy() if origin is None else origin
            total += np.add.reduce(block - origin, axis=1)
            if at < start + seen:
                first.append(block[:, : start + seen - at].copy())
            at += block.shape[1]
            if at > stop - seen:
                last.append(block[:, max(block.shape[1] - (at - stop + seen), 0) :].copy())
        mean = np.asarray((0.0 if origin is None else origin[:, 0]) + total / max(stop - start, 1))
        if not seen:
            return SlowPart.only(mean)
        return SlowPart.of(
            mean, np.concatenate(first, axis=1), np.concatenate(last, axis=1), stop - start, spread
        )


def rms_about_mean(recording: Recording, channels: Sequence[Channel], n: int) -> Real:
    """RMS of the first `n` samples about their mean, whose digits a large constant part would take otherwise.

    Examples
    --------
    >>> recording = Recording.from_arrays({"Air": [299.0, 301.0, 299.0, 301.0]}, 1.0, units={"Air": "K"})
    >>> rms_about_mean(recording, recording.channels, 4).tolist()
    [1.0]
    """
    mean, square = slow_part(recording, channels, 0, n).constant[:, None], np.zeros(len(channels))
    with np.errstate(invalid="ignore", over="ignore"):  # a channel may hold NaN
        for block in recording.blocks(channels, _GRID, 0, n):
            square += np.add.reduce(np.square(block - mean), axis=1)
        return np.sqrt(square / n)


def of_one_rate(
    recording: Recording, patterns: Sequence[str], like: Channel | None = None
) -> tuple[tuple[Channel, ...], tuple[str, ...]]:
    """Channels of the patterns that share the sampling rate of `like`, or of the first; and notes on those left out.

    Channels that are analysed together end with the shortest of them. One that would cost the others more than half of
    their samples is left out.

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
    apart = reasons_apart(chosen, (like or usable[0]).sampling_rate, like)
    kept = tuple(c for c, reason in zip(chosen, apart, strict=True) if not reason)
    notes = [f"{c.label} is left out: it {reason}" for c, reason in zip(chosen, apart, strict=True) if reason]
    lengths = {c.n_samples for c in (*kept, *([like] if like else []))}
    if len(lengths) > 1:
        short = next(c for c in (*kept, *([like] if like else [])) if c.n_samples == min(lengths))
        notes.append(f"all channels are analysed up to {short.duration_s:.4g} s, where {short.label} ends")
    return kept, tuple(notes)


def reasons_apart(channels: Sequence[Channel], rate: float, like: Channel | None = None) -> list[str]:
    """Why each channel is not analysed together with the others, at one rate and with `like`; empty where it is."""
    longest = max((c.n_samples for c in channels if c.sampling_rate == rate), default=0)
    if like is not None:
        longest = min(longest, like.n_samples)

    def reason(channel: Channel) -> str:
        if channel.sampling_rate <= 0 or channel.n_samples <= 0:
            return "has no samples"
        if channel.sampling_rate != rate:
            return f"is sampled at {channel.sampling_rate:g} Hz, not at {rate:g} Hz"
        if 2 * channel.n_samples < longest:
            return f"lasts {channel.duration_s:.4g} s, others {longest / rate:.4g} s; choose it alone"
        return ""

    return [reason(channel) for channel in channels]


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
            f"{recording.label}: {other[0].label} is in {other[0].target_unit}",
            expected=f"sound pressure in Pa for the {weighting} weighting",
            remedy="choose the microphones, give their sensitivities, or use the Z weighting",
        )
    return pressure, (
        *notes,
        *(f"{c.label} is left out: {weighting} is for Pa, not {c.target_unit}" for c in other),
    )


def compared(
    recording: Recording, reference: str | None, patterns: Sequence[str]
) -> tuple[Recording, tuple[str, ...]]:
    """The run whose channels are compared with each other, all from one instant on; and what is to be said of it."""
    run, notes = _run_meant(recording, reference, patterns)
    generators = run.by_role("generator")
    found = [run.channel(reference)] if reference is not None else [*run.by_role("vibrometer"), *generators]
    if not found:
        return run, notes
    lead = found[0]
    wanted = {id(c) for c in (*run.select(patterns), *generators, lead)}
    alike = [c for c in run.channels if id(c) in wanted and c.sampling_rate == lead.sampling_rate]
    together, remarks = aligned(run, alike, lead)
    left = {c.path for c in together.channels}
    if left.isdisjoint(c.path for c in run.select(patterns)):
        raise InputError(f"{recording.label}: {'; '.join(remarks)}", expected="channels recorded together")
    return together, (*notes, *remarks)


def aligned(
    recording: Recording, channels: Sequence[Channel], lead: Channel | None = None
) -> tuple[Recording, tuple[str, ...]]:
    """The recording with these channels from the instant on at which the last of them begins; and notes.

    Those that have no time in common with `lead` (the first by default), or with the others, are left out.
    """
    usable = [c for c in channels if c.sampling_rate > 0 and c.n_samples > 0]
    starts = [c.start_offset_s for c in usable]
    if not usable or min(starts) == max(starts):
        return recording, ()
    lead = lead or usable[0]
    meet = [c for c in usable if c.start_offset_s < _end(lead) and lead.start_offset_s < _end(c)]
    latest = max((c.start_offset_s for c in meet), default=lead.start_offset_s)
    moved = {id(c): c.from_time(latest) for c in meet if latest < _end(c) - 1 / c.sampling_rate}
    apart = [c for c in usable if id(c) not in moved]
    gone = {id(c) for c in apart}
    notes = [f"{c.label} is left out: it was not recorded at the same time as {lead.label}" for c in apart]
    earliest = min((c.start_offset_s for c in meet), default=latest)
    if latest > earliest:
        notes.append(
            f"channels begin up to {latest - earliest:.6g} s apart, as the file says: they are compared from the last "
            "beginning on"
        )
    kept = tuple(moved.get(id(c), c) for c in recording.channels if id(c) not in gone)
    return replace(recording, channels=kept), tuple(notes)


def _end(channel: Channel) -> float:
    return channel.start_offset_s + channel.duration_s


def _run_meant(
    recording: Recording, reference: str | None, patterns: Sequence[str]
) -> tuple[Recording, tuple[str, ...]]:
    """The run of the named reference, or else of the first chosen channel; and a note on the runs left out.

    Where both reference and channels are named, all of them are taken.
    """
    runs = recording.runs
    if len(runs) == 1 or (reference is not None and patterns):
        return recording, ()
    first = recording.select(patterns)[0] if reference is None else recording.channel(reference)
    if reference is not None and all(c.group != first.group for c in recording.by_role("vibrometer")):
        return recording, ()  # common to all runs
    run = next(r for r in runs if any(c is first for c in r.channels))
    taken = {id(c) for c in run.channels}
    others = list(dict.fromkeys(c.group for c in recording.select(patterns) if id(c) not in taken))
    remark = f"{', '.join(others)} left out: with a reference of its own; choose its channels to analyse it"
    return run, (remark,) if others else ()


# Roles that are responses unless channels are named.
RESPONSES = ("microphone", "accelerometer")


def channel_named(
    recording: Recording, name: str | None, roles: Sequence[str], what: str, remedy: str = ""
) -> Channel:
    """The channel of a name, or else the first of the first role that there is.

    Raises
    ------
    InputError
        There is none; `what` it was wanted as.
    """
    if name is not None:
        return recording.channel(name)
    found = [channel for role in roles for channel in recording.by_role(role)]
    if not found:
        raise InputError(
            f"{recording.label} has no {' or '.join(roles)} channel",
            expected=what,
            remedy=remedy or "name one with --reference CH (reference= in Python)",
        )
    return found[0]


def responses_to(
    recording: Recording, helpers: Sequence[Channel], patterns: Sequence[str], others: Sequence[str]
) -> tuple[tuple[Channel, ...], tuple[str, ...]]:
    """Channels that respond to the first of the helpers, sampled together with all of these, and notes on others.

    `others` are the notes on those that are gone already.

    Raises
    ------
    InputError
        There are none.
    """
    lead = helpers[0]
    every = patterns or [c.path for c in recording.channels if c.role in RESPONSES]
    chosen, more = of_one_rate(recording, every, like=lead)
    notes = (*others, *more)
    responses = tuple(c for c in chosen if c not in helpers)
    if not responses or any(c.sampling_rate != lead.sampling_rate for c in helpers):
        raise InputError(
            f"{recording.label}: no response is sampled together with {lead.label}",
            expected=f"channels at {lead.sampling_rate:g} Hz",
            remedy="; ".join(notes) or "choose channels other than the reference",
        )
    return responses, notes


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


def joined(parts: Sequence[Found], by_channel: str) -> Found:
    """One result of the results of groups; what is not `by_channel` is the same in all of them."""
    first: Any = parts[0]
    if len(parts) == 1:
        return parts[0]
    return replace(
        first, **{name: _stacked([getattr(p, name) for p in parts]) for name in by_channel.split()}
    )


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
    return joined(values, " ".join(f.name for f in fields(first) if f.name.endswith("dB")))
