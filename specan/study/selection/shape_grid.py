"""At which sizes and shapes each candidate is tried: as many as its signature turns in different directions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from specan.models import Use
from specan.study.estimation.fit import Fit
from specan.study.estimation.problem import Problem
from specan.study.estimation.projection import Projection
from specan.study.selection.candidates import Candidate, grid
from specan.study.selection.signatures import Known, Point, changes, default_value

Array = NDArray[np.float64]

SAME_DIRECTION = 0.985  # cosine above which two sizes of an effect leave one direction
REFINE_BELOW = 0.8  # cosine below which a shape is tried between two others
ROUNDS = 4  # of refinement of one shape
MOST_PLACES = 60  # places of its shapes that one candidate is tried at
# Evaluations for all candidates together: for a small table, and where there are very many rows.
MOST_EVALUATIONS, LEAST_EVALUATIONS = 4000, 400
ROWS = 175  # of a small table
FEW = 10  # places below which sizes are not distinguished
COLLINEAR = 1e-6  # share of a signature, in chi-square, that is no more than rounding


def shape_grid(
    problem: Problem, fit: Fit, found: Sequence[Candidate], known: Known
) -> dict[Use, list[Point]]:
    """Points at which each candidate is to be tried, from how its signature turns at a fit of the problem.

    Amplitudes are moved by sizes from the plausible range, not by infinitesimal steps, so that an
    effect that saturates, or has a kink at zero, is seen as it is. Directions are compared after the
    parameters of the base have taken out what they can. What is worked out for it is kept in `known`.
    """
    base = Projection.of(fit.residual, fit.jacobian)
    allowed = max(LEAST_EVALUATIONS, min(MOST_EVALUATIONS, MOST_EVALUATIONS * ROWS // problem.n_data))
    most = max(1, min(MOST_PLACES, allowed // max(len(found), 1)))
    grids = {c.use: _ShapeGrid(problem, fit, base, c, most, known) for c in found}
    return {use: points for use, grid_of in grids.items() if (points := grid_of.points())}


@dataclass(frozen=True, eq=False)
class _ShapeGrid:
    problem: Problem
    fit: Fit
    base: Projection
    candidate: Candidate
    most: int
    known: Known

    def points(self) -> list[Point]:
        """Own elements and their values, one mapping a point."""
        candidate = self.candidate
        defaults: Point = {n: default_value(candidate, n) for n in candidate.shapes}
        if candidate.without_prior:
            return [defaults]
        amplitude = candidate.amplitudes[0]
        if len(candidate.amplitudes) > 1:
            return self._places(amplitude, default_value(candidate, amplitude))
        sizes = self._sizes(amplitude)
        if not sizes:
            return []
        return [{**place, amplitude: v} for place in self._places(amplitude, sizes[0]) for v in sizes]

    def _directions(self, points: Sequence[Point]) -> list[Array | None]:
        """Unit vectors that are left of the signatures; None where nothing is, or no finite value."""
        out: list[Array | None] = []
        for column in changes(self.problem, self.fit, self.candidate, points, self.known):
            projected = None if column is None else self.base.project_out(column)
            if (
                projected is None
                or column is None
                or not projected @ projected > COLLINEAR * (column @ column)
            ):
                out.append(None)
            else:
                out.append(projected / np.linalg.norm(projected))
        return out

    def _sizes(self, amplitude: str) -> list[float]:
        """Values of the amplitude whose signatures differ in direction; the default first."""
        candidate = self.candidate
        neutral = candidate.neutral(amplitude)
        low, high = candidate.plausible(amplitude)
        reach = max(abs(low), abs(high))
        shapes: Point = {n: default_value(candidate, n) for n in candidate.shapes}
        kept: list[tuple[float, Array]] = []
        ends = [default_value(candidate, amplitude), high, low][: None if self.most >= FEW else 1]
        for values in (ends, [neutral + 0.1 * (v - neutral) for v in (high, low)]):
            if values is not ends and len(kept) <= 1:
                break  # the same direction at both ends: it is the same in between
            apart = [v for v in dict.fromkeys(values) if abs(v - neutral) > 1e-9 * reach]
            for value, unit in zip(apart, self._directions([{**shapes, amplitude: v} for v in apart])):
                if unit is not None and all(abs(unit @ other) < SAME_DIRECTION for _, other in kept):
                    kept.append((value, unit))
        return [value for value, _ in kept]

    def _places(self, amplitude: str, size: float) -> list[Point]:
        """Places of the shapes: each over its plausible range, closer where the signature turns quickly.

        Several shapes are moved one at a time from their defaults, and together on a coarse grid where
        there is space for it.
        """
        candidate = self.candidate
        defaults: Point = {n: default_value(candidate, n) for n in candidate.shapes}
        if not defaults:
            return [{}]
        each = max((self.most - 1) // len(defaults), 1)
        rest = {n: candidate.neutral(n) for n in candidate.amplitudes} | {amplitude: size}
        places = [defaults]
        for name in candidate.shapes:
            values = list(grid(*candidate.plausible(name), min(5, each))) if each > 1 else []
            for _ in range(ROUNDS):
                units = self._directions([{**defaults, **rest, name: v} for v in values])
                wide = [k for k in range(len(values) - 1) if _turns(units[k], units[k + 1])]
                if not wide or len(values) + len(wide) > each:
                    break
                values = sorted({*values, *(_middle(values[k], values[k + 1]) for k in wide)})
            places += [{**defaults, name: v} for v in values]
        if len(defaults) > 1 and len(places) + 3 ** len(defaults) <= self.most:
            coarse = [grid(*candidate.plausible(name), 3) for name in candidate.shapes]
            places += [dict(zip(candidate.shapes, place)) for place in product(*coarse)]
        return list({tuple(p.items()): p for p in places}.values())


def _middle(low: float, high: float) -> float:
    return float(np.sqrt(low * high)) if low > 0 else (low + high) / 2


def _turns(first: Array | None, second: Array | None) -> bool:
    return first is not None and second is not None and bool(abs(first @ second) < REFINE_BELOW)
