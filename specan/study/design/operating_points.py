"""Which measurement would decide between the explanations that are left.

Over conditions that the rig can run, of many a quasi-random choice, the point is taken whose reading is expected to
tell most about the explanation: the mutual information of the two (Lindley 1956), by the bound of Kolchinsky and Tracey
(2017, Entropy 19:361) for readings that each explanation expects with a normal law,

    I = -sum_a w_a ln sum_b w_b exp(-D_ab)
    D_ab = (y_a - y_b)^2 / (4 (s_a + s_b)) + 1/2 ln((s_a + s_b) / (2 sqrt(s_a s_b)))

with w their probabilities and s = 1 + v the variance of a reading in units of sigma^2, of which v is what a prediction
inherits from the fitted parameters. After each point the parameters' covariances are updated as if it had been
measured, and neighbours of points that are taken are left out.
Of a field the points are places of receivers that the kind of measurement finds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product
from math import prod

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from specan.arrays import Real
from specan.models import Condition, Model
from specan.study.estimation.problem import Problem
from specan.study.localisation.localise import Block
from specan.study.observation import brought
from specan.study.observation.table import TableObservation
from specan.study.selection.refits import Refit
from specan.units import convert, spoken

SEPARATES = 2.0  # sigma that a measurement must promise to be worth proposing, or to tell as much as that
EXPLORED = 2  # measurements that are proposed for something unknown


@dataclass(frozen=True)
class Proposal:
    """A condition to measure, or another kind of measurement where no condition would tell.

    Attributes
    ----------
    conditions : mapping
        By column, in the column's unit; of a receiver its coordinates; empty for another kind of measurement.
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


def name_of(rival: Refit) -> str:
    """What a rival adds to the model, in words."""
    return " with ".join(str(u) for u in sorted(rival.uses)) or "the model as it is"


def propose(
    rivals: Sequence[Refit],
    probabilities: Sequence[float] = (),
    *,
    count: int = 3,
    other_kinds: bool = True,
) -> tuple[Proposal, ...]:
    """The measurements that best separate the explanations that are left, best first.

    Parameters
    ----------
    rivals : sequence of Refit
        Explanations that the data could not decide between; one alone has nothing to decide.
    probabilities : sequence of float
        Of the rivals; by default all are as probable.
    count : int
        Largest number of conditions.
    other_kinds : bool
        Whether another kind of measurement is proposed where no condition tells them apart.
    """
    if len(rivals) < 2:
        return ()
    # at least 0.02: a wrong leader must not freeze the design
    weights = np.maximum(probabilities or np.ones(len(rivals)), 0.02)
    problem = rivals[0].problem
    stand = brought(problem.observations, "propose_places")
    if stand is not None:
        found = stand(rivals, weights, count)
    else:
        grid = operating_grid(problem)
        found = [] if grid is None else _greedy(rivals, weights, planned_readings(problem, grid), count)
    return tuple(found or (_other_kinds(rivals) if other_kinds else []))


def explore(start: Refit, blocks: Sequence[Block]) -> tuple[Proposal, ...]:
    """Measurements for something unknown: where the model fails, far from what was measured."""
    problem = start.problem
    stand = brought(problem.observations, "explore_places")
    if blocks and stand is not None:
        return tuple(stand(problem, blocks[0]))
    grid = operating_grid(problem, blocks[0]) if blocks else None
    if grid is None:
        return ()
    planned = planned_readings(problem, grid)
    predicted = problem.over([planned]).predictions(start.fit.theta)[0]
    place = _places(problem, planned.conditions)
    measured = np.vstack([_places(problem, o.conditions) for o in problem.observations])
    found = []
    for _ in range(EXPLORED):
        gap = KDTree(measured).query(place)[0]
        row = int(np.argmax(np.where(np.isfinite(predicted), gap, -1.0)))
        if not np.isfinite(predicted[row]) or gap[row] < 1e-6:
            break
        one = _proposal([start], planned, predicted[None, row], row)
        told = f"where the model fails ({blocks[0].text}) and nothing was measured nearby"
        where = one.text.split(":")[0]
        found.append(replace(one, text=f"{where}: {told}", separation_sigma=None))
        measured = np.vstack([measured, place[row]])
    return tuple(found)


def _greedy(rivals: Sequence[Refit], weights: Real, planned: TableObservation, count: int) -> list[Proposal]:
    there = [(r.problem.over([planned]), r.fit.theta) for r in rivals]
    predicted = np.stack([problem.predictions(theta)[0] for problem, theta in there])
    usable = np.all(np.isfinite(predicted), axis=0)
    slopes = [np.asarray(problem.jacobian(theta)[: planned.n]) for problem, theta in there]
    covariances = [r.fit.covariance * r.fit.dispersion for r in rivals]
    place = _places(rivals[0].problem, planned.conditions)
    share = weights / np.sum(weights)
    doubt = float(-share @ np.log(share))
    # the part of it that a reading resolves of two as probable, so many sigma apart
    two = expected_information(np.array([[0.0], [SEPARATES]]), np.ones((2, 1)), np.ones(2))
    enough = float(two[0] / np.log(2.0))
    found: list[Proposal] = []
    while len(found) < count and np.any(usable):
        variance = np.stack([np.einsum("ij,jk,ik->i", j, c, j) for j, c in zip(slopes, covariances)])
        told = expected_information(predicted / planned.sigma, 1 + variance, weights)
        best = int(np.argmax(np.where(usable, told, -1.0)))
        squares = [
            (predicted[a, best] - predicted[b, best]) ** 2 / (1 + variance[a, best] + variance[b, best])
            for a, b in combinations(range(len(rivals)), 2)
        ]
        apart, least = (float(np.sqrt(end(squares))) / planned.sigma[best] for end in (max, min))
        resolved = float(told[best]) / doubt
        if max(apart / SEPARATES, resolved / enough) < 1.0:
            break
        found.append(_proposal(rivals, planned, predicted[:, best], best, apart, least, resolved))
        # what is nearer than 0.15 of the limits is a near duplicate
        usable &= np.max(np.abs(place - place[best]), axis=1) > 0.15
        covariances = [after_reading(c, j[best]) for c, j in zip(covariances, slopes)]
    return found


def expected_information(means: Real, variances: Real, weights: Real) -> Real:
    """What a reading is expected to tell about which of some normal laws it comes from, in nats.

    Parameters
    ----------
    means, variances : array, shape (k, n)
        Of k laws at n points.
    weights : array, shape (k,)
        Probabilities.

    Examples
    --------
    >>> far, near = [0.0, 9.0], [0.0, 0.0]
    >>> np.exp(expected_information(np.array([far, near]).T, np.ones((2, 2)), np.ones(2))).round(3)
    array([2., 1.])
    """
    share = np.asarray(weights) / np.sum(weights)
    both = variances[:, None] + variances
    distance = (means[:, None] - means) ** 2 / (4 * both)
    distance += 0.5 * np.log(both / (2 * np.sqrt(variances[:, None] * variances)))
    return np.asarray(-share @ np.log(np.einsum("b,abn->an", share, np.exp(-distance))))


def after_reading(covariance: Real, slope: Real) -> Real:
    """Covariance of parameters once a reading with this slope in units of its sigma is known as well."""
    along = covariance @ slope
    return covariance - np.outer(along, along) / (1 + slope @ along)


def _places(problem: Problem, conditions: Mapping[str, Real]) -> Real:
    """Rows in the conditions that can be set, in parts of their limits."""
    ends = {n: problem.assembly.model.rig.limits.get(n, (0.0, 1.0)) for n in _settable(problem)}
    return np.column_stack([(conditions[n] - low) / ((high - low) or 1.0) for n, (low, high) in ends.items()])


def _proposal(
    rivals: Sequence[Refit],
    planned: TableObservation,
    predicted: Real,
    row: int,
    apart: float = 0.0,
    least: float = 0.0,
    resolved: float = 0.0,
) -> Proposal:
    """A planned reading in words.

    `apart` and `least`: its largest and smallest separation of two rivals, in sigma; `resolved`: the part of what is
    not known that it is expected to tell at least.
    """
    model = rivals[0].problem.assembly.model
    observable = model.observables[str(planned.observable[row])]
    settable = _settable(rivals[0].problem)
    conditions = {
        model.conditions[name].column: _shown(model, name, float(values[row]))
        for name, values in planned.conditions.items()
        if name in settable
    }
    predictions = {name_of(r): float(value) for r, value in zip(rivals, predicted)}
    sigma = float(planned.sigma[row])
    where = ", ".join(_spoken(model, column, value) for column, value in conditions.items())
    several = len(set(planned.observable.tolist())) > 1
    of = f" of {observable.name}" if several else ""
    said = ", ".join(
        f"{name} expects {spoken(value, unit=observable.unit, digits=4)}{of}"
        for name, value in predictions.items()
    )
    told = (
        f"one reading separates them by {least:.1f} sigma"
        if least >= SEPARATES
        else f"one reading separates some of them, by up to {apart:.1f} sigma"
        if apart >= SEPARATES
        else "none of them predicts it well, and one reading is expected to resolve at least "
        f"{100 * resolved:.0f} % of the doubt"
    )
    text = f"{where}: {said}; sigma there is {spoken(sigma, unit=observable.unit, digits=2)}, {told}"
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
    return f"{condition.words} {spoken(value, unit=condition.column_unit, digits=6)}"


def _other_kinds(rivals: Sequence[Refit]) -> list[Proposal]:
    """What the effects themselves say would separate them, where no condition within the limits does."""
    effects = rivals[0].problem.assembly.model.effects
    uses = sorted({use.name for r in rivals for use in r.uses})
    return [
        Proposal(f"{name}: {effects[name].separate_by}", {}, {}, "", None, None)
        for name in uses
        if effects[name].separate_by
    ]


def operating_grid(problem: Problem, block: Block | None = None) -> dict[str, Real] | None:
    """Conditions within the limits, SI; None where the rig names none that can be set, or the data are no table.

    Parameters
    ----------
    problem : Problem
    block : Block, optional
        Where a model fails: conditions that it names lie between its level and the measured ones beside it.
    """
    most = 4096  # conditions that are looked at; of more combinations half as many, and the corners
    model, settable = problem.assembly.model, _settable(problem)
    tables = all(isinstance(o, TableObservation) for o in problem.observations)
    if not tables or not any(name in model.rig.limits for name in settable):
        return None
    axes = {}
    for name in settable:
        condition, limits = model.conditions[name], model.rig.limits.get(name)
        named = None if block is None else block.where.get(condition.column)
        if limits is not None:
            axes[name] = _round_steps(condition, *limits)
            if named is not None:
                axes[name] = _beside(problem, condition, float(named))
        elif named is not None:
            axes[name] = np.array([float(model.group_elements[name].index(str(named)))])
        else:
            axes[name] = np.arange(float(len(model.group_elements[name])))
    levels = list(axes.values())
    if prod(map(len, levels)) <= most:
        points = np.array(list(product(*levels)))
    else:
        from scipy.stats import qmc  # slow to load, and seldom needed

        spread = qmc.Sobol(len(levels), scramble=False).random(most // 2)
        points = np.column_stack(
            [own[(share * own.size).astype(int)] for share, own in zip(spread.T, levels)]
        )
        if len(levels) <= 10:  # conditions up to which all corners are among them
            points = np.vstack([list(product(*((own[0], own[-1]) for own in levels))), points])
    return dict(zip(axes, points.T))


def _settable(problem: Problem) -> list[str]:
    """Conditions of all data that a person chooses: they have limits or are groups, and are no time that goes on."""
    model = problem.assembly.model

    def goes_on(name: str) -> bool:
        read = [o.conditions[name] for o in problem.observations]
        return model.conditions[name].unit == "s" and all(np.all(np.diff(values) >= 0) for values in read)

    there = [n for n in model.conditions if all(n in o.conditions for o in problem.observations)]
    limited = [n for n in there if n in model.rig.limits and not goes_on(n)]
    return limited + [n for n in there if len(model.group_elements.get(n, ())) > 1]


def _beside(problem: Problem, condition: Condition, level: float) -> Real:
    """Middles between the measured values around a level, within the limits; the level itself where there are none."""
    at = float(convert(level, condition.column_unit, condition.unit))
    measured = np.unique(np.concatenate([o.conditions[condition.name] for o in problem.observations]))
    nearest = int(np.argmin(np.abs(measured - at)))
    around = measured[max(nearest - 1, 0) : nearest + 2]
    gaps, middles = np.diff(around), (around[1:] + around[:-1]) / 2
    steps = 10.0 ** np.floor(np.log10(gaps / 4))  # as round as leaves them between their neighbours
    found, (low, high) = np.round(middles / steps) * steps, problem.assembly.model.rig.limits[condition.name]
    inside = found[(low <= found) & (found <= high)]
    return np.asarray(inside if inside.size else [at])


def _round_steps(condition: Condition, low: float, high: float) -> Real:
    """Levels that a person would set, round in the column's unit: even steps, and finer ones towards zero."""
    ends = [float(convert(v, condition.unit, condition.column_unit)) for v in (low, high)]
    raw = (ends[1] - ends[0]) / 8  # nine levels or more
    size = 10.0 ** np.floor(np.log10(raw))
    step = size * next(m for m in (1, 2, 2.5, 5, 10) if m * size >= raw * 0.999)
    even = np.arange(np.ceil(ends[0] / step), np.floor(ends[1] / step) + 1) * step
    # What acts at small values alone lies below the first of even steps.
    small = [m * size / 10**k for k in range(2) for m in (1, 2, 5) if m * size / 10**k < step]
    fine = np.array([v for v in (*small, *np.negative(small)) if ends[0] < v < ends[1]])
    levels = np.unique(np.concatenate([ends, even, fine]))
    return np.asarray(convert(levels, condition.column_unit, condition.unit))


def planned_readings(problem: Problem, grid: Mapping[str, Real]) -> TableObservation:
    """The grid as readings that are still to be made, as uncertain as the nearest ones that were made."""
    observation = problem.observations[0]
    assert isinstance(observation, TableObservation)
    kinds = list(dict.fromkeys(observation.observable.tolist()))
    size, known = next(iter(grid.values())).size, problem.assembly.model.conditions
    conditions = {
        name: grid[name] if name in grid else np.full(size, 0.0 if known[name].group else np.median(values))
        for name, values in observation.conditions.items()
    }
    sigma = [observation.sigma[_nearest(observation, kind, conditions, grid)] for kind in kinds]
    return TableObservation(
        name="planned",
        observable=np.repeat(kinds, size),
        measured=np.zeros(size * len(kinds)),
        conditions={name: np.tile(values, len(kinds)) for name, values in conditions.items()},
        covariance=np.concatenate(sigma) ** 2,
        recordings=problem.recordings,  # each its own elements of a parameter; the readings count to the first
        groups=observation.groups,
    )


def _nearest(
    observation: TableObservation, kind: str, conditions: Mapping[str, Real], grid: Mapping[str, Real]
) -> NDArray[np.intp]:
    """Row of one observable that is nearest to each planned reading."""
    mine = np.flatnonzero(observation.observable == kind)
    spans = {n: float(np.ptp(conditions[n])) or 1.0 for n in grid if n in observation.conditions}
    seen, wanted = (
        np.column_stack([of[n][rows] / span for n, span in spans.items()])
        for of, rows in ((observation.conditions, mine), (conditions, slice(None)))
    )
    return np.asarray(mine[KDTree(seen).query(wanted)[1]])
