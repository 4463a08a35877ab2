"""Time responses of universal files (data sets 58 of function type 1) as recordings."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from specan.data.recording import ArraySource, Recording
from specan.errors import InputError
from specan.io.channel_table import ChannelTable
from specan.io.sampling_rate import Rate
from specan.io.signals import Signal, recording_of
from specan.io.time_axis import axis_of
from specan.io.uff import TIME_RESPONSE, TRANSFER_FUNCTION, DataSet, is_uff, read_uff


def recognises(start: bytes) -> bool:
    """Whether a file that begins so is a universal file."""
    return is_uff(start)


def open_recording(
    path: Path, *, label: str, channel_table: ChannelTable | None = None, sampling_rate: float | None = None
) -> Recording:
    """Read the time responses of a universal file; they are held in memory.

    A channel is called by the first line of its data set's description, or else by its node and direction.

    Raises
    ------
    InputError
        The file is damaged, or holds no time response.
    RequestError
        pyuff is not installed.
    """
    sets = read_uff(path, (TIME_RESPONSE,))
    if not sets:
        others = len(read_uff(path, (TRANSFER_FUNCTION,)))
        raise InputError(
            f"{label} is a universal file without a time response"
            + (f"; it holds {others} transfer functions" if others else ""),
            remedy="give transfer functions to a study: specan study new" if others else "",
        )
    names = [one.title or one.response for one in sets]
    names = [
        n if names.count(n) == 1 else f"{n} {one.response}".strip()
        for n, one in zip(names, sets, strict=True)
    ]
    names = [n if names.count(n) == 1 else f"{n} ({k})" for k, n in enumerate(names, 1)]
    signals = [
        Signal(name, one.values.size, one.unit, _rate(one)) for name, one in zip(names, sets, strict=True)
    ]
    samples = [np.asarray(one.values.real, dtype=np.float64) for one in sets]
    return recording_of(
        label, signals, ArraySource(samples), channel_table=channel_table, sampling_rate=sampling_rate
    )


def _rate(one: DataSet) -> Rate | None:
    """Rate by the data set's axis; a step has six digits in the file, and is taken as the rate that rounds to it."""
    found = axis_of("time", "DoubleFloat", {"unit_string": "s"}, one.x.size, lambda a, b: one.x[a:b]).rate
    if found is None:
        return None
    for digits in range(2, 8):
        hz = float(f"{found.hz:.{digits}g}")
        if float(f"{1 / hz:.5e}") == float(f"{1 / found.hz:.5e}"):
            return Rate(hz, "the step of the data set's axis")
    return Rate(found.hz, "the step of the data set's axis")
