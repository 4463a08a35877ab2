"""Starts of a fit at sizes of either sign, where a linear promise from afar may have the wrong one."""

from __future__ import annotations

from collections.abc import Collection, Mapping
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
    """SI values where some steps lead from the best size of either sign; empty where one sign only is possible.

    Parameters
    ----------
    problem : Problem
        With the new use.
    values : mapping
        SI values of what was fitted without it.
    new : collection of Use
        What is added: one use with one amplitude, else there is no such start.
    """
    amplitude = _amplitude(problem, new)
    if amplitude is None:
        return []
    name, neutral, usual = amplitude
    low, high = problem.domain(name)
    best = []
    for sign in (-1.0, 1.0):
        sizes = neutral + sign * abs(usual - neutral) * TRIED
        starts = [problem.start({**values, name: float(s)}) for s in sizes if low < s < high]
        if starts:
            best.append(min(starts, key=lambda theta: _chi2(problem, theta)))
    if len(best) < 2:
        return []
    try:
        return [dict(problem.values_at(best_screened(problem, best)))]
    except ComputationError:  # the other starts may do
        return []


def _amplitude(problem: Problem, new: Collection[Use]) -> tuple[ParameterName, float, float] | None:
    """Name, neutral value and usual value of the only amplitude of what is new."""
    if len(new) != 1:
        return None
    (use,) = new
    own = {
        ParameterName.of(use, p): v for p, v in problem.assembly.model.effects[use.name].neutral_si.items()
    }
    own = {name: v for name, v in own.items() if name in problem.free and name not in problem.elements}
    if len(own) != 1:
        return None
    name, neutral = next(iter(own.items()))
    usual = problem.assembly.parameters[name].si.default
    return None if usual == neutral else (name, neutral, usual)


def _chi2(problem: Problem, theta: NDArray[np.float64]) -> float:
    residual = problem.residual(theta)
    chi2 = float(residual @ residual)
    return chi2 if np.isfinite(chi2) else np.inf
