"""Faults of the data, as columns that the prediction may lack.

Each is a set of columns over the measured rows for one unit of a coefficient that is known beforehand to a deviation of
so many per cent of what the model predicts: a relative one (a gain) or one of the same size in all rows (a zero). How
large it may be, and from which row on, is summed over.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from specan.study.data.setpoints import TIME
from specan.study.estimation.problem import Problem
from specan.study.observation import Array
from specan.study.observation.table import TableObservation

SIZES = (
    0.003,
    0.01,
    0.03,
    0.1,
    0.3,
)  # of what the model predicts: deviations of what is not known, summed over
PLACES = 40  # rows from which on something may differ, that are tried
LEAST_ROWS = 3  # on either side of such a row
WARM_UP = (0.05, 0.15)  # of the whole measurement, over which first rows settle


@dataclass(frozen=True, eq=False)
class Fault:
    """Something that may be wrong with the data.

    Attributes
    ----------
    name : str
        Short, as ``drift of the zero``.
    text : str
        A sentence without its end.
    columns : array, shape (n, k)
        Change of the measured rows, for a size of one.
    """

    name: str
    text: str
    columns: Array

    def of_size(self, problem: Problem, coefficients: Array) -> Fault:
        """The same with its size in words: by how much it changes the readings of the observable that it shows in."""
        change, model = self.columns @ coefficients, problem.assembly.model
        name, rows = max(
            observable_rows(problem).items(), key=lambda item: float(np.ptp(problem.whiten(change)[item[1]]))
        )
        unit = model.observables[name].unit if name in model.observables else ""
        size = f"{float(np.ptp(change[rows])):.2g} {'' if unit == '1' else unit}".rstrip()
        return replace(self, text=f"{self.text}, {name} by up to {size}")


def sizes_of(problem: Problem, predicted: Array) -> tuple[Array, Array]:
    """What an error may be a share of: what the effects do to each row, and the RMS of that over an observable."""
    percent = problem.assembly.model.rig.discrepancy_percent
    parts = []
    for o, own in zip(problem.observations, problem.split(np.abs(predicted)), strict=False):
        declared = getattr(o, "parts", {}).get("discrepancy")
        parts.append(own if declared is None or not percent else np.abs(declared) / percent * 100)
    relative = np.concatenate(parts)
    level = np.empty_like(relative)
    for rows in observable_rows(problem).values():
        level[rows] = np.sqrt(np.mean(relative[rows] ** 2))
    return relative, level


def observable_rows(problem: Problem) -> dict[str, NDArray[np.bool_]]:
    """Which measured rows hold each observable."""
    names = [
        np.broadcast_to(np.asarray(getattr(o, "observable", o.name), str), o.n) for o in problem.observations
    ]
    together = np.concatenate(names)
    return {str(name): together == name for name in np.unique(together)}


def faults(problem: Problem, predicted: Array) -> Iterator[Fault]:
    """Everything that is looked for in the rows of tables."""
    first, *others = problem.observations
    if others or not isinstance(first, TableObservation):
        return
    relative, level = sizes_of(problem, predicted)
    kinds = {"gain": relative, "zero": level}
    for name, text, shape in _courses(first):
        for kind, size in kinds.items():
            yield Fault(name.format(kind), text.format(kind), size[:, None] * shape)


def _courses(o: TableObservation) -> Iterator[tuple[str, str, Array]]:
    """Name, sentence and course over the rows of every fault."""
    row = _order(o)
    time = np.asarray(o.conditions.get(TIME, row), float)
    if np.ptp(time) > 0:
        u = (time - time.min()) / np.ptp(time)
        yield (
            "drift of the {}",
            "the {} of the readings drifts with the order of the rows",
            (u - 0.5)[:, None],
        )
        for share in WARM_UP:
            yield (
                "first rows",
                "the first rows differ from the others and settle, as while warming up",
                np.exp(-u / share)[:, None],
            )
        for place in np.unique(np.quantile(time, np.linspace(0, 1, PLACES + 2)[1:-1])):
            after = time > place
            if min(after.sum(), (~after).sum()) >= LEAST_ROWS:
                text = f"the {{}} of the readings differs from {_line(o, row, after)} on"
                yield "{} from a row on", text, after[:, None].astype(float)
    if o.recording is not None and np.unique(o.recording).size > 1:
        inside = o.recording[:, None] == np.unique(o.recording)[1:]
        yield "{} of a file", "the {} of the readings differs between the files", inside.astype(float)


def _order(o: TableObservation) -> Array:
    """Place of each row in the order of the files."""
    recording = np.zeros(o.n) if o.recording is None else o.recording
    lines = np.arange(o.n) if o.lines is None else o.lines
    _, place = np.unique(np.stack([recording, lines]), axis=1, return_inverse=True)
    return np.asarray(place.ravel(), float)


def _line(o: TableObservation, row: Array, after: NDArray[np.bool_]) -> str:
    """The first of some rows: ``line 61 of b.csv``."""
    first = int(np.flatnonzero(after)[np.argmin(row[after])])
    if o.lines is None:
        return f"row {first + 1}"
    file = o.recordings[0 if o.recording is None else int(o.recording[first])]
    return f"line {int(o.lines[first])}" + (f" of {file}" if file else "")
