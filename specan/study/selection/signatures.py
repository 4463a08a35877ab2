"""What each candidate does to the whitened residual: its signatures, at as many sizes and shapes as they turn over."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np

from specan.arrays import Real
from specan.errors import ComputationError
from specan.models import Use
from specan.models.effect import ParameterName
from specan.study.estimation.fit import Fit
from specan.study.estimation.linear import Projection
from specan.study.estimation.problem import Problem
from specan.study.selection.candidates import Candidate, grid

ROUNDS = 4  # of refinement of one shape
FEW = 10  # places below which sizes are not distinguished


@dataclass(frozen=True, eq=False)
class Signature:
    """Change of the residual by one candidate at one place of its shapes.

    Attributes
    ----------
    columns : array, (n_rows, q)
        Change when each amplitude goes from its neutral value by its `size`; rows as in the residual
        of the problem without the candidate. A removed prior is a unit step of its prior's row.
    names : tuple of str
        Amplitudes, one a column.
    neutral, size : array, (q,)
        Values that the columns stand for; size 0 where a prior is removed.
    shapes : mapping
        SI values of the shape parameters.
    multiplier_bounds : tuple of float
        Smallest and largest multiple of `size` that the domain allows (one amplitude), else infinite.
    """

    use: Use
    columns: Real
    names: tuple[ParameterName, ...]
    neutral: Real
    size: Real
    shapes: Mapping[str, float]
    multiplier_bounds: tuple[float, float]


Point = Mapping[str, float]
Known = dict[tuple[Use, tuple[tuple[str, float], ...]], "Real | None"]


def signatures(
    problem: Problem,
    fit: Fit,
    found: Sequence[Candidate],
    points: Mapping[Use, Sequence[Point]],
    known: Known,
) -> list[Signature]:
    """Signatures of candidates at a fit of the problem that lacks them, at planned points.

    `known` holds changes that were worked out at the same fit already.
    """
    made: list[Signature] = []
    for candidate in found:
        if candidate.use not in points:
            continue
        if candidate.without_prior:
            made += _without_prior(problem, fit, candidate, known)
        elif len(candidate.amplitudes) > 1:
            made += _several_amplitudes(problem, fit, candidate, points[candidate.use], known)
        else:
            made += _one_amplitude(problem, fit, candidate, points[candidate.use], known)
    return made


def _one_amplitude(
    problem: Problem, fit: Fit, candidate: Candidate, points: Sequence[Point], known: Known
) -> Iterator[Signature]:
    name, neutral = candidate.amplitudes[0], candidate.neutral(candidate.amplitudes[0])
    for point, column in zip(points, changes(problem, fit, candidate, points, known)):
        if column is not None:
            size = point[name] - neutral
            low, high = sorted((end - neutral) / size for end in candidate.extended.domain(name.whole))
            shapes = {n: value for n, value in point.items() if n != name}
            yield Signature(
                candidate.use, column[:, None], (name,), np.array([neutral]), np.array([size]), shapes, (low, high)
            )  # fmt: skip


def _without_prior(problem: Problem, fit: Fit, candidate: Candidate, known: Known) -> Iterator[Signature]:
    """Without its prior a nuisance is free: the same as a free step of the prior's pseudo-datum.

    Then the same together with each amplitude that has no prior, to either side.
    """
    freed = candidate.without_prior
    columns, none = np.zeros((fit.residual.size, len(freed))), np.zeros(len(freed))
    columns[[problem.pseudo_rows[name] for name in freed], range(len(freed))] = 1.0
    shapes = {str(n): default_value(candidate, n) for n in candidate.shapes}
    yield Signature(candidate.use, columns, freed, none, none, shapes, (-np.inf, np.inf))
    fitted = {str(n): float(fit.theta[fit.names.index(n)]) for n in freed}
    held = {**{str(n): candidate.neutral(n) for n in candidate.amplitudes}, **shapes, **fitted}
    for name in [n for n in candidate.amplitudes if n not in freed]:
        neutral, value = candidate.neutral(name), default_value(candidate, name)
        low, high = candidate.extended.domain(name.whole)
        mirrored = min(max(2 * neutral - value, low), high)
        both = [{**held, name: value}, {**held, name: mirrored}]
        there, back = changes(problem, fit, candidate, both, known)
        for column, end in _sides(there, back, value, mirrored):
            yield Signature(
                candidate.use, np.column_stack([columns, column]), (*freed, name),
                np.append(none, neutral), np.append(none, end - neutral), shapes, (-np.inf, np.inf),
            )  # fmt: skip


def with_rows_of(columns: Real, old: Problem, new: Problem) -> Real:
    """Columns over one problem's rows as columns over another's; pseudo-measurements that it lacks do not move."""
    out = np.zeros((new.n_data + len(new.pseudo_rows), *columns.shape[1:]))
    out[: new.n_data] = columns[: old.n_data]
    for name, row in new.pseudo_rows.items():
        if name in old.pseudo_rows:
            out[row] = columns[old.pseudo_rows[name]]
    return out


def _several_amplitudes(
    problem: Problem, fit: Fit, candidate: Candidate, places: Sequence[Point], known: Known
) -> Iterator[Signature]:
    names = candidate.amplitudes
    neutral = np.array([candidate.neutral(n) for n in names])
    value = np.array([default_value(candidate, n) for n in names])
    rest = dict(zip(names, neutral))
    low, high = np.array([candidate.extended.domain(n.whole) for n in names]).T
    mirrored = np.clip(2 * neutral - value, low, high)
    both = [(n, v) for n, *ends in zip(names, value, mirrored) for v in ends]
    points = [{**s, **rest, n: v} for s in places for n, v in both]
    columns = changes(problem, fit, candidate, points, known)
    for k, shapes in enumerate(places):
        part = columns[2 * k * len(names) : 2 * (k + 1) * len(names)]
        sides = [_sides(part[2 * i], part[2 * i + 1], value[i], mirrored[i]) for i in range(len(names))]
        for chosen in product(*sides):
            yield Signature(
                candidate.use, np.column_stack([c for c, _ in chosen]), names, neutral,
                np.array([v for _, v in chosen]) - neutral, shapes, (-np.inf, np.inf),
            )  # fmt: skip


def _sides(there: Real | None, back: Real | None, value: float, mirrored: float) -> list[tuple[Real, float]]:
    """Signature of an amplitude to one side of its neutral value, and to the other one where it is not the same line.

    An error of a zero has a kink there: idle runs feel one of either sign as a load. A descent that sets out on one
    side does not cross it.
    """
    if there is None:
        return [] if back is None else [(back, mirrored)]
    found = [(there, value)]
    if back is not None and np.linalg.norm(back) > 0:
        cosine = float(there @ back) / float(np.linalg.norm(there) * np.linalg.norm(back) or 1.0)
        # 0.99: cosine between signatures to both sides of nothing, above which they are one straight line
        found += [(back, mirrored)] if cosine > -0.99 else []
    return found


def default_value(candidate: Candidate, name: str) -> float:
    """Default of an own element; an amplitude whose default is neutral takes the far plausible end."""
    value = candidate.parameter(name).si.default
    if name in candidate.amplitudes and value == candidate.neutral(name):
        low, high = candidate.plausible(name)
        neutral = candidate.neutral(name)
        return high if high - neutral >= neutral - low else low
    return value


def changes(
    problem: Problem, fit: Fit, candidate: Candidate, points: Sequence[Point], known: Known
) -> list[Real | None]:
    """Whitened change of all rows at each point; None where the model has no finite value there."""
    keys = [(candidate.use, tuple(sorted(point.items()))) for point in points]
    new = {key: point for key, point in zip(keys, points) if key not in known}
    values = _values_at(candidate, fit, list(new.values()))
    # 4_000_000: predicted values held at a time
    chunk = max(1, 4_000_000 // problem.n_data)
    found: list[Real | None] = []
    for first in range(0, len(values), chunk):
        part = values[first : first + chunk]
        try:
            columns = list(residuals(candidate.extended, part).T)
        except ComputationError:  # a loop that runs away at one point must not take the others with it
            columns = [_residual_or_nan(candidate.extended, one) for one in part]
        for column in columns:
            change = np.zeros(fit.residual.size)  # priors included
            change[: column.size] = column - fit.residual[: column.size]
            found.append(change if np.all(np.isfinite(change)) else None)
    known.update(zip(new, found))
    return [known[key] for key in keys]


def _values_at(candidate: Candidate, fit: Fit, points: Sequence[Point]) -> list[dict[str, Any]]:
    """SI values of all parameters at each point, the base's as they were fitted."""
    extended = candidate.extended
    neutral = candidate.effect.neutral_si.items()
    start = extended.start({**fit.values, **{f"{candidate.use}.{n}": v for n, v in neutral}})
    places: dict[str, int] = {name: k for k, name in enumerate(extended.names)}
    many = []
    for point in points:
        theta = start.copy()
        for name, value in point.items():
            theta[places[name]] = value
        many.append(extended.values_at(theta))
    return many


def _residual_or_nan(problem: Problem, values: Mapping[str, Any]) -> Real:
    try:
        return residuals(problem, [values])[:, 0]
    except ComputationError:
        return np.full(problem.n_data, np.nan)


def residuals(problem: Problem, many: Sequence[Mapping[str, Any]]) -> Real:
    """Whitened data residuals (no priors) for several sets of values, one a column."""
    parts = []
    for o in problem.observations:
        seen = [problem.seen_by(o, values) for values in many]
        parts.append(o.whiten(o.predict_many(problem.assembly, seen) - o.measured[:, None]))
    return np.concatenate(parts)


def shape_grid(
    problem: Problem, fit: Fit, found: Sequence[Candidate], known: Known
) -> dict[Use, list[Point]]:
    """Points at which each candidate is to be tried, from how its signature turns at a fit of the problem.

    Amplitudes are moved by sizes from the plausible range, not by infinitesimal steps, so that an
    effect that saturates, or has a kink at zero, is seen as it is. Directions are compared after the
    parameters of the base have taken out what they can. What is worked out for it is kept in `known`.
    """
    base = Projection.of(fit.residual, fit.jacobian)
    # 4000, 400: evaluations for all candidates together, of a small table (175 rows) and of very many rows
    allowed = max(400, min(4000, 4000 * 175 // problem.n_data))
    # 60: places of its shapes that one candidate is tried at
    most = max(1, min(60, allowed // max(len(found), 1)))
    grids: dict[Use, list[Point]] = {}
    for candidate in found:
        own = _ShapeGrid(problem, fit, base, candidate, most, known)
        if candidate.without_prior:
            points = [own.defaults]
        elif len(candidate.amplitudes) > 1:
            points = own.places(default_value(candidate, candidate.amplitudes[0]))
        else:
            sizes, name = own.sizes(), candidate.amplitudes[0]
            places = own.places(sizes[0]) if sizes else []
            points = [{**place, name: size} for place in places for size in sizes]
        if points:
            grids[candidate.use] = points
    return grids


@dataclass(frozen=True, eq=False)
class _ShapeGrid:
    """Own elements of one candidate and their values, one mapping a point."""

    problem: Problem
    fit: Fit
    base: Projection
    candidate: Candidate
    most: int
    known: Known

    @cached_property
    def defaults(self) -> Point:
        return {n: default_value(self.candidate, n) for n in self.candidate.shapes}

    def _left(self, column: Real | None) -> Real | None:
        """The unit vector that is left of a signature; None where nothing is, or no finite value."""
        if column is None:
            return None
        left = self.base.project_out(column)
        size = float(np.linalg.norm(left))
        # 1e-3: share of a signature that is no more than rounding
        # 1e-9: standard deviations of the noise, below which a signature is nothing
        return left / size if size > max(1e-3 * float(np.linalg.norm(column)), 1e-9) else None

    def sizes(self) -> list[float]:
        """Values of the amplitude whose signatures differ in direction; the default first."""
        candidate, amplitude = self.candidate, self.candidate.amplitudes[0]
        neutral = candidate.neutral(amplitude)
        low, high = candidate.plausible(amplitude)
        reach = max(abs(low), abs(high))
        many = self.most >= FEW
        ends = [default_value(candidate, amplitude), high, low][: None if many else 1]
        values = [float(v) for v in dict.fromkeys(ends) if abs(v - neutral) > 1e-9 * reach]
        units = self._units(amplitude, values, self.defaults)
        if many and any(unit is None or _apart(unit, units[0]) for unit in units):
            # It turns with its size, or begins at some size: what is smaller may differ again.
            values += [neutral + 0.1 * (v - neutral) for v in (high, low) if v != neutral]
            between = self._refined(amplitude, sorted(set(values)), self.defaults, len(values) + FEW)
            apart = [v for v in between if abs(v - neutral) > 1e-9 * reach]
            values = list(dict.fromkeys([*values, *apart]))
            units = self._units(amplitude, values, self.defaults)
        kept: list[tuple[float, Real]] = []
        for value, unit in zip(values, units):
            if unit is not None and all(_apart(unit, other) for _, other in kept):
                kept.append((value, unit))
        return [value for value, _ in kept]

    def _units(self, name: str, values: Sequence[float], held: Point) -> list[Real | None]:
        """What is left of the signatures at values of one element."""
        points = [{**held, name: v} for v in values]
        return [
            self._left(column)
            for column in changes(self.problem, self.fit, self.candidate, points, self.known)
        ]

    def _refined(self, name: str, values: list[float], held: Point, most: int) -> list[float]:
        """Values of one element, closer where its signature turns quickly, or begins."""
        for _ in range(ROUNDS):
            units = self._units(name, values, held)
            wide = [k for k in range(len(values) - 1) if _turns(units[k], units[k + 1])]
            if not wide or len(values) + len(wide) > most:
                break
            ends = [(values[k], values[k + 1]) for k in wide]
            values = sorted({*values, *(float(np.sqrt(a * b)) if a > 0 else (a + b) / 2 for a, b in ends)})
        return values

    def places(self, size: float) -> list[Point]:
        """Places of the shapes: each over its plausible range, closer where the signature turns quickly.

        Several shapes are moved one at a time from their defaults, and together on a coarse grid where
        there is space for it.
        """
        candidate, defaults = self.candidate, self.defaults
        if not defaults:
            return [{}]
        each = max((self.most - 1) // len(defaults), 1)
        rest: dict[str, float] = {str(n): candidate.neutral(n) for n in candidate.amplitudes} | {
            candidate.amplitudes[0]: size
        }
        places = [defaults]
        for name in candidate.shapes:
            values = list(grid(*candidate.plausible(name), min(5, each))) if each > 1 else []
            places += [{**defaults, name: v} for v in self._refined(name, values, {**defaults, **rest}, each)]
        if len(defaults) > 1 and len(places) + 3 ** len(defaults) <= self.most:
            coarse = [grid(*candidate.plausible(name), 3) for name in candidate.shapes]
            places += [dict(zip(candidate.shapes, place)) for place in product(*coarse)]
        return list({tuple(p.items()): p for p in places}.values())


def _turns(first: Real | None, second: Real | None) -> bool:
    if first is None or second is None:
        return first is not second
    # 0.8: cosine below which a shape is tried between two others
    return bool(abs(first @ second) < 0.8)


def _apart(first: Real, second: Real | None) -> bool:
    # 0.985: cosine above which two sizes of an effect leave one direction
    return second is None or bool(abs(first @ second) < 0.985)
