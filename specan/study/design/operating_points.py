"""Which measurement would decide between the explanations that are left.

Over a grid of conditions that the rig can run, the point is taken where the rivals differ most in units of what
a reading there could know (Box & Hill 1967; Buzzi-Ferraris & Forzatti 1984):

    sum over pairs  w_a w_b (y_a - y_b)^2 / (sigma^2 + v_a + v_b),

with v the variance that a prediction inherits from the fitted parameters. After each point the parameters'
covariances are updated as if it had been measured, and neighbours of points that are taken are left out. Of a
field the points are places of receivers (`specan.study.design.receiver_places`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.models import Condition, Model
from specan.study.design.receiver_places import best_places, can_place, in_words, spoken_place, where_it_fails
from specan.study.estimation.problem import Problem
from specan.study.localisation.localise import Block
from specan.study.observation.table import TableObservation
from specan.study.selection.refits import Refit
from specan.units import convert, printed_unit

Array = NDArray[np.float64]

LEAST_WEIGHT = 0.02  # a wrong leader must not freeze the design
NEAR = 0.15  # share of the ranges within which a point is a near duplicate
SAME = 1e-6  # share of the ranges within which two points are one
EXPLORED = 2  # measurements that are proposed for something unknown
SEPARATES = 2.0  # sigma that a measurement must promise to be worth proposing


STEPS = 9  # levels of each condition


@dataclass(frozen=True)
class Proposal:
    """A condition to measure, or another kind of measurement where no condition would tell.

    Attributes
    ----------
    conditions : mapping
        By column, in the column's unit; empty for another kind of measurement.
    predictions : mapping
        What each rival expects, in `unit`.
    sigma : float
        Standard uncertainty of a reading there.
    separation_sigma : float
        Largest difference of two rivals over its standard uncertainty.
    least_sigma : float or None
        The smallest one: a reading with two or more tells all rivals apart.
    """

    text: str
    conditions: Mapping[str, float | str]
    predictions: Mapping[str, float]
    unit: str
    sigma: float | None
    separation_sigma: float | None
    least_sigma: float | None = None


def propose(rivals: Sequence[Refit], count: int = 3, *, other_kinds: bool = True) -> tuple[Proposal, ...]:
    """Propose measurements that would tell rivals apart, the best first.

    Parameters
    ----------
    rivals : sequence of Refit
        Sets of effects over one base; two at least.
    count : int
        How many.
    other_kinds : bool
        Whether to name another kind of measurement where no condition separates them.

    Returns
    -------
    tuple of Proposal
        Conditions, or what else to do where none within the rig's limits separates the rivals.
    """
    if len(rivals) < 2:
        return ()
    problem = rivals[0].problem
    if problem.assembly.model.receivers is not None and can_place(problem):
        found = _positions(rivals, count)
        return tuple(found or (_other_kinds(rivals) if other_kinds else []))
    grid = operating_grid(problem)
    planned = None if grid is None else planned_readings(problem, grid)
    found = []
    if planned is not None:
        found = _greedy(rivals, planned, count)
    if not found and other_kinds:
        found = _other_kinds(rivals)
    return tuple(found)


def explore(start: Refit, blocks: Sequence[Block]) -> tuple[Proposal, ...]:
    """Where to look at something unknown: far from what was measured, in the corner where the model fails.

    Parameters
    ----------
    start : Refit
        The model as it is.
    blocks : sequence of Block
        Where it fails, the worst first.
    """
    receivers = start.problem.assembly.model.receivers
    if blocks and receivers is not None and can_place(start.problem):
        noun = _noun(start.problem.assembly.model)
        return tuple(
            _position_to_explore(p, blocks[0], noun) for p in where_it_fails(start, blocks[0], EXPLORED)
        )
    grid = operating_grid(start.problem, blocks[0] if blocks else None)
    if grid is None or not blocks:
        return ()
    planned = planned_readings(start.problem, grid)
    predicted = _at(start.problem, planned).predictions(start.fit.theta)[0]
    place, measured = _places(planned), _measured_places(start.problem, planned)
    usable = np.isfinite(predicted) & inside_block(start.problem, planned, blocks[0])
    found = []
    for _ in range(EXPLORED):
        gap = np.min(np.linalg.norm(place[:, None] - measured[None], axis=2), axis=1)
        row = int(np.argmax(np.where(usable, gap, -1.0)))
        if not usable[row] or gap[row] < SAME:
            break
        one = _proposal([start], planned, predicted[None, row], row, 0.0)
        told = f"where the model fails ({blocks[0].text}) and nothing was measured nearby"
        where = one.text.split(":")[0]
        found.append(replace(one, text=f"{where}: {told}", separation_sigma=None))
        measured = np.vstack([measured, place[row]])
    return tuple(found)


def _positions(rivals: Sequence[Refit], count: int) -> list[Proposal]:
    """Places for receivers that separate the rivals."""
    names = [_name(r) for r in rivals]
    model = rivals[0].problem.assembly.model
    unit = model.observables[str(rivals[0].problem.observations[0].observable[0])].unit  # type: ignore[attr-defined]
    noun = _noun(model)
    return [
        Proposal(
            in_words(found, names, unit, noun),
            dict(zip(("x_m", "y_m", "z_m"), found.place_m, strict=True)),
            dict(zip(names, found.levels_dB, strict=True)),
            "dB",
            found.sigma_dB,
            found.separation,
        )
        for found in best_places(rivals, _weights(rivals), count, SEPARATES)
    ]


def _position_to_explore(place: tuple[float, float, float], block: Block, noun: str) -> Proposal:
    told = f"where the model fails ({block.short_place}: {block.text}) and nothing was measured nearby"
    conditions = dict(zip(("x_m", "y_m", "z_m"), place, strict=True))
    return Proposal(f"a {noun} at {spoken_place(place)}: {told}", conditions, {}, "dB", None, None)


def _noun(model: Model) -> str:
    assert model.receivers is not None
    return model.receivers.noun


def _measured_places(problem: Problem, planned: TableObservation) -> Array:
    columns = []
    for name, values in planned.conditions.items():
        if np.ptp(values) > 0:
            seen = np.concatenate([o.conditions[name] for o in problem.observations])
            columns.append((seen - values.min()) / np.ptp(values))
    return np.column_stack(columns)


def _greedy(rivals: Sequence[Refit], planned: TableObservation, count: int) -> list[Proposal]:
    weights = _weights(rivals)
    predicted = np.stack([_at(r.problem, planned).predictions(r.fit.theta)[0] for r in rivals])
    usable = np.all(np.isfinite(predicted), axis=0)
    slopes = [_slopes(r, planned) for r in rivals]
    covariances = [r.fit.covariance * r.dispersion for r in rivals]
    place = _places(planned)
    found: list[Proposal] = []
    for _ in range(count):
        variance = np.stack([np.einsum("ij,jk,ik->i", j, c, j) for j, c in zip(slopes, covariances)])
        gain = np.zeros(predicted.shape[1])
        apart, least = np.zeros(predicted.shape[1]), np.full(predicted.shape[1], np.inf)
        for a, b in combinations(range(len(rivals)), 2):
            square = (predicted[a] - predicted[b]) ** 2 / planned.sigma**2 / (1 + variance[a] + variance[b])
            gain += weights[a] * weights[b] * square
            apart, least = np.maximum(apart, np.sqrt(square)), np.minimum(least, np.sqrt(square))
        best = int(np.argmax(np.where(usable, gain, -1.0)))
        if apart[best] < SEPARATES:
            break
        found.append(
            _proposal(rivals, planned, predicted[:, best], best, float(apart[best]), float(least[best]))
        )
        usable &= np.max(np.abs(place - place[best]), axis=1) > NEAR
        covariances = [after_reading(c, j[best]) for c, j in zip(covariances, slopes)]
        if not np.any(usable):
            break
    return found


def _weights(rivals: Sequence[Refit]) -> Array:
    dispersion = min(r.dispersion for r in rivals)
    bic = np.array([r.bic(dispersion) for r in rivals])
    weight = np.exp(-0.5 * (bic - bic.min()))
    weight = np.maximum(weight / weight.sum(), LEAST_WEIGHT)
    return np.asarray(weight / weight.sum())


def _at(problem: Problem, planned: TableObservation) -> Problem:
    return problem.over([planned])


def _slopes(refit: Refit, planned: TableObservation) -> Array:
    """Derivative of each planned prediction over the parameters, in units of sigma."""
    return np.asarray(_at(refit.problem, planned).jacobian(refit.fit.theta)[: planned.n])


def after_reading(covariance: Array, slope: Array) -> Array:
    """Covariance of the parameters once a reading with this slope, in units of sigma, has been made."""
    along = covariance @ slope
    return covariance - np.outer(along, along) / (1 + slope @ along)


def _places(planned: TableObservation) -> Array:
    columns = [v for v in planned.conditions.values() if np.ptp(v) > 0]
    return np.column_stack([(v - v.min()) / np.ptp(v) for v in columns])


def _proposal(
    rivals: Sequence[Refit],
    planned: TableObservation,
    predicted: Array,
    row: int,
    apart: float,
    least: float = 0.0,
) -> Proposal:
    """A planned reading in words; `apart` and `least`: its largest and smallest separation of two rivals, in sigma."""
    model = rivals[0].problem.assembly.model
    observable = model.observables[str(planned.observable[row])]
    conditions = {
        model.conditions[name].column: _shown(model, name, float(values[row]))
        for name, values in planned.conditions.items()
        if np.ptp(values) > 0
    }
    predictions = {_name(r): float(value) for r, value in zip(rivals, predicted)}
    sigma = float(planned.sigma[row])
    where = ", ".join(f"{_spoken(model, column, value)}" for column, value in conditions.items())
    unit = f" {printed_unit(observable.unit)}".rstrip()
    said = ", ".join(f"{name} expects {value:.4g}{unit}" for name, value in predictions.items())
    told = (
        f"one reading separates them by {least:.1f} sigma"
        if least >= SEPARATES
        else (f"one reading separates some of them, by up to {apart:.1f} sigma")
    )
    text = f"{where}: {said}; sigma there is {sigma:.2g}{unit}, {told}"
    return Proposal(text, conditions, predictions, observable.unit, sigma, apart, least)


def _shown(model: Model, name: str, value: float) -> float | str:
    """A condition in the unit of its column; of a group, the name."""
    condition = model.conditions[name]
    if condition.group:
        return model.group_elements[name][int(value)]
    return float(f"{convert(value, condition.unit, condition.column_unit):.6g}")


def _spoken(model: Model, column: str, value: float | str) -> str:
    condition = next(c for c in model.conditions.values() if c.column == column)
    if isinstance(value, str):
        return f"{condition.words} {value}"
    return f"{condition.words} {value:g} {printed_unit(condition.column_unit)}".rstrip()


def _name(refit: Refit) -> str:
    return " with ".join(str(u) for u in sorted(refit.uses)) or "the model as it is"


def _other_kinds(rivals: Sequence[Refit]) -> list[Proposal]:
    """What the effects themselves say would separate them, where no condition within the limits does."""
    effects = rivals[0].problem.assembly.model.effects
    uses = sorted({use.name for r in rivals for use in r.uses})
    return [
        Proposal(f"{name}: {effects[name].separate_by}", {}, {}, "", None, None)
        for name in uses
        if effects[name].separate_by
    ]


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
