"""Operating points that could be measured: a grid within the rig's limits, as readings still to be made."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.models import Condition
from specan.study.estimation.problem import Problem
from specan.study.localisation.result import Block
from specan.study.observation.table import TableObservation
from specan.units import convert

Array = NDArray[np.float64]

STEPS = 9  # levels of each condition


def operating_grid(problem: Problem, block: Block | None = None) -> dict[str, Array] | None:
    """Conditions within the limits, SI, every combination; None where the rig names none or the data are no table.

    Groups of rows (specimens) that were measured can be measured again. Around a `block` that fails at a level which
    the grid is too coarse for, its points are those in the middle between measured ones.
    """
    model = problem.assembly.model
    limits = {n: ends for n, ends in model.rig.limits.items() if n in model.conditions}
    if not limits or not all(isinstance(o, TableObservation) for o in problem.observations):
        return None
    axes = {}
    for name, (low, high) in limits.items():
        condition = model.conditions[name]
        even = _round_steps(condition, low, high)
        between = _between_measured(problem, condition, (low, high), block)
        axes[name] = between if between.size and np.ptp(between) < float(np.min(np.diff(even))) else even
    for name in model.groups:
        count = len(model.group_elements.get(name, ()))
        if count > 1:
            axes[name] = np.arange(float(count))
    points = np.array(list(product(*axes.values())))
    return dict(zip(axes, points.T))


def _between_measured(
    problem: Problem, condition: Condition, limits: tuple[float, float], block: Block | None
) -> Array:
    """Middles between the measured values around a block's level: from the level below it to the one above."""
    level = _level(condition, block)
    if level is None:
        return np.empty(0)
    measured = np.unique(np.concatenate([o.conditions[condition.name] for o in problem.observations]))
    nearest = int(np.argmin(np.abs(measured - level)))
    around = measured[max(nearest - 1, 0) : nearest + 2]
    middles = (around[1:] + around[:-1]) / 2
    return np.array([float(f"{m:.3g}") for m in middles if limits[0] <= m <= limits[1]])


def _level(condition: Condition, block: Block | None) -> float | None:
    """Level of a condition at which a block fails, SI; None where it names none."""
    if block is None or condition.group or condition.column not in block.where:
        return None
    return float(convert(float(block.where[condition.column]), condition.column_unit, condition.unit))


def _round_steps(condition: Condition, low: float, high: float) -> Array:
    """Levels that a person would set: even steps, round in the column's unit."""
    ends = [float(convert(v, condition.unit, condition.column_unit)) for v in (low, high)]
    raw = (ends[1] - ends[0]) / (STEPS - 1)
    size = 10.0 ** np.floor(np.log10(raw))
    step = size * next(m for m in (1, 2, 2.5, 5, 10) if m * size >= raw * 0.999)
    inner = np.arange(np.ceil(ends[0] / step), np.floor(ends[1] / step) + 1) * step
    levels = np.unique(np.concatenate([ends[:1], inner, ends[1:]]))
    return np.asarray(convert(levels, condition.column_unit, condition.unit))


def planned_readings(problem: Problem, grid: Mapping[str, Array]) -> TableObservation:
    """The grid as readings that are still to be made, as uncertain as the nearest ones that were made."""
    observation = problem.observations[0]
    assert isinstance(observation, TableObservation)
    size = next(iter(grid.values())).size
    conditions = {
        name: grid[name] if name in grid else np.full(size, _typical(problem, name, values))
        for name, values in observation.conditions.items()
    }
    near = _nearest(observation, conditions, grid)
    main = max(set(observation.observable.tolist()), key=observation.observable.tolist().count)
    sigma = observation.sigma[near]
    return replace(
        observation,
        name="planned",
        observable=np.full(size, main),
        measured=np.zeros(size),
        conditions=conditions,
        covariance=np.diag(sigma**2),
        labels={},
        recordings=problem.recordings,  # each its own elements of a parameter; the readings count to the first
        recording=np.zeros(size, dtype=np.intp),
        parts={},
        series=None,
        position=None,
        pure_error_dof=0.0,
    )


def _typical(problem: Problem, name: str, values: Array) -> float:
    """The median; of groups the first."""
    return 0.0 if problem.assembly.model.conditions[name].group else float(np.median(values))


def _nearest(
    observation: TableObservation, conditions: Mapping[str, Array], grid: Mapping[str, Array]
) -> NDArray[np.intp]:
    distance: Any = 0.0
    for name in grid:
        if name in observation.conditions:
            span = float(np.ptp(conditions[name])) or 1.0
            distance = (
                distance + ((conditions[name][:, None] - observation.conditions[name][None, :]) / span) ** 2
            )
    return np.asarray(np.argmin(distance, axis=1))


def inside_block(problem: Problem, planned: TableObservation, block: Block) -> NDArray[np.bool_]:
    """Planned points at the levels of a block, or at those of the grid next to them."""
    model = problem.assembly.model
    inside = np.ones(planned.n, dtype=bool)
    for condition in model.conditions.values():
        values = planned.conditions.get(condition.name)
        if condition.column not in block.where or values is None or not np.ptp(values) > 0:
            continue
        if condition.group:
            inside &= values == model.group_elements[condition.name].index(str(block.where[condition.column]))
            continue
        level = _level(condition, block)
        assert level is not None, "it is in the block"
        gap = np.sort(np.unique(np.abs(values - level)))
        spread = np.ptp(values)
        measured = np.concatenate([o.conditions[condition.name] for o in problem.observations])
        fine = spread < np.ptp(measured) / STEPS  # points between measured ones: all are around the level
        inside &= fine | (np.abs(values - level) <= gap[0] * (1 + 1e-9))
    return inside
