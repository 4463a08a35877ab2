"""Sampling rate of a channel: what the user said, the file's increment, known keys, a time channel; never a default."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.arrays import Real
from specan.errors import InputError, NoSignalError
from specan.units import number

TIME_UNITS = {
    "s": 1.0, "sec": 1.0, "second": 1.0, "seconds": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9,
    "min": 60.0, "h": 3600.0,
}  # fmt: skip

# Keys that acquisition programs write, without blanks, case and unit.
RATE_KEYS = {
    "samplingrate", "samplerate", "samplingfrequency", "samplefrequency", "samplingfreq", "samplefreq",
    "precisesamplingfrequency", "samplespersecond", "acquisitionrate", "scanrate", "fs",
}  # fmt: skip
INTERVAL_KEYS = {
    "samplinginterval", "sampleinterval", "samplingperiod", "sampleperiod", "timestep", "deltat", "dt", "logdt",
}  # fmt: skip
_FREQUENCY_UNITS = {"hz": 1.0, "khz": 1e3, "mhz": 1e6, "s/s": 1.0, "ks/s": 1e3, "ms/s": 1e6, "sps": 1.0}

# Rates of common converters; an increment that was rounded on its way into the file is taken back to them.
_NOMINAL = sorted(
    {base / 2**k for base in (204800.0, 200000.0, 192000.0, 176400.0, 250000.0) for k in range(9)}
    | {10.0**k * m for k in range(6) for m in (1, 2, 5)}
    | {65536.0 * 2.0**k for k in range(-6, 3)}
)

_SPECTRUM = re.compile(r"spectr|spektr|widmo|\bfft\b|\bpsd\b|\bfrf\b|coherence", re.IGNORECASE)
# No instrument samples faster (the fastest oscilloscopes take 256e9 samples a second) or slower (one in eleven days).
FASTEST_HZ, SLOWEST_HZ = 1e12, 1e-6

_SAME = 1e-4  # two statements that differ by more contradict each other


@dataclass(frozen=True)
class Rate:
    """A sampling rate in hertz, and where it comes from."""

    hz: float
    how: str


def is_rate(hz: float) -> bool:
    """Whether an instrument may have sampled so: a finite number between 1e-6 and 1e12 Hz.

    Examples
    --------
    >>> is_rate(51200.0), is_rate(0.0), is_rate(float("inf"))
    (True, False, False)
    """
    return SLOWEST_HZ <= hz <= FASTEST_HZ


def from_increment(properties: Mapping[str, Any], n_samples: int, names: str = "") -> Rate | str:
    """Rate from the waveform properties of a channel, or why there is none.

    Parameters
    ----------
    properties : mapping
        Properties of the channel.
    n_samples : int
        Its length; `wf_samples` is the size of one write and says nothing about it.
    names : str
        Names of the channel and its group: a spectrum may be known by nothing else.

    Raises
    ------
    NoSignalError
        The increment is not one of time.
    """
    increment = properties.get("wf_increment")
    if increment is None:
        return "wf_increment is absent"
    unit = str(properties.get("wf_xunit_string", "")).strip()
    dimension = str(properties.get("NI_ExpXDimension", "")).strip()
    axis = str(properties.get("wf_xname", "")).strip().lower()
    if dimension == "f" or unit.lower() in _FREQUENCY_UNITS or axis.startswith("freq"):
        raise NoSignalError(f"its increment is {increment} Hz: a spectrum, not a time signal")
    step = float(increment)
    offset = float(properties.get("wf_start_offset", 0.0))
    scale = TIME_UNITS.get(unit.lower().replace("µ", "u")) if unit else 1.0
    if not math.isfinite(step) or step <= 0.0:
        return f"wf_increment is {increment}"
    if offset < 0.0 and math.isclose(offset, -step * n_samples / 2, rel_tol=2.0 / max(n_samples, 2)):
        raise NoSignalError(
            f"its increment is {step:g} and its offset {offset:g}: a two-sided spectrum, not a time signal"
        )
    if _SPECTRUM.search(names) and step > 1e-3 and dimension != "t" and not (unit or axis):
        raise NoSignalError(
            f"it is called a spectrum, and no property says that its increment {step:g} is a time"
        )
    if scale is None:
        return f"wf_increment is in {unit!r}, which is not time"
    if step == 1.0:
        return "wf_increment is 1.0, which stands for 'not set'"
    if not 1.0 / FASTEST_HZ <= step * scale <= 1.0 / SLOWEST_HZ:
        return f"wf_increment is {step * scale:g} s, which is not a sampling interval"
    hz, rounded = _snap(step * scale)
    how = f"wf_increment {step:.12g} {unit or 's'}"
    return Rate(hz, how + (f", rounded from {hz:g} Hz" if rounded else ""))


def from_keys(places: Sequence[tuple[str, Mapping[str, Any]]], label: str) -> Rate | str:
    """Rate from known keys of channel, group and file, or why there is none.

    Parameters
    ----------
    places : sequence of (name, properties)
        "channel", "group", "file", in the order in which they count.
    label : str
        Name of the recording, for the message.

    Raises
    ------
    InputError
        Two keys contradict each other; both are named.
    """
    found = list(_stated(places))
    if not found:
        return "no known key of the channel, its group or the file gives a rate"
    how, hz = found[0]
    for other, value in found[1:]:
        if abs(value - hz) > _SAME * hz:
            raise InputError(
                f"{label}: {how} and {other} contradict each other",
                expected="one sampling rate",
                remedy="give --sampling-rate HZ",
            )
    return Rate(hz, how)


def contradiction(rate: Rate, places: Sequence[tuple[str, Mapping[str, Any]]]) -> str:
    """A key that says something else than the rate found before it; empty where there is none."""
    for said, hz in _stated(places):
        if abs(hz - rate.hz) > _SAME * rate.hz:
            return f"{said} disagrees and is not used"
    return ""


def _stated(places: Sequence[tuple[str, Mapping[str, Any]]]) -> Iterator[tuple[str, float]]:
    """What known keys say: where and what it stands for, and the rate."""
    for place, properties in places:
        for key, value in properties.items():
            if (hz := _rate_of(key, value)) is not None:
                yield f"the {place} key {key!r} = {value}", hz


def _rate_of(key: str, value: Any) -> float | None:
    """Rate that a property gives; None where its key is not known or its value no rate."""
    match = re.fullmatch(r"(.*?)[\s_]*(?:[\[(]\s*(.+?)\s*[\])]|_(k?hz|m?s))?", key.strip(), re.IGNORECASE)
    name = re.sub(r"[^a-z]", "", match[1].lower()) if match else ""
    said = re.fullmatch(r"\s*([-+]?[\d.,]+(?:e[-+]?\d+)?)\s*(\S*)\s*", str(value), re.IGNORECASE)
    if match is None or name not in RATE_KEYS | INTERVAL_KEYS or said is None:
        return None
    unit = said[2].lower() or (match[2] or match[3] or "").lower().replace("µ", "u")
    amount = number(said[1])
    if amount is None or not math.isfinite(amount) or amount <= 0.0:
        return None
    units, usual = (_FREQUENCY_UNITS, "hz") if name in RATE_KEYS else (TIME_UNITS, "s")
    scale = units.get(unit or usual)
    if scale is None:
        return None
    hz = amount * scale
    if name in INTERVAL_KEYS:
        hz = _snap(hz)[0] if 1.0 / FASTEST_HZ <= hz <= 1.0 / SLOWEST_HZ else 0.0
    return hz if is_rate(hz) else None


def _snap(step: float) -> tuple[float, bool]:
    """Rate of an increment, and whether the increment is that of a round rate, rounded.

    ``1.04167e-05`` is 1/96000 with six digits, ``1.9999999999999998e-05`` is 1/50000 less one bit.

    Examples
    --------
    >>> _snap(1.04167e-05), _snap(1.9999999999999998e-05)
    ((96000.0, True), (50000.0, True))
    """
    hz = 1.0 / step
    candidates = [r for r in _NOMINAL if abs(r - hz) < 1e-3 * hz]
    candidates += [float(f"{hz:.{digits}g}") for digits in range(2, 8)]
    digits = len(Decimal(repr(step)).normalize().as_tuple().digits)
    for rate in candidates:
        exact = 1.0 / rate
        if exact == step:
            return rate, False
        bits = abs(exact - step) < 1e-12 * step or _single(exact) == _single(step) == step
        # Fewer digits would take one rate for another; common rates lie further apart than any.
        enough = digits >= (4 if rate in _NOMINAL else 5)
        if bits or (enough and float(f"{exact:.{digits}g}") == step):
            return rate, True
    return hz, False


def _single(value: float) -> float:
    return float(np.float32(value))


# "T" is a temperature or a torque, "t" is the time.
_TIME_NAME = re.compile(
    r"((?i:time|zeit|czas|temps|tiempo|time[ _]?stamps?)|t)(?:[ _]*[\[(]\s*(\w+)\s*[\])]|[ _](\w+))?"
)
_FREQUENCY_NAME = re.compile(r"(freq\w*|f)\s*[\[(]?\s*k?hz\s*[\])]?", re.IGNORECASE)
_UNIT_KEYS = ("unit_string", "Unit_String", "NI_UnitDescription", "Unit", "Units")
# How far a stamp may lie from a uniform grid, in steps: beyond it a sample is missing or the clock was not a clock.
_SCATTER = 0.25
_ALL = 400_000  # longer axes are looked at in three places


def is_time(name: str, type_name: str, properties: Mapping[str, Any]) -> bool:
    """Whether a channel holds time by its type, or by its name and nothing against it."""
    if type_name == "TimeStamp":
        return True
    match = _TIME_NAME.fullmatch(name.strip())
    if match is None:
        return False
    unit = _unit(name, properties)
    return unit == "" or unit in TIME_UNITS


def is_frequency(name: str, properties: Mapping[str, Any]) -> bool:
    """Whether a channel is called a frequency in hertz."""
    named = _FREQUENCY_NAME.fullmatch(name.strip()) is not None
    bare = re.fullmatch(r"freq\w*|f", name.strip(), re.IGNORECASE) is not None
    return named or (bare and any(str(properties.get(k, "")).lower() in ("hz", "khz") for k in _UNIT_KEYS))


def rate_of_axis(
    name: str,
    type_name: str,
    properties: Mapping[str, Any],
    n_samples: int,
    read: Callable[[int, int], NDArray[Any]],
) -> Rate | str:
    """The rate that a time channel gives, or why it gives none.

    Parameters
    ----------
    read : callable
        Raw samples `start` to `stop` of the channel.
    """
    unit = "s" if type_name == "TimeStamp" else _unit(name, properties)
    channel = f"the time channel {name!r}"
    if n_samples < 3:
        return f"{channel} has {n_samples} samples"
    if not unit and not type_name.endswith("Float"):
        return f"{channel} holds counts without a unit"
    seconds, places = _sample(read, n_samples, TIME_UNITS[unit or "s"])
    if not np.all(np.isfinite(seconds)):
        return f"{channel} holds values that are not finite"
    step = (seconds[-1] - seconds[0]) / (n_samples - 1)
    if not step > 0.0:
        return f"{channel} does not increase"
    if not is_rate(1.0 / step):
        return f"{channel} has steps of {step:g} s"
    scatter = float(np.max(np.abs(seconds - places * step))) / step
    if scatter > _SCATTER:
        steps = np.diff(seconds)[np.diff(places) == 1]
        return f"{channel} is not uniform (steps from {steps.min():.6g} to {steps.max():.6g} s)"
    how = channel + ("" if unit else ", taken as seconds")
    if scatter > 1e-3:
        how += f"; its stamps scatter by up to {100 * scatter:.2g} % of a step"
    return Rate(_round(1.0 / step, scatter / n_samples), how)


def _unit(name: str, properties: Mapping[str, Any]) -> str:
    """Unit of a time channel as its properties or its name give it; empty where they do not."""
    for key in _UNIT_KEYS:
        text = str(properties.get(key, "")).strip().lower().replace("µ", "u")
        if text:
            return text
    match = _TIME_NAME.fullmatch(name.strip())
    return (match[2] or match[3] or "").lower().replace("µ", "u") if match else ""


def _sample(
    read: Callable[[int, int], NDArray[Any]], n_samples: int, scale: float
) -> tuple[Real, NDArray[np.int64]]:
    """Seconds since the first stamp and the places of the stamps; all, or three stretches of a long axis."""
    if n_samples <= _ALL:
        spans = [(0, n_samples)]
    else:
        width = _ALL // 4
        middle = n_samples // 2
        spans = [(0, width), (middle, middle + width), (n_samples - width, n_samples)]
    first = read(0, 1)
    seconds = np.concatenate([_elapsed(read(a, b), first, scale) for a, b in spans])
    return seconds, np.concatenate([np.arange(a, b) for a, b in spans])


def _elapsed(raw: NDArray[Any], first: NDArray[Any], scale: float) -> Real:
    """Seconds since the first stamp; differences are taken before anything is rounded to float64."""
    if raw.dtype.names:
        whole = (raw["seconds"] - first["seconds"]).astype(np.float64)
        # The fractions are unsigned: the difference wraps and is right modulo 2^64.
        ahead = (raw["second_fractions"] - first["second_fractions"]).astype(np.float64) * 2.0**-64
        return whole + ahead - (raw["second_fractions"] < first["second_fractions"])
    if raw.dtype.kind in "iu":
        return (raw.astype(np.int64) - first.astype(np.int64)).astype(np.float64) * scale
    return (raw.astype(np.float64) - float(first[0])) * scale


def _round(hz: float, relative: float) -> float:
    """The roundest rate within the uncertainty of the axis."""
    for digits in range(2, 12):
        rounded = float(f"{hz:.{digits}g}")
        if abs(rounded - hz) <= max(relative, 1e-9) * hz:
            return rounded
    return hz
