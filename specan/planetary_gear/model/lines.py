"""Which order lines a model predicts, and what a recording tells about them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Stated:
    """Where a recording tells an operating condition that holds for the whole of it.

    Attributes
    ----------
    prefix : str
        Property of a group or of the recording, ``NAME_UNIT``, in the condition's `column_unit`.
    channel : str
        Channel whose mean it is, where no property tells.
    default : float
        Nominal value, SI.
    """

    prefix: str
    channel: str = ""
    default: float = float("nan")


@dataclass(frozen=True)
class Tacho:
    """A channel with pulses of a shaft that makes `ratio` turns a turn of the reference shaft."""

    channel: str
    ratio: float


@dataclass(frozen=True, eq=False)
class OrderLines:
    """Order lines of vibration sensors, counted per turn of a reference shaft.

    Attributes
    ----------
    axis : str
        The model's axis that names the sensors; their channels have these names.
    order : array (lines,)
        Orders that the machine can show.
    harmonic : array of int (lines,)
        Number of the harmonic that each belongs to: what lies between machine and sensor gives the lines of one
        harmonic one unknown gain.
    offset : array (lines,)
        Order less that of its harmonic.
    family : tuple of str
        What each line is called together with those of the other harmonics: ``66h+-1``.
    order_condition, rate_condition : str
        Conditions of the model that hold a line's order and a shaft's speed.
    rate_ratio : float
        That speed over the speed of the reference shaft.
    stated : mapping
        Where a recording tells the other conditions.
    tachos : tuple of Tacho
        Channels that tell the angle, the finest first.
    index : str
        Channel with one pulse a turn of the reference shaft: phases are those at its pulses.
    period : int
        Turns of the reference shaft after which the machine repeats itself. Which of them a recording begins with,
        nobody knows.
    discrepancy : float
        Relative standard uncertainty of the model, common to lines within a few orders.
    path : float
        Relative standard uncertainty of lines beside a harmonic that is common to all harmonics: how strongly they
        are heard there depends on the path to the sensor.
    response : float
        Relative standard uncertainty of lines that the ideal machine does not have, against those that it has; common
        to the lines of a harmonic.
    """

    axis: str
    order: Array
    harmonic: NDArray[np.intp]
    offset: Array
    family: tuple[str, ...]
    order_condition: str
    rate_condition: str
    rate_ratio: float
    tachos: tuple[Tacho, ...]
    index: str
    period: int = 1
    stated: Mapping[str, Stated] = field(default_factory=dict)
    discrepancy: float = 0.1
    path: float = 0.3
    response: float = 0.5
