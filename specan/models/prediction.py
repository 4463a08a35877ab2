"""A model's prediction over rows of operating conditions, in the units and columns of a table."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.errors import RequestError, nearest
from specan.models.chosen_model import ChosenModel
from specan.models.model import Model
from specan.units import convert

Columns = dict[str, NDArray[np.float64]]


def grid(model: Model, axes: Mapping[str, Sequence[float]]) -> Columns:
    """Every combination of the values of some columns; the last column runs fastest.

    Examples
    --------
    >>> from specan.models.catalogue import example_model
    >>> rows = grid(example_model("worm-gear"), {"speed_rpm": [1500, 2000], "output_torque_Nm": [5, 10]})
    >>> rows["output_torque_Nm"]
    array([ 5., 10.,  5., 10.])
    """
    known = {c.column for c in model.conditions.values()}
    for column in axes:
        if column not in known:
            raise RequestError(f"{model.name} has no condition {column!r}", remedy=nearest(column, known))
    rows = np.array(list(product(*axes.values())), dtype=float).T
    return dict(zip(axes, rows, strict=True))


def to_conditions(model: Model, columns: Mapping[str, NDArray[np.float64]]) -> Columns:
    """SI conditions from the columns of a table; columns that are no condition are passed over."""
    return {
        c.name: np.asarray(convert(columns[c.column], c.column_unit, c.unit), dtype=float)
        for c in model.conditions.values()
        if c.column in columns
    }


def predict(chosen: ChosenModel, columns: Mapping[str, NDArray[np.float64]]) -> dict[str, Any]:
    """Values of the observables for each row, SI.

    Raises
    ------
    ComputationError
        A loop that an effect closes does not settle.
    """
    model = chosen.assembly.model
    nodes = [o.quantity for o in model.observables.values()]
    found = chosen.assembly.evaluate(to_conditions(model, columns), chosen.values, wanted=nodes)
    size = len(next(iter(columns.values())))
    return {
        name: np.array(np.broadcast_to(found[o.quantity], (size,)), dtype=float)
        for name, o in model.observables.items()
    }


def simulated_table(
    chosen: ChosenModel,
    columns: Mapping[str, NDArray[np.float64]],
    *,
    noise: float = 0.0,
    repeats: int = 1,
    seed: int = 0,
    observables: Collection[str] | None = None,
) -> Columns:
    """The table that would be measured: conditions and observables, one row a reading, in the columns' units.

    Parameters
    ----------
    chosen : ChosenModel
    columns : mapping
        Columns of the conditions, in their own units.
    noise : float
        Standard deviation of one reading of each observable, in its column's unit, normal and independent.
    repeats : int
        Readings of each condition, numbered in a column ``repeat`` where there are several.
    seed : int
        Of the noise.
    observables : collection of str, optional
        Those that are read; all by default.
    """
    rows = {name: np.tile(np.asarray(values, float), repeats) for name, values in columns.items()}
    size = len(next(iter(columns.values())))
    random = np.random.default_rng(seed)
    found = dict(rows)
    for name, values in predict(chosen, rows).items():
        if observables is not None and name not in observables:
            continue
        observable = chosen.assembly.model.observables[name]
        shown = convert(values, observable.unit, observable.column_unit or observable.unit)
        found[observable.header] = np.asarray(shown) + noise * random.standard_normal(values.size)
    if repeats > 1:
        found["repeat"] = np.repeat(np.arange(1.0, repeats + 1), size)
    return found


@dataclass(frozen=True)
class Outside:
    """A range of validity that some rows leave."""

    quantity: str
    low: float
    high: float
    unit: str
    rows: int


def outside_validity(chosen: ChosenModel, columns: Mapping[str, NDArray[np.float64]]) -> list[Outside]:
    """Ranges within which the effects hold and that some rows leave."""
    model, found = chosen.assembly.model, []
    ranges = chosen.assembly.validity
    if not ranges:
        return []
    quantities = [name for name in ranges if name in model.quantities]
    values = chosen.assembly.evaluate(to_conditions(model, columns), chosen.values, wanted=quantities)
    for name, (low, high) in ranges.items():
        value = np.asarray(values[name])
        rows = int(np.count_nonzero((value < low) | (value > high)))
        if rows:
            node = model.quantities.get(name) or model.conditions[name]
            found.append(Outside(name, low, high, node.unit, rows))
    return found
