"""Scaling chains of a TDMS channel: checked when the file is opened, applied block by block."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
from nptdms import scaling as npt
from numpy.typing import NDArray

from specan.errors import InputError

# Scale types that npTDMS computes; for others it would return raw counts.
_TYPES = (
    "Linear", "Polynomial", "RTD", "Strain", "Table", "Thermistor", "Thermocouple",
    "Add", "Subtract", "AdvancedAPI",
)  # fmt: skip
_TYPE_KEY = re.compile(r"NI_Scale\[(\d+)\]_Scale_Type")


@dataclass(frozen=True)
class Scaling:
    """From the numbers in the file to the channel's values.

    Attributes
    ----------
    chain : nptdms.scaling.MultiScaling or None
        None for numbers that are stored as they are meant.
    scaler : int or None
        The DAQmx scaler that feeds the chain.
    text : str
        For the reader: "linear, 1.19e-06 per count".
    """

    chain: Any = None
    scaler: int | None = None
    text: str = "none"

    def line(self, dtype: np.dtype[Any]) -> tuple[float, float] | None:
        """Slope and intercept, where the chain is one straight line on integers or float64."""
        if self.chain is None:
            return 1.0, 0.0
        last = self.chain.scalings[-1]
        feeds = (npt.RAW_DATA_INPUT_SOURCE, self.scaler)
        if not isinstance(last, npt.LinearScaling) or last.input_source not in feeds:
            return None
        if last.input_source == self.scaler and not isinstance(
            self.chain.scalings[last.input_source], npt.DaqMxScalerScaling
        ):
            return None
        if dtype.kind not in "iu" and dtype != np.float64:
            return None  # npTDMS computes single precision in single precision
        return float(last.slope), float(last.intercept)

    def apply(self, raw: NDArray[Any]) -> NDArray[Any]:
        """Values of raw samples."""
        if self.chain is None:
            return raw
        chunk = SimpleNamespace(data=raw, scaler_data=None)
        if self.scaler is not None:
            chunk = SimpleNamespace(data=None, scaler_data={self.scaler: raw})
        values: NDArray[Any] = self.chain.scale(chunk)
        return values


def scaling_of(
    channel: Mapping[str, Any],
    group: Mapping[str, Any],
    root: Mapping[str, Any],
    scalers: tuple[int, ...] = (),
) -> Scaling:
    """Scaling from the properties of a channel, its group or the file, whichever has one first.

    Parameters
    ----------
    channel, group, root : mapping
        Properties.
    scalers : tuple of int
        Identifiers of the DAQmx scalers of the channel; empty for ordinary data.

    Raises
    ------
    InputError
        A scale of an unknown type, one that lacks a coefficient, or one that refers to itself.
    """
    for properties in (channel, group, root):
        unknown = sorted(
            {str(v) for k, v in properties.items() if _TYPE_KEY.fullmatch(k) and v not in _TYPES}
        )
        if unknown and properties.get("NI_Scaling_Status") != "scaled":
            raise InputError(
                f"its scale of the type {unknown[0]!r} is not known",
                expected="one of " + ", ".join(_TYPES),
                remedy="write the channel with the scaling applied",
            )
    try:
        chain = npt.get_scaling(channel, group, root)
    except Exception as fault:  # npTDMS passes on KeyError, ValueError and TypeError of the properties
        raise InputError(f"its scaling is not complete ({type(fault).__name__}: {fault})") from None
    if chain is None and scalers:
        raise InputError(
            "its DAQmx counts come without a scaling",
            expected="NI_Scale properties that turn counts into a unit",
        )
    if chain is None:
        return Scaling()
    _follow(chain.scalings, len(chain.scalings) - 1, (), scalers)
    return Scaling(chain, scalers[0] if scalers else None, _text(chain.scalings[-1]))


def _follow(scales: list[Any], number: int, way: tuple[int, ...], scalers: tuple[int, ...]) -> None:
    """Walk from a scale to what feeds it, down to the samples."""
    if number == npt.RAW_DATA_INPUT_SOURCE:
        if scalers:
            raise InputError("its scaling needs plain samples, but the channel has DAQmx counts")
        return
    if number in way:
        raise InputError(
            f"its scale {number} refers to itself", expected="a chain that begins at the samples"
        )
    if not 0 <= number < len(scales):
        raise InputError(f"its scaling refers to scale {number}", expected=f"a number below {len(scales)}")
    scale = scales[number]
    if isinstance(scale, npt.DaqMxScalerScaling):
        if scale.scale_id not in scalers:
            raise InputError(f"its scale {number} has no type", expected="one of " + ", ".join(_TYPES))
        return
    for source in ("input_source", "left_input_source", "right_input_source"):
        if hasattr(scale, source):
            _follow(scales, getattr(scale, source), (*way, number), scalers)


def _text(scale: Any) -> str:
    if isinstance(scale, npt.LinearScaling):
        shift = f" {scale.intercept:+.6g}" if scale.intercept else ""
        return f"linear, {scale.slope:.6g} per count{shift}"
    if isinstance(scale, npt.DaqMxScalerScaling):
        return "DAQmx counts"
    return type(scale).__name__.removesuffix("Scaling").lower()
