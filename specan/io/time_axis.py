"""Channels that hold the time or the frequency at which the other channels of their group were taken."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.io.sampling_rate import TIME_UNITS, Rate, is_rate

# "T" is a temperature or a torque, "t" is the time.
_TIME_NAME = re.compile(
    r"((?i:time|zeit|czas|temps|tiempo|time[ _]?stamps?)|t)(?:[ _]*[\[(]\s*(\w+)\s*[\])]|[ _](\w+))?"
)
_FREQUENCY_NAME = re.compile(r"(freq\w*|f)\s*[\[(]?\s*k?hz\s*[\])]?", re.IGNORECASE)
_UNIT_KEYS = ("unit_string", "Unit_String", "NI_UnitDescription", "Unit", "Units")
# How far a stamp may lie from a uniform grid, in steps: beyond it a sample is missing or the clock was not a clock.
_SCATTER = 0.25
_ALL = 400_000  # longer axes are looked at in three places


@dataclass(frozen=True)
class Axis:
    """A channel that is an axis: its rate, or why it gives none."""

    name: str
    n_samples: int
    rate: Rate | None
    why_not: str = ""


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


def axis_of(
    name: str,
    type_name: str,
    properties: Mapping[str, Any],
    n_samples: int,
    read: Callable[[int, int], NDArray[Any]],
) -> Axis:
    """The rate that a time channel gives.

    Parameters
    ----------
    read : callable
        Raw samples `start` to `stop` of the channel.
    """
    if n_samples < 3:
        return Axis(name, n_samples, None, f"the time channel {name!r} has {n_samples} samples")
    unit = "s" if type_name == "TimeStamp" else _unit(name, properties)
    if not unit and not type_name.endswith("Float"):
        return Axis(name, n_samples, None, f"the time channel {name!r} holds counts without a unit")
    seconds, places = _sample(read, n_samples, TIME_UNITS[unit or "s"])
    if not np.all(np.isfinite(seconds)):
        return Axis(name, n_samples, None, f"the time channel {name!r} holds values that are not finite")
    step = (seconds[-1] - seconds[0]) / (n_samples - 1)
    if not step > 0.0:
        return Axis(name, n_samples, None, f"the time channel {name!r} does not increase")
    if not is_rate(1.0 / step):
        return Axis(name, n_samples, None, f"the time channel {name!r} has steps of {step:g} s")
    scatter = float(np.max(np.abs(seconds - places * step))) / step
    if scatter > _SCATTER:
        steps = np.diff(seconds)[np.diff(places) == 1]
        return Axis(
            name, n_samples, None,
            f"the time channel {name!r} is not uniform (steps from {steps.min():.6g} to {steps.max():.6g} s)",
        )  # fmt: skip
    hz = _round(1.0 / step, scatter / n_samples)
    how = f"the time channel {name!r}" + ("" if unit else ", taken as seconds")
    if scatter > 1e-3:
        how += f"; its stamps scatter by up to {100 * scatter:.2g} % of a step"
    return Axis(name, n_samples, Rate(hz, how))


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
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
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


def _elapsed(raw: NDArray[Any], first: NDArray[Any], scale: float) -> NDArray[np.float64]:
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
