"""The largest value that a channel's converter can give; samples there are clipped."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

import numpy as np

# Keys that name the range, or the number of bits, without blanks and case.
_RANGE_KEYS = {
    "fullscale",
    "fullscalev",
    "inputrangev",
    "inputrange",
    "rangev",
    "voltagerange",
    "voltagerangev",
}
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
