"""What each candidate does to the whitened residual: its signatures, at as many sizes and shapes as they turn over.

And what they promise, by linear algebra (the score test). With Q an orthonormal basis of the base's whitened Jacobian
and j~ = (I - Q Q^T) j a signature, chi-square falls by (j~^T r)^2 / (j~^T j~) at the multiple -j~^T r / j~^T j~ of it:
the modification index and the expected parameter change (Saris, Satorra & van der Veld 2009, SEM 16:561). On a boundary
the multiple is held to what the domain allows.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np

from specan.arrays import Real
from specan.errors import ComputationError
from specan.models import Use
from specan.models.effect import ParameterName
from specan.result import gathered
from specan.study.estimation.fit import Fit
from specan.study.estimation.linear import Projection
from specan.study.estimation.problem import Problem
from specan.study.selection.candidates import Candidate, grid


@dataclass(frozen=True, eq=False)
class Scored:
    """A signature with what it promises.

    Attributes
    ----------
    chi2_reduction : float
        Fall in chi-square that the linearised refit promises.
    expected_change : array, (q,)
        Multiple of the signature at which it is reached.
    """

    signature: Signature
    chi2_reduction: float
    expected_change: Real

    @property
    def use(self) -> Use:
        """The candidate."""
        return self.signature.use

    @property
    def amplitudes(self) -> int:
        """Number of columns."""
        return len(self.signature.names)

    @property
    def count(self) -> int:
        """Number of parameters that it stands for: its amplitudes and shapes."""
        return self.amplitudes + len(self.signature.shapes)


def score(fit: Projection, found: Iterable[Signature]) -> list[Scored]:
    """Score every signature, those first that promise most; those collinear with its Jacobian are left out.

    Parameters
    ----------
    fit : Projection
        The base.
    found : iterable of Signature
    """
    scored = []
    for signature in found:
        columns = signature.columns
        projected = fit.project_out(columns)
        # 1e-6: share of a signature, in chi-square, below which it is collinear with the base's Jacobian
        if not np.sum(projected**2) > 1e-6 * np.sum(columns**2):
            continue
        if projected.shape[1] == 1:
            (column,), (low, high) = projected.T, signature.multiplier_bounds
            along, size = float(column @ fit.residual), float(column @ column)
            # 1.0: chi-square that a signature must be able to leave at some size in its domain
            if size * max(abs(low), abs(high)) ** 2 < 1.0:
                continue
            multiple = min(max(-along / size, low), high)
            gain = -2 * multiple * along - multiple**2 * size
            scored.append(Scored(signature, gain, np.array([multiple])))
        else:
            multiple_q, *_ = np.linalg.lstsq(projected, -fit.residual, rcond=1e-9)
            gain = float(fit.residual @ fit.residual - np.sum((fit.residual + projected @ multiple_q) ** 2))
            scored.append(Scored(signature, gain, np.asarray(multiple_q, dtype=float)))
    return sorted(scored, key=lambda s: -s.chi2_reduction)


def best_of_each(scored: Sequence[Scored]) -> dict[Use, list[Scored]]:
    """Signatures of each candidate, and candidates by their best, in the order of `score`: best first."""
    return gathered((item.use, item) for item in scored)


def different(items: Sequence[Scored], count: int) -> list[Scored]:
    """The best signature of a candidate and the best of those that point elsewhere, in shape or size."""
    taken = [items[0]]
    for item in items[1:]:
        if len(taken) == count:
            break
        same = item.signature.place in [t.signature.place for t in taken]
        # 0.95: of the gain of another start: too near to it to lead elsewhere
        if item.chi2_reduction < 0.95 * taken[-1].chi2_reduction and not same:
            taken.append(item)
    return taken


ROUNDS = 4  # of refinement of one shape
FEW = 10  # places below which sizes are not distinguished


@dataclass(frozen=True, eq=False)
class Signature:
    """Change of the residual by one candidate at one place of its shapes.

    Attributes
    ----------
    columns : array, (n_rows, q)
        Change when each amplitude goes from its neutral value by its `size`; rows as in the residual
        of the problem without the candidate. Of one whose prior is removed, a unit step of it without that prior.
    names : tuple of str
        Amplitudes, one a column.
    neutral, size : array, (q,)
        Values that the columns stand for.
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
    multiplier_bounds: tuple[float, float] = (-np.inf, np.inf)

    @property
    def place(self) -> tuple[Any, ...]:
        """Amplitudes with their sizes, and shapes: those of two that point elsewhere differ."""
        return self.names, tuple(self.size), tuple(self.shapes.items())

    def moved(self, problem: Problem, theta: Real, multiples: Real) -> dict[str, float]:
        """Values of its elements at some multiples, beside others at theta of a problem."""
        there = dict(zip(problem.names, theta.tolist(), strict=True))
        own = zip(self.names, self.neutral, self.size, multiples, strict=True)
        return {str(n): float(there.get(n, neutral) + m * size) for n, neutral, size, m in own} | dict(
            self.shapes
        )


Point = Mapping[str, float]


class Signatures:
    """Signatures of candidates at a fit of the problem that lacks them; each change is worked out once.

    Parameters
    ----------
    problem : Problem
    fit : Fit
    known : mapping, optional
        Changes that were worked out at the same fit already.
    """

    def __init__(self, problem: Problem, fit: Fit, known: Mapping[Any, Real | None] | None = None) -> None:
        self.problem, self.fit = problem, fit
        self.known: dict[Any, Real | None] = dict(known or {})

    @cached_property
    def base(self) -> Projection:
        """The fit, linearised."""
        return Projection.of(self.fit.residual, self.fit.jacobian)

    def at(self, candidate: Candidate, points: Sequence[Point]) -> Iterator[Signature]:
        """Signatures of a candidate at planned points."""
        if candidate.without_prior:
            return self._without_prior(candidate)
        if len(candidate.amplitudes) > 1:
            return self._several_amplitudes(candidate, points)
        return self._one_amplitude(candidate, points)

    def _one_amplitude(self, candidate: Candidate, points: Sequence[Point]) -> Iterator[Signature]:
        name, neutral = candidate.amplitudes[0], candidate.neutral(candidate.amplitudes[0])
        for point, column in zip(points, self.changes(candidate, points)):
            if column is not None:
                size = point[name] - neutral
                low, high = sorted((end - neutral) / size for end in candidate.extended.domain(name.whole))
                shapes = {n: value for n, value in point.items() if n != name}
                yield Signature(
                    candidate.use, column[:, None], (name,), np.array([neutral]), np.array([size]), shapes, (low, high)
                )  # fmt: skip

    def _without_prior(self, candidate: Candidate) -> Iterator[Signature]:
        """What the fit does under the prior, without it; then the same with each other amplitude, to either side."""
        freed = candidate.without_prior
        place = [self.fit.names.index(n) for n in freed]
        columns, ones, fitted = self.fit.jacobian[:, place].copy(), np.ones(len(freed)), self.fit.theta[place]
        columns[self.problem.n_data :] = 0.0
        shapes = {str(n): default_value(candidate, n) for n in candidate.shapes}
        yield Signature(candidate.use, columns, freed, fitted, ones, shapes)
        held = {str(n): candidate.neutral(n) for n in candidate.amplitudes} | shapes
        held |= dict(zip(freed, fitted.tolist()))
        for name in [n for n in candidate.amplitudes if n not in freed]:
            neutral, value = candidate.neutral(name), default_value(candidate, name)
            low, high = candidate.extended.domain(name.whole)
            mirrored = min(max(2 * neutral - value, low), high)
            there, back = self.changes(candidate, [{**held, name: value}, {**held, name: mirrored}])
            for column, end in _sides(there, back, value, mirrored):
                yield Signature(
                    candidate.use, np.column_stack([columns, column]), (*freed, name),
                    np.append(fitted, neutral), np.append(ones, end - neutral), shapes,
                )  # fmt: skip

    def _several_amplitudes(self, candidate: Candidate, places: Sequence[Point]) -> Iterator[Signature]:
        names = candidate.amplitudes
        neutral = np.array([candidate.neutral(n) for n in names])
        value = np.array([default_value(candidate, n) for n in names])
        rest = dict(zip(names, neutral))
        low, high = np.array([candidate.extended.domain(n.whole) for n in names]).T
        mirrored = np.clip(2 * neutral - value, low, high)
        both = [(n, v) for n, *ends in zip(names, value, mirrored) for v in ends]
        columns = self.changes(candidate, [{**s, **rest, n: v} for s in places for n, v in both])
        for k, shapes in enumerate(places):
            part = columns[2 * k * len(names) : 2 * (k + 1) * len(names)]
            sides = [_sides(part[2 * i], part[2 * i + 1], value[i], mirrored[i]) for i in range(len(names))]
            for chosen in product(*sides):
                yield Signature(
                    candidate.use, np.column_stack([c for c, _ in chosen]), names, neutral,
                    np.array([v for _, v in chosen]) - neutral, shapes,
                )  # fmt: skip

    def changes(self, candidate: Candidate, points: Sequence[Point]) -> list[Real | None]:
        """Whitened change of all rows at each point; None where the model has no finite value there."""
        keys = [(candidate.use, tuple(sorted(point.items()))) for point in points]
        new = {key: point for key, point in zip(keys, points) if key not in self.known}
        values = _values_at(candidate, self.fit, list(new.values()))
        # 4_000_000: predicted values held at a time
        chunk = max(1, 4_000_000 // self.problem.n_data)
        found: list[Real | None] = []
        for first in range(0, len(values), chunk):
            part = values[first : first + chunk]
            try:
                columns = list(residuals(candidate.extended, part).T)
            except ComputationError:  # a loop that runs away at one point must not take the others with it
                columns = [_residual_or_nan(candidate.extended, one) for one in part]
            for column in columns:
                change = np.zeros(self.fit.residual.size)  # priors included
                change[: column.size] = column - self.fit.residual[: column.size]
                found.append(change if np.all(np.isfinite(change)) else None)
        self.known.update(zip(new, found))
        return [self.known[key] for key in keys]

    def grid(self, found: Sequence[Candidate]) -> dict[Use, list[Point]]:
        """Points at which each candidate is to be tried, from how its signature turns at the fit.

        Amplitudes are moved by sizes from the plausible range, not by infinitesimal steps, so that an effect that
        saturates, or has a kink at zero, is seen as it is. Directions are compared after the parameters of the base
        have taken out what they can.
        """
        # 4000, 400: evaluations for all candidates together, of a small table (175 rows) and of very many rows
        allowed = max(400, min(4000, 4000 * 175 // self.problem.n_data))
        # 60: places of its shapes that one candidate is tried at
        most = max(1, min(60, allowed // max(len(found), 1)))
        grids = {candidate.use: _ShapeGrid(self, candidate, most).points() for candidate in found}
        return {use: points for use, points in grids.items() if points}


def with_rows_of(columns: Real, old: Problem, new: Problem) -> Real:
    """Columns over one problem's rows as columns over another's; pseudo-measurements that it lacks do not move."""
    out = np.zeros((new.n_data + len(new.pseudo_rows), *columns.shape[1:]))
    out[: new.n_data] = columns[: old.n_data]
    for name, row in new.pseudo_rows.items():
        if name in old.pseudo_rows:
            out[row] = columns[old.pseudo_rows[name]]
    return out


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


@dataclass(frozen=True, eq=False)
class _ShapeGrid:
    """Own elements of one candidate and their values, one mapping a point."""

    of: Signatures
    candidate: Candidate
    most: int

    @cached_property
    def defaults(self) -> Point:
        return {n: default_value(self.candidate, n) for n in self.candidate.shapes}

    def points(self) -> list[Point]:
        candidate = self.candidate
        if candidate.without_prior:
            return [self.defaults]
        if len(candidate.amplitudes) > 1:
            return self.places(default_value(candidate, candidate.amplitudes[0]))
        sizes, name = self.sizes(), candidate.amplitudes[0]
        places = self.places(sizes[0]) if sizes else []
        return [{**place, name: size} for place in places for size in sizes]

    def _left(self, column: Real | None) -> Real | None:
        """The unit vector that is left of a signature; None where nothing is, or no finite value."""
        if column is None:
            return None
        left = self.of.base.project_out(column)
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
        return [self._left(column) for column in self.of.changes(self.candidate, points)]

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
