"""Where the fit of a changed model sets out: what was fitted before, and sizes and shapes for what is new.

A resonator declared at 150 Hz does not find its own resonance at 230 Hz by going downhill. What is new is
therefore tried over the range of its shapes first, as a candidate of a diagnosis is.

Of an effect that acts at one place, the kind of measurement may tell where that is likely before anything else of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np

from specan.errors import ComputationError
from specan.models import Use
from specan.models.effect import ParameterName
from specan.models.kept import each_anew
from specan.study.estimation.continuation import JACOBIANS, about, continuation_fit, down_weighted
from specan.study.estimation.fit import describe, fit
from specan.study.estimation.levenberg_marquardt import descend_steps
from specan.study.estimation.problem import Problem
from specan.study.observation import brought
from specan.study.selection.candidates import Candidate, candidates, grid, without
from specan.study.selection.refits import Refit, start_from
from specan.study.selection.signatures import (
    Point,
    Scored,
    Signatures,
    best_of_each,
    default_value,
    different,
    score,
)


def about_itself(refit: Refit) -> Refit:
    """A set with covariances about its own field: what its parameters and intervals are told from.

    About the field of the base, or of a nearby set, what is declared of receivers acts otherwise than in the field that
    was found, and takes a part of an effect, the displacement of a receiver above all.
    """
    if not refit.problem.strategy.linearised_covariance:
        return refit
    problem, theta = refit.problem, refit.fit.theta
    with suppress(ComputationError):  # what was found stays as it is
        # 2: covariances about the field of a set: the second is about where the first leads
        for _ in range(2):
            problem = about(problem, problem.assembly, problem.values_at(theta))
            theta = descend_steps(problem, theta, JACOBIANS)
        return replace(refit, problem=problem, fit=describe(problem, theta))
    return refit


STARTS = 3  # signatures of a candidate that lie apart
# effects that are looked for at every place; places of an element; places from which a search goes on
BEST = 2
PLACES = ("across", "along", "x", "y", "z")  # shapes that are places, in parts of an edge


@dataclass(frozen=True)
class Found:
    """A place and the part of the residual's chi-square that a source there could explain.

    Attributes
    ----------
    shapes : mapping
        Values of the two parameters that are the place.
    """

    shapes: dict[str, float]
    share: float


def starting_values(
    problem: Problem, new: Sequence[Use], known: Mapping[str, Any]
) -> list[Mapping[str, Any]]:
    """SI values to start from: the problem's own, and known ones, with several starts for new uses."""
    starts: list[Mapping[str, Any]] = [{}, known] if known else [{}]
    integrated = all(o.kind == "time" for o in problem.observations)
    if not new or not (integrated or problem.strategy.continuation):
        return starts
    lean = problem
    for use in new:
        lean = without(lean, use)
    try:
        base = (
            Refit(frozenset(), lean, fit(lean, start=known))
            if integrated
            else _seen_from(lean, continuation_fit(lean, [known]))
        )
    except ComputationError:  # without what is new nothing fits: the declared values must do
        return starts
    found = list(scan_shapes(base, new).values())
    most = max(map(len, found), default=0)
    return starts + [start_from(base, [w[min(k, len(w) - 1)] for w in found], problem) for k in range(most)]


def _seen_from(lean: Problem, values: Mapping[str, Any]) -> Refit:
    """The model without what is new on a down-weighted view; on a subsample where that view is met already."""
    view = down_weighted(lean, values=values)
    seen = Refit(frozenset(), view, fit(view, start=values))
    if seen.fit.reduced_chi2 > 1:
        return seen
    near = about(lean, lean.assembly, values)
    theta = descend_steps(near, near.start(values), JACOBIANS)
    subsample = about(lean, lean.assembly, near.values_at(theta)).subsampled(theta)
    return Refit(frozenset(), subsample, fit(subsample, start=theta))


def scan_shapes(refit: Refit, uses: Sequence[Use]) -> dict[Use, list[Scored]]:
    """Signatures of few candidates over all of their shapes: the best of each, and others that lie apart."""
    found = [c for c in candidates(refit.problem)[0] if c.use in uses]
    shared, places = Signatures(refit.problem, refit.fit), likely_places(refit, found)
    scored = scored_best(refit, shared, found, shared.grid(found))
    by_use = {c.use: c for c in found}

    def peaks(use: Use) -> list[Scored]:
        # changes at all that is tried of every effect take much memory
        one = Search(refit, by_use[use], Signatures(refit.problem, refit.fit, shared.known))
        optima = one.optima(scored[use][0])
        for place in places.get(use, ()):
            optima += one.led(one.at_place(place, one.sizes))
        optima += one.all_over()
        optima.sort(key=lambda s: -s.chi2_reduction)
        starts = [*optima[:STARTS], *different(scored[use], STARTS)[1:]]
        return list({s.signature.place: s for s in starts}.values())

    return dict(zip(scored, each_anew(peaks, list(scored)), strict=True))


def scored_best(
    refit: Refit, at: Signatures, found: Sequence[Candidate], points: Mapping[Use, Sequence[Point]]
) -> dict[Use, list[Scored]]:
    """Signatures of every candidate at its points, the best first."""
    seen = (s for c in found if c.use in points for s in at.at(c, points[c.use]))
    return best_of_each(score(refit.linear, seen))


@dataclass(frozen=True, eq=False)
class Search:
    """A search for the shapes of one candidate."""

    refit: Refit
    candidate: Candidate
    at: Signatures

    def scored(self, points: Sequence[Point]) -> list[Scored]:
        """Signatures of it at some points, the best first."""
        return score(self.refit.linear, self.at.at(self.candidate, points))

    @cached_property
    def usual(self) -> dict[str, float]:
        """Shapes at their defaults."""
        return {str(name): default_value(self.candidate, name) for name in self.candidate.shapes}

    @cached_property
    def sizes(self) -> list[float]:
        """The usual size of the amplitude and a large one: where it acts strongly a mode splits otherwise."""
        amplitude = self.candidate.amplitudes[0]
        usual, (_, high) = default_value(self.candidate, amplitude), self.candidate.plausible(amplitude)
        return list(dict.fromkeys([usual, float(np.sqrt(abs(usual * high)))]))

    @cached_property
    def resonance(self) -> list[Point]:
        """Values over the range of a resonance; empty where there is none."""
        narrow = [n for n in self.usual if self.candidate.parameter(n).unit == "Hz"]
        return [{narrow[0]: value} for value in self.range_of(narrow[0])] if narrow else []

    def range_of(self, name: str) -> list[float]:
        """Values over a shape's plausible range; a resonance is narrow and must not fall between two."""
        # 45: 5 % apart over a decade
        count = 45 if self.candidate.parameter(name).unit == "Hz" else 16
        return [float(value) for value in grid(*self.candidate.plausible(name), count)]

    def at_place(self, place: Found, sizes: Sequence[float]) -> list[Point]:
        """The other shapes over the range of a resonance, with some sizes, at one place."""
        amplitude = self.candidate.amplitudes[0]
        usual = self.usual | place.shapes
        return [{**usual, **one, amplitude: size} for size in sizes for one in self.resonance or [{}]]

    def led(self, points: Sequence[Point]) -> list[Scored]:
        """Where the search from the best of some points leads; empty where none is worth a test."""
        return [self.along_shapes(best) for best in self.scored(points)[:1]]

    def all_over(self) -> list[Scored]:
        """Where it leads from the best of all places and some sizes, for what may be anywhere within three edges.

        What moves every resonance by more than its width leads nowhere from a place that is wrong along two edges.
        """
        places = [name for name in self.usual if ParameterName(name).own in PLACES]
        if len(places) < 3 or self.candidate.without_prior:
            return []
        # 5: places along an edge that are tried with sizes: two a wavelength where it holds 1.5
        along = [float(part) for part in np.linspace(0.08, 0.92, 5)]  # parts of an edge
        points = [
            {**self.usual, **dict(zip(places, place, strict=True)), self.candidate.amplitudes[0]: size}
            for size in self.sizes
            for place in product(along, repeat=len(places))
        ]
        led = [self.along_shapes(best) for best in different(self.scored(points), BEST)]
        return list({tuple(best.signature.shapes.values()): best for best in led}.values())

    def optima(self, best: Scored) -> list[Scored]:
        """Where it leads from the best signature, and from the best resonance at usual or symmetric places.

        What has little damping at a low frequency does something everywhere, and hides a resonance that is elsewhere.
        """
        found = [self.along_shapes(best)]
        usual = self.usual | _promised_size(best)
        places = [usual, *_symmetric_places(usual)] if best.amplitudes == 1 else []
        points = [{**place, **one} for place in places for one in self.resonance]
        return found + (self.led(points) if points else [])

    def along_shapes(self, best: Scored) -> Scored:
        """The best signature that is reached by moving one shape at a time: over its range, then about the best.

        A resonator's place shows near its resonance only, and the resonance where the place is not a node. Each round
        is at the size that the one before promises: a large resonator changes a mode otherwise than a small one.
        """
        if self.candidate.without_prior or not best.signature.shapes:
            return best
        tried = {name: self.range_of(name) for name in best.signature.shapes}
        # 3: rounds, each closer about the best
        for _ in range(3):
            size = _promised_size(best)
            for name, values in tried.items():
                points = [{**size, **best.signature.shapes, name: float(v)} for v in values]
                best = max([best, *self.scored(points)], key=lambda s: s.chi2_reduction)
                tried[name] = _between(values, best.signature.shapes[name])
            symmetric = [{**size, **image} for image in _symmetric_places(best.signature.shapes)]
            best = max([best, *self.scored(symmetric)], key=lambda s: s.chi2_reduction)
        return best


def _symmetric_places(shapes: Mapping[str, float]) -> list[dict[str, float]]:
    """The same place seen from the other ends of the edges: modes are as much shifted from there."""
    places = [name for name in shapes if ParameterName(name).own in PLACES]
    turned = [sides for sides in product((False, True), repeat=len(places)) if any(sides)]
    return [
        {**shapes, **{name: 1 - shapes[name] for name, side in zip(places, sides) if side}}
        for sides in turned
    ]


def _promised_size(best: Scored) -> dict[str, float]:
    """The amplitude that a signature promises, no larger than that of the signature; empty for several."""
    if best.amplitudes > 1:
        return {}
    # 0.01: part of a usual size, below which an effect acts in proportion to it
    share = np.clip(np.abs(best.expected_change), 0.01, 1.0) * np.where(best.expected_change < 0, -1.0, 1.0)
    return dict(zip(best.signature.names, (best.signature.neutral + share * best.signature.size).tolist()))


def _between(values: Sequence[float], best: float) -> list[float]:
    """Values about the best one, up to its neighbours."""
    below = max((v for v in values if v < best), default=best)
    above = min((v for v in values if v > best), default=best)
    # three on either side
    return [*np.linspace(below, best, 4)[1:], *np.linspace(best, above, 4)[1:-1]]


def kept_values(problem: Problem, table: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """SI values by the name of the parameter out of a step's table by the name of the element.

    What the problem no longer has is left out.
    """
    known = problem.assembly.parameters
    values = {ParameterName(name): row["value"] for name, row in table.items()}
    return problem.of_elements(
        {name: known[name.whole].to_si(v) for name, v in values.items() if name.whole in problem.free}
    )


def likely_places(refit: Refit, found: Sequence[Candidate]) -> Mapping[Use, Sequence[Found]]:
    """Places of the candidates that act at one, best first; empty where the kind of measurement tells none."""
    look = brought(refit.problem.observations, "likely_places")
    return look(refit, found) if look else {}
