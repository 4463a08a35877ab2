"""At which sizes and shapes each candidate is tried: as many as its trace turns in different directions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from specan.models import Use
from specan.study.candidates import Candidate, grid
from specan.study.fit import Fit
from specan.study.problem import Problem
from specan.study.projection import Projection
from specan.study.traces import Point, changes, default_value

Array = NDArray[np.float64]

SAME = 0.985  # cosine above which two sizes of an effect leave one direction
ALIKE = 0.8  # cosine below which a shape is tried between two others
ROUNDS = 4
MOST_SHAPES = 60  # places of its shapes that one candidate is tried at
SWALLOWED = 1e-6  # share of a trace, in chi-square, that is no more than rounding


def plan(problem: Problem, fit: Fit, found: Sequence[Candidate]) -> dict[Use, list[Point]]:
    """Points at which each candidate is to be tried, from how its trace turns at a fit of the problem.

    Amplitudes are moved by sizes from the plausible range, not by infinitesimal steps, so that an
    effect that saturates, or has a kink at zero, is seen as it is. Directions are compared after the
    parameters of the base have taken out what they can.
    """
    base = Projection.of(fit.residual, fit.jacobian)
    return {c.use: points for c in found if (points := _Planner(problem, fit, base, c).points())}


@dataclass(frozen=True, eq=False)
class _Planner:
    problem: Problem
    fit: Fit
    base: Projection
    candidate: Candidate

    def points(self) -> list[Point]:
        """Own elements and their values, one mapping a point."""
        candidate = self.candidate
        defaults: Point = {n: default_value(candidate, n) for n in candidate.shapes}
        if candidate.released:
            return [defaults]
        amplitude = candidate.amplitudes[0]
        if len(candidate.amplitudes) > 1:
            return self._places(amplitude, default_value(candidate, amplitude))
        sizes = self._sizes(amplitude)
        if not sizes:
            return []
        return [{**place, amplitude: v} for place in self._places(amplitude, sizes[0]) for v in sizes]

    def _directions(self, points: Sequence[Point]) -> list[Array | None]:
        """Unit vectors that are left of the traces; None where nothing is, or no finite value."""
        out: list[Array | None] = []
        for column in changes(self.problem, self.fit, self.candidate, points):
            clean = None if column is None else self.base.clean(column)
            if clean is None or column is None or not clean @ clean > SWALLOWED * (column @ column):
                out.append(None)
            else:
                out.append(clean / np.linalg.norm(clean))
        return out

    def _sizes(self, amplitude: str) -> list[float]:
        """Values of the amplitude whose traces differ in direction; the default first."""
        candidate = self.candidate
        neutral = candidate.neutral(amplitude)
        low, high = candidate.plausible(amplitude)
        wanted = [default_value(candidate, amplitude), high, low]
        wanted += [neutral + 0.1 * (v - neutral) for v in (high, low)]
        values = [v for v in dict.fromkeys(wanted) if abs(v - neutral) > 1e-9 * max(abs(high), abs(low))]
        shapes = {n: default_value(candidate, n) for n in candidate.shapes}
        kept: list[tuple[float, Array]] = []
        for value, unit in zip(values, self._directions([{**shapes, amplitude: v} for v in values])):
            if unit is not None and all(abs(unit @ other) < SAME for _, other in kept):
                kept.append((value, unit))
        return [value for value, _ in kept]

    def _places(self, amplitude: str, size: float) -> list[Point]:
        """Places of the shapes: each over its plausible range, closer where the trace turns quickly."""
        candidate = self.candidate
        defaults = {n: default_value(candidate, n) for n in candidate.shapes}
        if not defaults:
            return [{}]
        rest = {n: candidate.neutral(n) for n in candidate.amplitudes} | {amplitude: size}
        axes = []
        for name in candidate.shapes:
            values = list(grid(*candidate.plausible(name), 5))
            for _ in range(ROUNDS):
                units = self._directions([{**defaults, **rest, name: v} for v in values])
                wide = [k for k in range(len(values) - 1) if _turn(units[k], units[k + 1])]
                if not wide or len(values) > MOST_SHAPES // 2:
                    break
                values = sorted({*values, *(_middle(values[k], values[k + 1]) for k in wide)})
            axes.append(values)
        places: list[Point] = [dict(zip(candidate.shapes, place)) for place in product(*axes)]
        if len(places) > MOST_SHAPES:
            places = [places[int(k)] for k in np.linspace(0, len(places) - 1, MOST_SHAPES)]
        return [defaults, *places]


def _middle(low: float, high: float) -> float:
    return float(np.sqrt(low * high)) if low > 0 else (low + high) / 2


def _turn(first: Array | None, second: Array | None) -> bool:
    return first is not None and second is not None and bool(abs(first @ second) < ALIKE)
