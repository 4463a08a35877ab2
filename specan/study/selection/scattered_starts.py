"""Starts of a fit that lie scattered over what is known beforehand, where chi-square has many minima."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
from scipy.special import ndtri

from specan.arrays import Real
from specan.models import Use
from specan.models.effect import ParameterName
from specan.study.estimation.continuation import chi2_at
from specan.study.estimation.fit import quasi_random
from specan.study.estimation.problem import Problem

LOOKED_AT, LED = 48, 12  # places at which chi-square is worked out, and starts that may be led on from them
SIZES = (1 / 16, 2.0)  # times the usual one: ends between which the logarithm of a size is uniform


def scattered_starts(problem: Problem, values: Mapping[str, Any], new: Collection[Use]) -> list[Real]:
    """Theta at the places that fit best, the best first.

    What has a prior is normal about it with half its width: the steps of a fit find the rest. New amplitudes have any
    sign, and a size about the usual one; their shapes are uniform over their plausible ranges.

    Parameters
    ----------
    problem : Problem
        With what is new.
    values : mapping
        SI values of effects that were fitted without it.
    new : collection of Use
    """
    middle = problem.start(values)
    draws = quasi_random(LOOKED_AT, middle.size)
    low, high = problem.bounds()
    effects = {str(use): problem.assembly.model.effects[use.name] for use in new}
    places = np.tile(middle, (LOOKED_AT, 1))
    for k, name in enumerate(problem.names):
        own = effects.get(name.owner)
        if name.whole in problem.priors:
            mean, sd = problem.priors[name.whole]
            places[:, k] = mean + 0.5 * sd * ndtri(draws[:, k])
        elif own is not None and name.own in own.neutral_si:
            places[:, k] = own.neutral_si[name.own] + _sizes(problem, name, draws[:, k])
        elif own is not None:
            ends = problem.plausible(name.whole)
            places[:, k] = ends[0] + draws[:, k] * (ends[1] - ends[0])
    inside = np.clip(places, low, high)
    chi2 = [chi2_at(problem, place) for place in inside]
    level = [c - 2 * problem.ln_volume(p) if np.isfinite(c) else c for c, p in zip(chi2, inside, strict=True)]
    return [inside[k] for k in np.argsort(level)[:LED] if np.isfinite(level[k])]


def _sizes(problem: Problem, name: ParameterName, draws: Real) -> Real:
    """Of either sign, which the first half of the draws decides."""
    usual = abs(problem.assembly.parameters[name.whole].si.default) or problem.plausible(name.whole)[1]
    part = 2 * draws % 1
    size = usual * SIZES[0] * (SIZES[1] / SIZES[0]) ** part
    return np.asarray(np.where(draws < 0.5, -size, size))
