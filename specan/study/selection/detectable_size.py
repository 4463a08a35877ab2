"""The smallest size at which each effect would have been seen in these data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from specan.models import Use
from specan.study.estimation.fit import Fit
from specan.study.selection.acceptance import DECISIVE, AcceptanceTest, noise_dof
from specan.study.selection.candidates import Candidate, candidates
from specan.study.selection.refits import Refit
from specan.study.selection.signatures import Point, changes, default_value
from specan.study.selection.significance import detectable_noncentrality, needed_reduction

POWER = 0.8  # of repetitions that would find the effect; the usual one (Cohen 1988)
ROUNDS = 4  # of the secant


@dataclass(frozen=True)
class DetectableSize:
    """Smallest visible value of an effect's amplitude; None where none in its domain would be seen."""

    use: str
    parameter: str
    value: float | None
    unit: str


def minimum_detectable_sizes(
    start: Refit, acceptance: AcceptanceTest, dispersion: float
) -> list[DetectableSize]:
    """For every candidate the amplitude that the acceptance test would pass in 80 % of repetitions.

    An effect of this size, its shapes at their defaults, leaves a chi-square lambda on the refitted model
    without it. In 80 % of repetitions the fall then exceeds what acceptance needs: the larger of the F-test at the
    single-test level that the family-wise one leaves, and BIC (Saris, Satorra & van der Veld 2009; the noncentral law
    of F where the noise is estimated). Smaller effects may be there all the same.

    Parameters
    ----------
    start : Refit
        The model that the effect would be added to.
    acceptance : AcceptanceTest
        Of a step from there.
    dispersion : float
        max(s^2, 1) of the best model.
    """
    found, _ = candidates(start.problem)
    level = acceptance.single_level
    return [_of(start, candidate, level, dispersion) for candidate in found]


def _of(start: Refit, candidate: Candidate, level: float, dispersion: float) -> DetectableSize:
    name = candidate.amplitudes[0]
    price = DECISIVE + candidate.count * float(np.log(start.problem.n_effective))
    amplitudes, dof = max(len(candidate.amplitudes), 1), noise_dof(start)
    gain = max(needed_reduction(level, amplitudes, dof, 1 if _one_sided(candidate) else 2), price)
    # Under the alternative the shapes are identified, and their fit gains as well: the law has all of the parameters.
    needed = detectable_noncentrality(gain, max(candidate.count, amplitudes), dof, POWER) * dispersion
    value = (
        _size_without_prior(start, candidate, needed)
        if candidate.without_prior
        else _moved(start, candidate, needed)
    )
    parameter = candidate.parameter(name)
    return DetectableSize(
        str(candidate.use), name, None if value is None else float(parameter.from_si(value)), parameter.unit
    )


def _one_sided(candidate: Candidate) -> bool:
    """Whether its only amplitude is neutral at an end of its domain."""
    if candidate.without_prior or len(candidate.amplitudes) != 1:
        return False
    (name,) = candidate.amplitudes
    return candidate.neutral(name) in candidate.extended.domain(name.whole)


def _size_without_prior(start: Refit, candidate: Candidate, needed: float) -> float | None:
    """Size of an instrument error: its prior holds it near zero until the data outweigh it."""
    name = candidate.without_prior[0]
    row = start.problem.pseudo_rows[name]
    step = np.zeros(start.fit.residual.size)
    step[row] = 1.0
    left = start.linear.free_chi2(step)
    width = start.problem.priors[name.whole][1]
    low, high = candidate.extended.domain(name.whole)
    if left <= 0:
        return None
    size = width * float(np.sqrt(needed / left))
    return size if size <= max(high, -low) else None


def _moved(start: Refit, candidate: Candidate, needed: float) -> float | None:
    """Size at which the signature that the model cannot absorb reaches `needed`, by a secant in its logarithm."""
    name = candidate.amplitudes[0]
    neutral = candidate.neutral(name)
    toward = default_value(candidate, name) - neutral
    low, high = candidate.extended.domain(name.whole)
    most = abs((high if toward > 0 else low) - neutral)
    size, power = abs(toward), 2.0
    previous: tuple[float, float] | None = None
    for _ in range(ROUNDS):
        size = min(size, most)
        left = _left(start, start.fit, candidate, name, neutral + np.sign(toward) * size)
        if left is None or left <= 0:
            return None
        if abs(np.log(left / needed)) < 0.02:
            return size
        if previous and previous[0] != size and previous[1] != left:
            power = float(np.clip(np.log(left / previous[1]) / np.log(size / previous[0]), 0.5, 4.0))
        previous = (size, left)
        if size == most and left < needed:
            return None
        size *= (needed / left) ** (1 / power)
    return size if size <= most else None


def _left(start: Refit, fit: Fit, candidate: Candidate, name: str, value: float) -> float | None:
    shapes: Point = {n: default_value(candidate, n) for n in candidate.shapes}
    column = changes(start.problem, fit, candidate, [{**shapes, name: value}])[0]
    return None if column is None else start.linear.free_chi2(column * start.weights)


def by_effect(found: Sequence[DetectableSize]) -> dict[str, dict[str, Any] | None]:
    """Per bare effect name; of an effect at several places that of the place where it is least visible.

    ``places`` then holds the size at each place, None where it is invisible there; only an effect that is invisible
    everywhere is None as a whole.
    """
    groups: dict[str, list[DetectableSize]] = {}
    for visible in found:
        groups.setdefault(Use.parse(visible.use).name, []).append(visible)
    return {name: _together(groups[name]) for name in sorted(groups)}


def _together(found: Sequence[DetectableSize]) -> dict[str, Any] | None:
    seen = [v for v in found if v.value is not None]
    if not seen:
        return None
    worst = max(seen, key=lambda v: abs(v.value or 0.0))
    at = {v.use: Use.parse(v.use) for v in found if "@" in v.use}
    places = {at[v.use].at or str(at[v.use].copy): v.value for v in found if v.use in at}
    return {"value": worst.value, "unit": worst.unit, **({"places": places} if len(places) > 1 else {})}
