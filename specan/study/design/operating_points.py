"""Which measurement would decide between the explanations that are left.

Over conditions that the rig can run, of many a quasi-random choice, the point is taken where the rivals differ most in
units of what a reading there could know (Box & Hill 1967; Buzzi-Ferraris & Forzatti 1984):

    sum over pairs  w_a w_b (y_a - y_b)^2 / (sigma^2 + v_a + v_b),

with v the variance that a prediction inherits from the fitted parameters. After each point the parameters'
covariances are updated as if it had been measured, and neighbours of points that are taken are left out. Of a
field the points are places of receivers (`specan.study.design.receiver_places`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

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
MOST_POINTS = 4096  # conditions that are looked at; of more combinations half as many, and the corners
MOST_CORNERS = 10  # conditions up to which all corners are among them


@dataclass(frozen=True)
class Proposal:
    """A condition to measure, or another kind of measurement where no condition would tell.

    Attributes
    ----------
    conditions : mapping
        By column, in the column's unit; empty for another kind of measurement.
    predictions : mapping
        What each rival expects, in `unit`.
    unit, observable : str
        Of the predictions, and what is read.
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
    observable: str = ""


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
    place, measured = _places(start.problem, planned), _measured_places(start.problem, planned)
    usable = np.isfinite(predicted) & inside_block(start.problem, planned, blocks[0])
    found = []
    for _ in range(EXPLORED):
        gap = KDTree(measured).query(place)[0]
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
    seen = {n: np.concatenate([o.conditions[n] for o in problem.observations]) for n in planned.conditions}
    return _places(problem, planned, seen)


def _greedy(rivals: Sequence[Refit], planned: TableObservation, count: int) -> list[Proposal]:
    weights = _weights(rivals)
    predicted = np.stack([_at(r.problem, planned).predictions(r.fit.theta)[0] for r in rivals])
    usable = np.all(np.isfinite(predicted), axis=0)
    slopes = [_slopes(r, planned) for r in rivals]
    covariances = [r.fit.covariance * r.dispersion for r in rivals]
    place = _places(rivals[0].problem, planned)
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


def _places(problem: Problem, planned: TableObservation, of: Mapping[str, Array] | None = None) -> Array:
    """Conditions as shares of the range that is planned of them; of the planned readings, or of others."""
    wanted = of or planned.conditions
    planes = {n: v for n, v in planned.conditions.items() if _can_be_set(problem, n)}
    return np.column_stack([(wanted[n] - v.min()) / (np.ptp(v) or 1.0) for n, v in planes.items()])


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
        if _can_be_set(rivals[0].problem, name)
    }
    predictions = {_name(r): float(value) for r, value in zip(rivals, predicted)}
    sigma = float(planned.sigma[row])
    where = ", ".join(f"{_spoken(model, column, value)}" for column, value in conditions.items())
    unit = f" {printed_unit(observable.unit)}".rstrip()
    several = len({name for o in rivals[0].problem.observations for name in _observables(o)}) > 1
    of = f" of {observable.name}" if several else ""
    said = ", ".join(f"{name} expects {value:.4g}{unit}{of}" for name, value in predictions.items())
    told = (
        f"one reading separates them by {least:.1f} sigma"
        if least >= SEPARATES
        else (f"one reading separates some of them, by up to {apart:.1f} sigma")
    )
    text = f"{where}: {said}; sigma there is {sigma:.2g}{unit}, {told}"
    return Proposal(text, conditions, predictions, observable.unit, sigma, apart, least, observable.name)


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
    """Conditions within the limits, SI; None where the rig names none that can be set, or the data are no table.

    Every combination of some levels, or where these are too many a Sobol sequence of them and the corners. Groups of
    rows (specimens) that were measured can be measured again. Around a `block` that fails at a level which the levels
    are too coarse for, they are those in the middle between measured ones.
    """
    model = problem.assembly.model
    if not all(isinstance(o, TableObservation) for o in problem.observations):
        return None
    limits = {n: ends for n, ends in model.rig.limits.items() if _can_be_set(problem, n)}
    if not limits:
        return None
    axes = {}
    for name, (low, high) in limits.items():
        condition = model.conditions[name]
        even = _round_steps(condition, low, high)
        between = _between_measured(problem, condition, (low, high), block)
        axes[name] = between if between.size and np.ptp(between) < float(np.min(np.diff(even))) else even
    axes |= {
        n: np.arange(float(len(model.group_elements[n]))) for n in model.groups if _can_be_set(problem, n)
    }
    levels = list(axes.values())
    if prod(map(len, levels)) <= MOST_POINTS:
        points = np.array(list(product(*levels)))
    else:
        from scipy.stats import qmc  # slow to load, and seldom needed

        spread = qmc.Sobol(len(levels), scramble=False).random(MOST_POINTS // 2)
        points = np.column_stack(
            [own[(share * own.size).astype(int)] for share, own in zip(spread.T, levels)]
        )
        if len(levels) <= MOST_CORNERS:
            points = np.vstack([list(product(*((own[0], own[-1]) for own in levels))), points])
    return dict(zip(axes, points.T))


def _can_be_set(problem: Problem, name: str) -> bool:
    """Whether a person chooses a condition: it has limits or is a group, and is no time that goes on by itself."""
    model = problem.assembly.model
    if name in model.groups:
        return len(model.group_elements.get(name, ())) > 1
    if name not in model.rig.limits or name not in model.conditions:
        return False
    if model.conditions[name].unit != "s":
        return True
    return any(np.any(np.diff(o.conditions[name]) < 0) for o in problem.observations if name in o.conditions)


def _observables(observation: Any) -> list[str]:
    return list(dict.fromkeys(observation.observable.tolist()))


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
    gaps, middles = np.diff(around), (around[1:] + around[:-1]) / 2
    steps = 10.0 ** np.floor(np.log10(gaps / 4))  # as round as leaves them between their neighbours
    found = np.round(middles / steps) * steps
    return np.asarray(found[(limits[0] <= found) & (found <= limits[1])])


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
    kinds, size = _observables(observation), next(iter(grid.values())).size
    conditions = {
        name: grid[name] if name in grid else np.full(size, _typical(problem, name, values))
        for name, values in observation.conditions.items()
    }
    sigma = [observation.sigma[_nearest(observation, kind, conditions, grid)] for kind in kinds]
    return replace(
        observation,
        name="planned",
        observable=np.repeat(kinds, size),
        measured=np.zeros(size * len(kinds)),
        conditions={name: np.tile(values, len(kinds)) for name, values in conditions.items()},
        covariance=np.concatenate(sigma) ** 2,
        labels={},
        recordings=problem.recordings,  # each its own elements of a parameter; the readings count to the first
        recording=np.zeros(size * len(kinds), dtype=np.intp),
        parts={},
        series=None,
        position=None,
        lines=None,
        replicate_group=None,
        pure_error_dof=0.0,
    )


def _typical(problem: Problem, name: str, values: Array) -> float:
    """The median; of groups the first."""
    return 0.0 if problem.assembly.model.conditions[name].group else float(np.median(values))


def _nearest(
    observation: TableObservation, kind: str, conditions: Mapping[str, Array], grid: Mapping[str, Array]
) -> NDArray[np.intp]:
    """Row of one observable that is nearest to each planned reading."""
    mine = np.flatnonzero(observation.observable == kind)
    spans = {n: float(np.ptp(conditions[n])) or 1.0 for n in grid if n in observation.conditions}
    seen, wanted = (
        np.column_stack([of[n][rows] / span for n, span in spans.items()])
        for of, rows in ((observation.conditions, mine), (conditions, slice(None)))
    )
    return np.asarray(mine[KDTree(seen).query(wanted)[1]])


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
