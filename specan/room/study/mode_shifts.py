"""Shifts of single modes: found beside the other parameters, before anything is linearised about them.

A tenth of a per cent moves a mode by a sixth of its width. A covariance that is linear about the mode where it should
be does not hold that far; about the shifted mode it does. So the shifts that are most probable together with the
model's parameters are found by Gauss-Newton steps, and what remains uncertain of them is linearised there
(Laplace's approximation). Decision: docs/decisions/covariance.md.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from specan.models import Assembly
from specan.room.model.places import named_shifts, receivers_of, shifts_of
from specan.room.study.field_observation import FieldObservation, field_observations
from specan.study.estimation.problem import Problem
from specan.study.observation import Array, Observation

PARTS = (1.0, 0.5, 0.2)  # of a step, until one leads lower
FARTHEST = 4.0  # standard uncertainties that a mode may be shifted


def with_mode_shifts(problem: Problem, assembly: Assembly, values: Mapping[str, Any]) -> Mapping[str, Any]:
    """The values with the most probable shifts, and with the parameters beside them; themselves where none may shift.

    Where the model fails, its residual counts as noise: shifts must not explain it.

    Parameters
    ----------
    problem : Problem
        The base; its observations tell the shifts.
    assembly : Assembly
        The model with what it has besides.
    values : mapping
        SI values where the search begins, shifts included.
    """
    shifts, own = receivers_of(assembly.model).shifts, set(problem.assembly.uses)
    if not shifts or not problem.strategy.linearised_covariance:
        return values
    whole = problem.with_uses(use for use in assembly.uses if use not in own)
    theta, z = whole.start(values), shifts_of(values, shifts)
    low, high = whole.bounds

    def at(over: Problem, z: Array) -> Problem:
        return replace(over, values={**whole.values, **named_shifts(z)})

    here, held = whole, None
    # 10: of Gauss-Newton steps; from shifts that are known two
    for number in range(10):
        # 3: rounds after which errors of places are taken about the field as it is then
        if number % 3 == 0:
            now = at(whole, z)
            seen = [
                o.about_unshifted(assembly, now.seen_by(o, now.values_at(theta)), seen=False)
                for o in field_observations(whole.observations)
            ]
            here = whole.over(seen)
        now = at(here, z)
        residual, n = now.residual(theta), now.n_data
        # 4.0: standard uncertainties that an instrument is off which is no longer held: an effect names it
        held = np.abs(residual[n:]) < 4.0 if held is None else held
        excess = max(float(residual[:n] @ residual[:n]) / n, 1.0)
        weights = np.concatenate([np.full(n, excess**-0.5), held])
        jacobian = now.jacobian(theta) * whole.scale
        columns = [
            o.whiten(o.stack(o.shift_columns(assembly, now.seen_by(o, now.values_at(theta)))))
            for o in field_observations(now.observations)
        ]
        of_shifts = np.vstack([*columns, np.zeros((len(residual) - n, z.size))])
        slopes = weights[:, None] * np.hstack([jacobian, of_shifts])
        known = np.concatenate([np.zeros(theta.size), np.ones(z.size)])
        inner = slopes.T @ slopes + np.diag(known)
        right = slopes.T @ (weights * residual) + known * np.concatenate([np.zeros(theta.size), z])
        step = -np.linalg.lstsq(inner, right, rcond=1e-12)[0]
        before = cost = float(np.sum((weights * residual) ** 2) + z @ z)
        for part in PARTS:
            there = np.clip(theta + part * step[: theta.size] * whole.scale, low, high)
            moved = np.clip(z + part * step[theta.size :], -FARTHEST, FARTHEST)
            cost = float(np.sum((weights * at(here, moved).residual(there)) ** 2) + moved @ moved)
            if cost < before:
                theta, z = there, moved
                break
        # 0.003: part of chi-square that a round must gain for another to follow
        if not cost < (1 - 0.003) * before:
            break
    return {**values, **whole.values_at(theta), **named_shifts(z)}


def knowing_shifts(problem: Problem, unseen: Sequence[Observation]) -> list[Observation]:
    """Observations that are held out, with what the fitted ones tell of the shifts that they have in common."""
    told = [o for o in field_observations(problem.observations) if o.shifts]
    if not told:
        return list(unseen)
    inner = np.eye(told[0].shifts)
    for o in told:
        assert o.modal is not None
        white = o.whiten_each(o.stack(o.modal[..., -o.shifts :]))
        inner += white.T @ white
    root = np.linalg.inv(np.linalg.cholesky(inner)).T
    return [o.knowing_shifts(root) if isinstance(o, FieldObservation) else o for o in unseen]


def mode_shifts(assembly: Assembly, values: Mapping[str, Any]) -> dict[str, Array]:
    """The shifts among values, which the model holds as constants; none where none may shift."""
    shifts = receivers_of(assembly.model).shifts
    return named_shifts(shifts_of(values, shifts)) if shifts else {}
