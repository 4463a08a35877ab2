"""Starts of a fit at sizes of either sign, where a linear promise from afar may have the wrong one."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.errors import ComputationError
from specan.models import Use
from specan.models.effect import ParameterName
from specan.study.estimation.levenberg_marquardt import best_screened
from specan.study.estimation.problem import Problem

TRIED = 2.0 ** np.arange(-4, 2)  # times the usual size


def of_either_sign(problem: Problem, values: Mapping[str, Any], new: Collection[Use]) -> list[dict[str, Any]]:
    """SI values where some steps lead from the best size to either side; empty where one side only is possible.

    Parameters
    ----------
    problem : Problem
        With the new use.
    values : mapping
        SI values of what was fitted without it.
    new : collection of Use
        What is added: one use, else there is no such start. Amplitudes are taken in twos, as parts in phase and in
        quadrature.
    """
    amplitudes = _amplitudes(problem, new)
    best = []
    for side in range(2) if amplitudes else ():
        found = dict(values)
        for k in range(0, len(amplitudes), 2):  # further ones beside the best of those before
            part = amplitudes[k : k + 2]
            tried = [{**found, **sizes} for sizes in _sizes(problem, part, None if k else side)]
            found = min(tried, key=lambda one: _chi2(problem, problem.start(one)), default=found)
        best.append(problem.start(found))
    if len(best) < 2 or np.array_equal(best[0], best[1]):
        return []
    try:
        return [dict(problem.values_at(best_screened(problem, best)))]
    except ComputationError:  # the other starts may do
        return []


def _sizes(
    problem: Problem, part: Sequence[tuple[ParameterName, float, float]], side: int | None
) -> Iterator[dict[ParameterName, float]]:
    """Sizes of one or two amplitudes, in ways that lie on one side or on both, inside their domains."""
    names = [name for name, _, _ in part]
    neutral, usual = (np.array([row[k] for row in part]) for k in (1, 2))
    low, high = np.array([problem.domain(name) for name in names]).T
    ways = _directions(len(part))
    for way in ways[side] if side is not None else np.concatenate(ways):
        for times in TRIED:
            size = neutral + np.abs(usual - neutral).max() * times * way
            if np.all((low < size) & (size < high)):
                yield dict(zip(names, map(float, size)))


def _directions(count: int) -> list[NDArray[np.float64]]:
    """Directions in which one or two amplitudes may go, by the side on which they lie."""
    if count == 1:
        return [np.array([[-1.0]]), np.array([[1.0]])]
    angle = (np.arange(8) + 0.5) * np.pi / 4
    ways = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return [ways[:4], ways[4:]]


def _amplitudes(problem: Problem, new: Collection[Use]) -> list[tuple[ParameterName, float, float]]:
    """Name, neutral value and usual value of the amplitudes of what is new, where that is one effect."""
    if len(new) != 1:
        return []
    (use,) = new
    neutral = {
        ParameterName.of(use, p): v for p, v in problem.assembly.model.effects[use.name].neutral_si.items()
    }
    usual = {name: problem.assembly.parameters[name].si.default for name in neutral}
    return [
        (name, value, usual[name])
        for name, value in neutral.items()
        if name in problem.free and name not in problem.elements and usual[name] != value
    ]


def _chi2(problem: Problem, theta: NDArray[np.float64]) -> float:
    residual = problem.residual(theta)
    chi2 = float(residual @ residual)
    return chi2 if np.isfinite(chi2) else np.inf
