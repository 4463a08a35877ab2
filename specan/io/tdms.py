"""TDMS recordings: headers first, samples on demand; the full scale of their converters."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from specan.data.recording import Recording
from specan.errors import InputError, NoSignalError
from specan.io import sampling_rate as rates
from specan.io.sampling_rate import Rate, is_frequency, is_time, rate_of_axis
from specan.io.signals import Opening, Signal
from specan.io.tdms_headers import Headers, TdmsObject, read_headers
from specan.io.tdms_scaling import scaling_of
from specan.io.tdms_source import Feed, TdmsSource

SUFFIXES = (".tdms",)

_ZERO = np.datetime64("1904-01-01")  # of the clock of TDMS
_EMPTY, _CUT_OFF = "it has no samples", "it was cut off"
_NO_NUMBERS = {
    "String": "it holds text", "ComplexSingleFloat": "its samples are complex",
    "ComplexDoubleFloat": "its samples are complex", "": _EMPTY, "Void": _EMPTY,
}  # fmt: skip


def recognises(start: bytes) -> bool:
    """Whether a file that begins so is TDMS."""
    return start[:4] == b"TDSm"


def open_recording(path: Path, opening: Opening) -> Recording:
    """Open a TDMS file; samples are read when they are asked for.

    An index file beside it is not used.

    Raises
    ------
    InputError
        The headers are damaged, statements contradict each other, or no channel is a time signal;
        the message names the file, the channel and what was tried.
    """
    headers = read_headers(path)
    taken = _Taken(headers, opening)
    for found in headers.channels:
        taken.take(found)
    return taken.recording()


class _Aside(InputError):
    """The channel is set aside, the file is not; with a remedy the user can do something about it."""


class _Taken:
    def __init__(self, headers: Headers, opening: Opening) -> None:
        self.headers, self.opening = headers, opening
        self.signals: list[Signal] = []
        self.feeds: list[Feed] = []
        self.set_aside: dict[str, str] = {}
        self.faults: list[_Aside] = []
        self.axes: dict[str, list[tuple[int, Rate | str]]] = {}
        # wf_start_time of each signal in us, NaN where it is not said.
        self.begun: list[float] = []

    def take(self, found: TdmsObject) -> None:
        """Make a channel of an object, or set it aside with the reason."""
        reason = self._unfit(found)
        if not reason:
            try:
                self._add(found)
            except _Aside as fault:
                reason = fault.found
                self.faults += [fault] if fault.remedy else []
        if reason:
            self.set_aside[f"{found.group}/{found.name}"] = reason

    def recording(self) -> Recording:
        """The recording of what was taken."""
        if not self.signals:
            self._refuse()
        layout = self.headers.layout
        cut_off = ("the file is cut off; every channel is used as far as all channels reach",)
        found = self.opening.recording(
            self.signals,
            TdmsSource(self.headers.path, layout, self.feeds),
            self.set_aside,
            properties=self.headers.properties,
            group_properties=self.headers.groups,
            flags=("truncated",) if layout.truncated else (),
            notes=cut_off if layout.truncated else (),
        )
        # Starts are counted from the first wf_start_time.
        late = 1e-6 * (np.array(self.begun) - min((t for t in self.begun if t == t), default=0.0))
        channels = [
            replace(channel, start_offset_s=channel.start_offset_s + float(after)) if after > 0 else channel
            for channel, after in zip(found.channels, late, strict=True)
        ]
        return replace(found, channels=tuple(channels))

    def _refuse(self) -> NoReturn:
        if self.faults:
            raise InputError(f"{self.opening.label}: {self.faults[0].found}", remedy=self.faults[0].remedy)
        first = next(iter(self.set_aside.items()), None)
        more = f" (and {len(self.set_aside) - 1} more channels)" if len(self.set_aside) > 1 else ""
        what = f"{first[0]!r}: {first[1]}{more}" if first else "it has no channel"
        kind = NoSignalError if set(self.set_aside.values()) - {_EMPTY, _CUT_OFF} else InputError
        raise kind(f"{self.opening.label} holds no time signal; {what}", expected="numbers sampled in time")

    def _unfit(self, found: TdmsObject) -> str:
        """Why an object is not a signal, as far as its headers say; empty for none."""
        if found.type_name in _NO_NUMBERS:
            return _NO_NUMBERS[found.type_name]
        if found.track is None:
            return _CUT_OFF if found.path in self.headers.layout.cut_off else _EMPTY
        if found.type_name == "TimeStamp" or is_time(found.name, found.type_name, found.properties):
            return "it is the time axis of its group"
        if found.n_samples == 1:
            return "it is a single number"
        level = found.properties.get("DecimationLevel", self._group(found).get("DecimationLevel", 0))
        if level:
            return f"it is a decimated copy (level {level}) of another channel"
        if re.search(r"decimated data", found.group, re.IGNORECASE):
            return "its group holds decimated copies"
        if found.properties.get("NI_LV_DataItem_Private"):
            return "it is an auxiliary item of LabVIEW"
        return ""

    def _add(self, found: TdmsObject) -> None:
        layout = self.headers.layout
        dtype, rate = layout.dtype_of(found.path), self._rate(found)
        try:
            scaling = scaling_of(found.properties, self._group(found), self.headers.properties, found.scalers)
        except InputError as fault:
            reason = f"{found.name!r} cannot be scaled: {fault.found}"
            remedy = fault.remedy or "write the channel with the scaling applied"
            raise _Aside(reason, remedy=remedy) from None
        foreign = found.path in layout.foreign
        if foreign and (found.path in layout.short_midfile):
            what = f"{found.name!r} is {layout.foreign[found.path]} in a segment that ends in a short chunk"
            raise _Aside(what, remedy="write it in whole chunks: npTDMS would read beyond the segment")
        line = None if foreign else scaling.line(dtype)
        top, how = full_scale_of(dtype, line, found.properties)
        self.signals.append(
            Signal(
                found.name,
                found.n_samples,
                rate=rate,
                group=found.group,
                properties=found.properties,
                full_scale=top,
                known={"start_offset_s": float(found.properties.get("wf_start_offset", 0.0))},
                decisions={"full_scale": how, "scaling": scaling.text},
            )
        )
        self.begun.append(_began(found.properties))
        self.feeds.append(Feed(found, scaling, line, foreign))

    def _rate(self, found: TdmsObject) -> Rate | None:
        """Sampling rate in the order that counts; None where table or user state it, which counts before the file."""
        places = (
            ("channel", found.properties), ("group", self._group(found)), ("file", self.headers.properties),
        )  # fmt: skip
        try:
            names = f"{found.group} {found.name}"
            increment = rates.from_increment(found.properties, found.n_samples, names)
        except NoSignalError as fault:
            raise _Aside(fault.found) from None
        table = self.opening.channel_table
        row = table.find(found.group, found.name) if table else None
        if self.opening.sampling_rate is not None or (row is not None and row.sampling_rate_hz is not None):
            return None
        if isinstance(increment, Rate):
            other = rates.contradiction(increment, places)
            return Rate(increment.hz, increment.how + (f"; {other}" if other else ""))
        keys = rates.from_keys(places, self.opening.label)
        return keys if isinstance(keys, Rate) else self._from_axis(found, [increment, keys])

    def _from_axis(self, found: TdmsObject, tried: list[str]) -> Rate:
        axes = [rate for length, rate in self._axes(found.group) if length == found.n_samples]
        for rate in axes:
            if isinstance(rate, Rate):
                return rate
            tried.append(rate)
        table = [
            c.name
            for c in self.headers.channels
            if c.group == found.group
            and is_frequency(c.name, c.properties)
            and c.n_samples == found.n_samples
        ]
        if table:
            raise _Aside(f"it is a table over {table[0]!r}, not a time signal")
        tried += [] if axes else ["its group has no time channel of its length"]
        raise _Aside(
            f"no sampling rate for {found.name!r} ({'; '.join(tried)})",
            remedy="give it with --sampling-rate HZ, or in the channel table",
        )

    def _axes(self, group: str) -> list[tuple[int, Rate | str]]:
        """Length of each time channel of a group, and the rate that it gives."""
        if group not in self.axes:
            source = TdmsSource(self.headers.path, self.headers.layout, [])
            self.axes[group] = [
                (n, rate_of_axis(c.name, c.type_name, c.properties, n, source.raw_reader(c)))
                for c in self.headers.channels
                if c.group == group and (n := c.n_samples) and is_time(c.name, c.type_name, c.properties)
            ]
        return self.axes[group]

    def _group(self, found: TdmsObject) -> Mapping[str, Any]:
        return self.headers.groups.get(found.group, {})


def _began(properties: Mapping[str, Any]) -> float:
    """wf_start_time in microseconds; NaN where it is missing, or the zero of its clock, where nobody set it."""
    said = properties.get("wf_start_time")
    if not isinstance(said, np.datetime64) or np.isnat(said):
        return math.nan
    after = float((said - _ZERO) / np.timedelta64(1, "us"))
    return after if after > 0 else math.nan


# Keys that name the range, or the number of bits, without blanks and case.
_RANGE_KEYS = {
    "fullscale", "fullscalev", "inputrangev", "inputrange", "rangev", "voltagerange", "voltagerangev",
}  # fmt: skip
_BIT_KEYS = {"bits", "adcbits", "bitspersample", "resolutionbits", "adcresolutionbits"}
# Ranges of dynamic signal analysers beside the round ones, in volts (steps of 10 dB; 42.4 V peak).
_RANGES = (0.316, 3.16, 31.6, 42.4)


def full_scale_of(
    dtype: np.dtype[Any], line: tuple[float, float] | None, properties: Mapping[str, Any]
) -> tuple[float | None, str]:
    """Largest magnitude of a channel's samples before `gain`, and how it is known.

    A property that names the range or the bits counts first. Integers of 8 and 16 bits fill their
    type. 24-bit counts are in 32-bit integers, right- or left-aligned: which of them is known only
    where the slope is that of a usual input range.

    Parameters
    ----------
    dtype : numpy.dtype
        Type of the numbers in the file.
    line : (slope, intercept) or None
        The file's scaling where it is a straight line.
    properties : mapping
        Properties of the channel.

    Examples
    --------
    >>> full_scale_of(np.dtype("i4"), (10.0 / 2**23, 0.0), {})[0]
    9.999998807907104
    """
    slope, intercept = line or (math.nan, math.nan)
    bits = None
    for key, value in properties.items():
        name = re.sub(r"[^a-z]", "", key.lower())
        if name in _RANGE_KEYS and isinstance(value, (int, float)) and value > 0:
            return float(value), f"property {key} = {value}"
        if name in _BIT_KEYS and isinstance(value, (int, float)) and 8 <= value <= 32:
            bits, why = int(value), f"property {key} = {value}"
    if dtype.kind != "i" or line is None:
        return None, "not known"
    if bits is None and dtype.itemsize <= 2:
        bits, why = 8 * dtype.itemsize, f"{8 * dtype.itemsize}-bit integers"
    if bits is None and slope != 1.0 and dtype.itemsize == 4:
        bits, why = _guess(slope)
    if bits is None:
        return None, "not known"
    top = 2 ** (bits - 1) - 1
    # The side that is reached first counts.
    return min(abs(intercept + slope * top), abs(intercept - slope * top)), why


def _guess(slope: float) -> tuple[int | None, str]:
    for bits in (24, 32):
        for steps in (2 ** (bits - 1), 2 ** (bits - 1) - 1):
            volts = abs(slope) * steps
            near = [float(f"{volts:.2g}"), *_RANGES]
            if any(math.isclose(volts, r, rel_tol=1e-6) for r in near):
                how = "24-bit integers" if bits == 24 else "left-aligned integers"
                return bits, f"{how}, because the slope is that of an input range of {volts:.4g}"
    return None, ""
