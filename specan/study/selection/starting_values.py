"""Where the fit of a changed model sets out: what was fitted before, and sizes and shapes for what is new.

A resonator declared at 150 Hz does not find its own resonance at 230 Hz by going downhill. What is new is
therefore tried over the range of its shapes first, as a candidate of a diagnosis is.

Of an effect that acts at one place, the kind of measurement may tell where that is likely before anything else of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from specan.errors import ComputationError
from specan.models import Use
from specan.models.effect import ParameterName
from specan.models.kept import each_anew
from specan.study.estimation.continuation import JACOBIANS, about, continuation_fit, down_weighted
from specan.study.estimation.fit import fit
from specan.study.estimation.levenberg_marquardt import descend_steps
from specan.study.estimation.problem import Problem
from specan.study.observation import brought
from specan.study.selection.candidates import Candidate, candidates, grid, without
from specan.study.selection.refits import Refit, start_from
from specan.study.selection.score_test import Scored, best_of_each, different, score
from specan.study.selection.signatures import Known, Point, default_value, shape_grid, signatures

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


def scan_promising(refit: Refit) -> dict[Use, list[Scored]]:
    """Starting values: the most promising of all, of every effect, and the two best at every place.

    Few shapes may be what holds an effect back; and a low mode is much the same at the opposite end.
    """
    candidate, _ = candidates(refit.problem)
    known: Known = {}
    scored = best_of_each(_scored(refit, candidate, planned_points(refit, candidate, known), known))
    order = sorted(scored, key=lambda use: refit.promised(scored[use][0]))
    names: dict[str, Use] = {}
    for use in order:
        names.setdefault(use.name, use)
    # 6: candidates that are looked at over all of their shapes, beside the best place of every effect
    found = scan_shapes(refit, [*order[:6], *names.values()])
    if not found:
        return found
    best = dict.fromkeys(use.name for use in sorted(found, key=lambda use: refit.promised(found[use][0])))
    return found | scan_shapes(
        refit, [use for use in order if use.name in [*best][:BEST] and use not in found]
    )


def scan_shapes(refit: Refit, uses: Sequence[Use]) -> dict[Use, list[Scored]]:
    """Signatures of few candidates over all of their shapes: the best of each, and others that lie apart."""
    shared: Known = {}
    found = {c.use: c for c in candidates(refit.problem)[0] if c.use in uses}
    points = shape_grid(refit.problem, refit.fit, list(found.values()), shared)
    scored = best_of_each(_scored(refit, list(found.values()), points, shared))
    places = _likely_places(refit, list(found.values()))

    def peaks(use: Use) -> list[Scored]:
        known = dict(shared)  # changes at all that is tried of every effect take much memory
        optima = _coordinate_optima(refit, found[use], scored[use][0], known)
        for place in places.get(use, ()):
            optima += _led(refit, found[use], _at_place(found[use], place, _sizes(found[use])), known)
        optima += _all_over(refit, found[use], known)
        optima.sort(key=lambda s: -s.chi2_reduction)
        starts = [*optima[:STARTS], *different(scored[use], STARTS)[1:]]
        return list({(*s.signature.shapes.values(), *s.signature.size): s for s in starts}.values())

    return dict(zip(scored, each_anew(peaks, list(scored)), strict=True))


def planned_points(refit: Refit, found: Sequence[Candidate], known: Known) -> dict[Use, list[Point]]:
    """Points at which candidates are to be tried, for those that act at one place the likeliest of each element too."""
    places = _likely_places(refit, found)
    points = shape_grid(refit.problem, refit.fit, found, known)
    for candidate in found:
        if candidate.use in places:
            more = _at_place(candidate, places[candidate.use][0], _sizes(candidate)[:1])
            points[candidate.use] = [*points.get(candidate.use, []), *more]
    return points


def _led(refit: Refit, candidate: Candidate, points: Sequence[Point], known: Known) -> list[Scored]:
    """Where the search from the best of some points leads; empty where none is worth a test."""
    scored = _scored(refit, [candidate], {candidate.use: points}, known)
    return [_coordinate_search(refit, candidate, scored[0], known)] if scored else []


def _all_over(refit: Refit, candidate: Candidate, known: Known) -> list[Scored]:
    """Where the search leads from the best of all places and some sizes, for what may be anywhere within three edges.

    What moves every resonance by more than its width leads nowhere from a place that is wrong along two edges.
    """
    places = [name for name in candidate.shapes if ParameterName(name).own in PLACES]
    if len(places) < 3 or candidate.without_prior:
        return []
    usual: Point = {name: default_value(candidate, name) for name in candidate.shapes}
    # 5: places along an edge that are tried with sizes: two a wavelength where it holds 1.5
    along = [float(part) for part in np.linspace(0.08, 0.92, 5)]  # parts of an edge
    points: list[Point] = [
        {**usual, **dict(zip(places, place, strict=True)), candidate.amplitudes[0]: size}
        for size in _sizes(candidate)
        for place in product(along, repeat=len(places))
    ]
    scored = _scored(refit, [candidate], {candidate.use: points}, known)
    led = [_coordinate_search(refit, candidate, best, known) for best in different(scored, BEST)]
    return list({tuple(best.signature.shapes.values()): best for best in led}.values())


def _at_place(candidate: Candidate, place: Found, sizes: Sequence[float]) -> list[Point]:
    """The other shapes over the range of a resonance, with some sizes, at one place."""
    usual = {n: default_value(candidate, n) for n in candidate.shapes} | place.shapes
    narrow = [n for n in candidate.shapes if candidate.parameter(n).unit == "Hz"]
    shaped = [{**usual, narrow[0]: v} for v in _range_of(candidate, narrow[0])] if narrow else [usual]
    amplitude = candidate.amplitudes[0]
    return [{**shape, amplitude: size} for size in sizes for shape in shaped]


def _sizes(candidate: Candidate) -> list[float]:
    """The usual size of a candidate's amplitude and a large one: where it acts strongly a mode splits otherwise."""
    amplitude = candidate.amplitudes[0]
    usual, (_, high) = default_value(candidate, amplitude), candidate.plausible(amplitude)
    return list(dict.fromkeys([usual, float(np.sqrt(abs(usual * high)))]))


def _coordinate_optima(refit: Refit, candidate: Candidate, best: Scored, known: Known) -> list[Scored]:
    """Results of coordinate searches from the best signature, and from the best resonance at usual or symmetric places.

    What has little damping at a low frequency does something everywhere, and hides a resonance that is elsewhere.
    """
    peaks = [_coordinate_search(refit, candidate, best, known)]
    narrow = [n for n in best.signature.shapes if candidate.parameter(n).unit == "Hz"]
    if narrow and best.amplitudes == 1:
        usual = {n: default_value(candidate, n) for n in best.signature.shapes} | _promised_size(best)
        places = [usual, *_symmetric_places(usual)]
        points = [
            {**place, narrow[0]: value} for place in places for value in _range_of(candidate, narrow[0])
        ]
        peaks += _led(refit, candidate, points, known)
    return peaks


def _coordinate_search(refit: Refit, candidate: Candidate, best: Scored, known: Known) -> Scored:
    """The best signature that is reached by moving one shape at a time: over its range, then about the best.

    A resonator's place shows near its resonance only, and the resonance where the place is not a node. Each round is
    at the size that the one before promises: a large resonator changes a mode otherwise than a small one.
    """
    if candidate.without_prior or not best.signature.shapes:
        return best
    tried = {name: _range_of(candidate, name) for name in best.signature.shapes}
    # 3: rounds, each closer about the best
    for _ in range(3):
        size = _promised_size(best)
        for name, values in tried.items():
            here = best.signature.shapes
            points = [{**size, **here, name: float(v)} for v in values]
            found = _scored(refit, [candidate], {candidate.use: points}, known)
            best = max([best, *found], key=lambda s: s.chi2_reduction)
            tried[name] = _between(values, best.signature.shapes[name])
        symmetric = [{**size, **image} for image in _symmetric_places(best.signature.shapes)]
        found = _scored(refit, [candidate], {candidate.use: symmetric}, known)
        best = max([best, *found], key=lambda s: s.chi2_reduction)
    return best


def _symmetric_places(shapes: Mapping[str, float]) -> list[dict[str, float]]:
    """The same place seen from the other ends of the edges: modes are as much shifted from there."""
    places = [name for name in shapes if ParameterName(name).own in PLACES]
    turned = [sides for sides in product((False, True), repeat=len(places)) if any(sides)]
    return [
        {**shapes, **{name: 1 - shapes[name] for name, side in zip(places, sides) if side}}
        for sides in turned
    ]


def _range_of(candidate: Candidate, name: str) -> list[float]:
    """Values over a shape's plausible range; a resonance is narrow and must not fall between two."""
    # 45: 5 % apart over a decade
    count = 45 if candidate.parameter(name).unit == "Hz" else 16
    return [float(value) for value in grid(*candidate.plausible(name), count)]


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


def _scored(
    refit: Refit, found: Sequence[Candidate], points: Mapping[Use, Sequence[Point]], known: Known
) -> list[Scored]:
    return score(refit.linear, signatures(refit.problem, refit.fit, found, points, known))


def kept_values(problem: Problem, table: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """SI values by the name of the parameter out of a step's table by the name of the element.

    What the problem no longer has is left out.
    """
    known = problem.assembly.parameters
    values = {ParameterName(name): row["value"] for name, row in table.items()}
    return problem.of_elements(
        {name: known[name.whole].to_si(v) for name, v in values.items() if name.whole in problem.free}
    )


def _likely_places(refit: Refit, found: Sequence[Candidate]) -> Mapping[Use, Sequence[Found]]:
    """Places of the candidates that act at one, best first; empty where the kind of measurement tells none."""
    look = brought(refit.problem.observations, "likely_places")
    return look(refit, found) if look else {}
