"""Where an effect that acts at one place may sit, before anything else of it is known.

Whatever acts at a place changes every receiver's line by the response to a source there, times one factor a line that
all receivers share. With that factor free at every line, what a place can explain of a residual follows in closed form.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from specan.models import Use
from specan.room.model.places import PATTERNS_READ, PLACED, patterns, receivers_of
from specan.room.study.field_observation import FieldObservation, field_observations
from specan.study.observation import Array
from specan.study.selection.candidates import Candidate
from specan.study.selection.refits import Refit
from specan.study.selection.starting_values import BEST, Found

EACH_WAY = 11  # places along an edge, corners among them: a sixth of a wavelength where an edge holds two
FROM_EDGE = 0.04  # of an edge
GRID = np.linspace(FROM_EDGE, 1 - FROM_EDGE, EACH_WAY)
LEAST_SHARE = 0.7  # share of what the best place explains, below which another is no place to begin

# A search asks for some of the candidates at a time.
_SHARES: WeakKeyDictionary[Refit, dict[str, Array]] = WeakKeyDictionary()


def likely_places(refit: Refit, found: Sequence[Candidate]) -> dict[Use, list[Found]]:
    """Places of the candidates that act at one, best first; empty for a model that does not look for places.

    Places that explain less than `LEAST_SHARE` of what the best of all does are left out, but the best of each
    element.
    """
    if receivers_of(refit.problem.assembly.model).box is None:
        return {}
    mine = [c for c in found if c.use.name in PLACED and c.use.at]
    shares = _SHARES.setdefault(refit, {})
    shares |= _shares(refit, sorted({str(c.use.at) for c in mine} - {*shares}))
    if not shares:
        return {}
    best = max(float(share.max()) for share in shares.values())
    out = {}
    for candidate in mine:
        names = [f"{candidate.use}.{name}" for name in ("across", "along")]
        share = shares[str(candidate.use.at)]
        peaks = [p for k, p in enumerate(_peaks(share)) if k == 0 or share[p] >= LEAST_SHARE * best]
        out[candidate.use] = [
            Found(dict(zip(names, GRID[[i, j]].tolist(), strict=True)), float(share[i, j]))
            for i, j in peaks[:BEST]
        ]
    return out


def _peaks(share: Array) -> list[tuple[int, int]]:
    """Places than which no neighbour explains more, best first."""
    wide = np.pad(share, 1, constant_values=-np.inf)
    around = [np.roll(wide, (a, b), (0, 1))[1:-1, 1:-1] for a in (-1, 0, 1) for b in (-1, 0, 1)]
    top = np.argwhere(share >= np.max(around, axis=0))
    return sorted(((int(i), int(j)) for i, j in top), key=lambda p: -share[p])


def _shares(refit: Refit, elements: Sequence[str]) -> dict[str, Array]:
    """Share of the residual's chi-square that a source at each place of the grid could explain, by element."""
    if not elements:
        return {}
    problem = refit.problem
    across, along = (axis.ravel() for axis in np.meshgrid(GRID, GRID, indexing="ij"))
    places = np.column_stack([across, along])
    total = 0.0
    by_element = {element: np.zeros(len(places)) for element in elements}
    for observation in field_observations(problem.observations):
        own = problem.seen_by(observation, problem.values_at(refit.fit.theta))
        quantities = problem.assembly.evaluate(observation.conditions_at_nodes, own, wanted=PATTERNS_READ)
        gap = observation.response - observation.responses(problem.assembly, [own])[0]
        total += float(np.sum(np.abs(gap * observation.kept / observation.noise) ** 2))
        for element in elements:
            by_element[element] += explained(gap, quantities, element, places, observation)
    return {e: x.reshape(EACH_WAY, EACH_WAY) / total for e, x in by_element.items()} if total else {}


def explained(
    gap: NDArray[np.complex128],
    quantities: Any,
    element: str,
    places: Array,
    observation: FieldObservation,
) -> Array:
    """Chi-square that a source at each place explains, its strength free at every line."""
    weight = observation.kept / observation.noise
    pattern = np.stack([observation.folding(p) for p in patterns(quantities, element, places)])
    pattern = pattern * weight
    along = np.abs(np.sum(pattern.conj() * (gap * weight), axis=1)) ** 2
    size = np.sum(np.abs(pattern) ** 2, axis=1)
    return np.asarray(np.sum(along / np.maximum(size, 1e-300), axis=1))
