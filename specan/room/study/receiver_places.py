"""Where the next receiver of a field should stand: where the explanations that are left differ most.

At a place the rivals expect transfer functions y_a and y_b, vectors over all lines. What a receiver there would tell
between them is, as for single readings (Box and Hill 1967; Buzzi-Ferraris and Forzatti 1984),

    (y_a - y_b)' (V + J_a C_a J_a' + J_b C_b J_b')^-1 (y_a - y_b),

with V what a receiver can know there (noise, its place, its calibration, the declared discrepancy) and J C J' what
the fitted parameters leave open. Its root is the separation in sigma.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np

from specan.room.model.places import depth, free_places, receivers_of, with_microphones
from specan.room.study.field_observation import FieldObservation, field_observations
from specan.study.design.operating_points import EXPLORED, SEPARATES, Proposal, name_of
from specan.study.estimation.linear import chi2_beside, covariance_root
from specan.study.estimation.problem import Problem
from specan.study.localisation.by_band_and_channel import DB
from specan.study.localisation.localise import Block
from specan.study.observation import Array
from specan.study.observation.frf import LINE_CORRELATION
from specan.study.selection.refits import Refit


def few_lines(observation: FieldObservation) -> FieldObservation:
    """About every third line, seen without windows, each worth what the lines around it are worth together."""
    every = max(1, round(3.0 / observation.line_hz))  # lines that a planned receiver is looked at
    lines = np.flatnonzero(observation.kept.any(axis=0))[::every]
    alike = 1 + 2 * sum(LINE_CORRELATION[1:every])  # neighbouring lines say in part the same
    few = observation.of_lines(lines)
    random = few.random * np.sqrt(min(1.0, alike / every))
    return replace(few, noise=random, random=random)


def planned(observation: FieldObservation, names: Sequence[str]) -> FieldObservation:
    """Readings of further receivers, as noisy as those that were made; nothing is measured yet."""
    few = few_lines(observation)
    lines, old, new = len(few.frequency_hz), len(few.channels), len(names)
    used = few.kept.any(axis=1)
    noise = np.broadcast_to(np.median(few.random[used], axis=0), (old + new, lines))
    return replace(
        few,
        name="planned",
        channels=(*few.channels, *names),
        response=np.zeros((old + new, lines), dtype=complex),
        noise=noise,
        random=noise,
        shared=np.zeros((old + new, lines, 0), dtype=complex),
        modal=None,
        kept=np.repeat(np.arange(old + new)[:, None] >= old, lines, axis=1),
    )


def by_receiver(observation: FieldObservation, rows: Array) -> Array:
    """Rows of an observation (rows, columns) as (receivers in use, values of each, columns)."""
    count = int(observation.kept.any(axis=1).sum())
    both = rows.reshape(2, count, -1, rows.shape[-1])
    return both.transpose(1, 0, 2, 3).reshape(count, -1, rows.shape[-1])


def spoken_place(place: Array | Sequence[float]) -> str:
    """A place in words.

    Examples
    --------
    >>> spoken_place([0.3, 0.45, 0.612])
    '(0.30, 0.45, 0.61) m'
    """
    return "(" + ", ".join(f"{x:.2f}" for x in place) + ") m"


def _free(problem: Problem) -> Array:
    """Places for further receivers; none where the room is no box, or a parameter is a receiver's own."""
    receivers, axes = receivers_of(problem.assembly.model), problem.assembly.model.axes
    alike = [axis for axis, names in axes.items() if not set(names).isdisjoint(receivers.names)]
    own = any(problem.assembly.parameters[name].per in alike for name in problem.free)
    return np.empty((0, 3)) if own or receivers.box is None else free_places(receivers.rig)


def propose_places(rivals: Sequence[Refit], weights: Array, count: int) -> list[Proposal]:
    """Free places at which a further receiver would best separate rivals, best first."""
    places = _free(rivals[0].problem)
    if not places.size:
        return []
    views = _views(rivals, places)
    covariances = [r.fit.covariance * r.fit.dispersion for r in rivals]
    left, found = set(range(len(places))), []
    for _ in range(min(count, len(places))):
        gains = {k: _separations(views, covariances, k) for k in left}
        best = max(left, key=lambda k: sum(weights[a] * weights[b] * s for (a, b), s in gains[k].items()))
        pair, square = max(gains[best].items(), key=lambda item: item[1])
        if np.sqrt(square) < SEPARATES:
            break
        found.append(_proposal(rivals, views, places[best], best, pair, float(np.sqrt(square))))
        covariances = [_after(c, view.slopes[best]) for c, view in zip(covariances, views, strict=True)]
        left.discard(best)
    return found


@dataclass(frozen=True, eq=False)
class _View:
    """One rival at all places: response, and whitened prediction and slopes by place."""

    observation: FieldObservation
    response: Any
    white: Array
    slopes: Array


def _views(rivals: Sequence[Refit], places: Array) -> list[_View]:
    """All rivals at all places, whitened alike: by what the best of them makes of the common errors."""
    views, seen = [], None
    for rival in rivals:
        problem = rival.problem
        model, names = with_microphones(problem.assembly.model, places)
        wider = replace(problem, assembly=model.assemble(problem.assembly.uses))
        first = field_observations(problem.observations)[0]
        if seen is None:
            there = planned(first, names)
            seen = there.about(wider.assembly, problem.seen_by(there, problem.values_at(rival.fit.theta)))
        there_only = wider.over([seen])
        own = [wider.names.index(name) for name in there_only.names]  # without what other recordings have
        theta = rival.fit.theta[own]
        predicted = there_only.predictions(theta)[0]
        slopes = np.zeros((seen.n, rival.fit.theta.size))
        slopes[:, own] = seen.whiten(there_only.sensitivities(theta)[0])
        half = seen.n // 2
        response = (predicted[:half] + 1j * predicted[half:]).reshape(len(places), -1)
        views.append(
            _View(
                seen,
                response,
                by_receiver(seen, seen.whiten(predicted[:, None]))[..., 0],
                by_receiver(seen, slopes),
            )
        )
    return views


def _separations(
    views: Sequence[_View], covariances: Sequence[Array], place: int
) -> dict[tuple[int, int], float]:
    """Squared separation of every pair of rivals by a receiver at one place."""
    found = {}
    for a, b in combinations(range(len(views)), 2):
        gap = views[a].white[place] - views[b].white[place]
        root = np.hstack([views[k].slopes[place] @ covariance_root(covariances[k]) for k in (a, b)])
        found[a, b] = max(chi2_beside(gap, root), 0.0)
    return found


def _after(covariance: Array, slopes: Array) -> Array:
    """Covariance of the parameters once a receiver with these whitened slopes has been there."""
    if not covariance.size:
        return covariance
    root = covariance_root(covariance)
    seen = slopes @ root
    return np.asarray(root @ np.linalg.solve(np.eye(seen.shape[1]) + seen.T @ seen, root.T))


def _proposal(
    rivals: Sequence[Refit],
    views: Sequence[_View],
    place: Array,
    number: int,
    pair: tuple[int, int],
    separation: float,
) -> Proposal:
    """A place, with the third octave in which the two that are furthest apart differ most against its uncertainty."""
    observation, model = views[0].observation, rivals[0].problem.assembly.model
    mic = int(np.flatnonzero(observation.kept.any(axis=1))[number])
    lines = observation.labels["third_octave_hz"][: observation.n // 2]
    bands = lines.reshape(len(views[0].response), -1)[number]
    told = []
    for band in np.unique(bands):
        inside = bands == band
        levels = [float(10 * np.log10(np.mean(np.abs(v.response[number, inside]) ** 2))) for v in views]
        response = views[0].response[number, inside]
        weight = np.conj(response) / np.sum(np.abs(response) ** 2)
        random = np.sum(np.abs(weight * observation.noise[mic, inside]) ** 2)
        common = weight @ observation.common_at((mic, inside))
        sigma = float(DB * np.sqrt(random + np.sum(common.real**2)))
        told.append((abs(levels[pair[0]] - levels[pair[1]]) / sigma, float(band), levels, sigma))
    _, band, levels, sigma = max(told, key=lambda t: t[0])
    predictions = dict(zip(map(name_of, rivals), levels, strict=True))
    said = ", ".join(f"{name} expects {level:.1f} dB" for name, level in predictions.items())
    unit = model.observables[str(observation.observable[0])].unit
    text = (
        f"a microphone at {spoken_place(place)}: around {band:g} Hz {said} (re 1 {unit}); sigma "
        f"there is {sigma:.2g} dB, one recording over all frequencies separates them by {separation:.1f} sigma"
    )
    return Proposal(text, _coordinates(place), predictions, "dB", sigma, separation)


def _coordinates(place: Array) -> dict[str, float | str]:
    return dict(zip(("x_m", "y_m", "z_m"), map(float, place), strict=True))


def explore_places(problem: Problem, block: Block) -> list[Proposal]:
    """Free places in the corner of a block - near its group or its receiver - far from all receivers."""
    receivers = receivers_of(problem.assembly.model)
    places, taken = _free(problem), receivers.positions_m
    wall, name = block.where.get("near_wall"), block.where.get("channel")
    if wall is not None and receivers.box is not None and places.size:
        away = depth(receivers.box, wall, places)
        places = places[away <= away.min() + 1e-9]
    elif name in receivers.names:
        away = np.linalg.norm(places - taken[receivers.names.index(name)], axis=1)
        places = places[np.argsort(away, kind="stable")[:8]]
    told = f"where the model fails ({block.short_place}: {block.text}) and nothing was measured nearby"
    found = []
    for _ in range(min(EXPLORED, len(places))):
        gap = np.min(np.linalg.norm(places[:, None] - taken[None], axis=2), axis=1)
        place = places[int(np.argmax(gap))]
        text = f"a microphone at {spoken_place(place)}: {told}"
        found.append(Proposal(text, _coordinates(place), {}, "dB", None, None))
        taken = np.vstack([taken, place])
    return found
