"""Recordings as measurements of a study: what is one, and which rows of it are put aside."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.errors import InputError, RequestError, nearest
from specan.study.observation import DataFile, MeasuredFiles, Observation


def reads(path: Path) -> bool:
    """Whether a file is a recording by its content."""
    from specan.io.open import format_of

    try:
        format_of(path)
    except InputError:
        return False
    return True


def put_aside(
    whole: Observation, file: DataFile, wanted: MeasuredFiles, label_of: Callable[[str], str] = str
) -> NDArray[np.bool_]:
    """Rows that ``channel=Mic 19,Mic 20`` names.

    Parameters
    ----------
    whole : Observation
        Of a recording.
    file, wanted
        What it was read from, and what is to be held out.
    label_of : callable
        Name of the label that a user's key means.
    """
    aside = np.zeros(whole.n, dtype=bool)
    for file_name, where in wanted.hold_out:
        if file_name not in (None, file.name):
            continue
        given, _, levels = where.partition("=")
        key = label_of(given.strip())
        if key not in whole.labels:
            raise RequestError(
                f"{given!r} in {where!r} is not known for a recording", remedy=nearest(given, whole.labels)
            )
        labels = whole.labels[key]
        # a condition that is the same in a whole recording may be that of another recording
        elsewhere = labels.dtype.kind == "f" and np.ptp(labels) == 0
        for level in map(str.strip, levels.split(",")):
            chosen = _alike(labels, level)
            if not chosen.any() and not elsewhere:
                raise RequestError(
                    f"{file.name} has no {key} {level!r}",
                    remedy=nearest(level, [str(v) for v in np.unique(labels)]),
                )
            aside |= chosen
    return aside


def _alike(labels: NDArray[Any], level: str) -> NDArray[np.bool_]:
    """Which labels are what a user wrote: ``25`` is the third octave 25.0."""
    if labels.dtype.kind != "f":
        # one that stands elsewhere in another recording is named after its channel there, too
        return np.asarray((labels == level) | np.char.startswith(labels.astype(str), f"{level} in "))
    try:
        # 0.02: relative, of a level that a user writes: conditions are printed to three digits
        return np.isclose(labels, float(level), rtol=0.02)
    except ValueError:
        return np.zeros(labels.size, dtype=bool)
