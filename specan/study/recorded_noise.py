"""The noise of recordings: what the largest explanation leaves, so that it cannot take a missing effect in."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from specan.errors import ComputationError
from specan.study.estimation.fit import Fit, describe, fit
from specan.study.estimation.levenberg_marquardt import descend
from specan.study.estimation.linear import orthonormal
from specan.study.estimation.problem import Problem
from specan.study.evidence.marginal import Marginal, Tangent
from specan.study.evidence.promises import Catalogue
from specan.study.observation import Array
from specan.study.observation.time import TimeObservation


def with_noise_of_largest(problem: Problem, base: Fit) -> tuple[Problem, Fit]:
    """Observations whitened by what the model with every effect leaves, and the model fitted under that.

    Parameters
    ----------
    problem : Problem
    base : Fit
        A fit of it.
    """
    if not all(isinstance(o, TimeObservation) for o in problem.observations):
        return problem, base
    largest, reached = problem, base
    for _ in range(2):  # effects that are added before the noise is looked at
        catalogue = Catalogue(largest, reached)
        marginal = Marginal(Tangent.at(largest, reached.theta, reached.residual, reached.jacobian))
        promises = sorted(catalogue.promises(marginal), key=lambda p: -p.ln_gain)
        if not promises or promises[0].ln_gain <= 0:
            break
        with suppress(ComputationError):
            more = largest.with_uses([promises[0].use])
            there = descend(more, more.start(promises[0].starts[0]))
            if there.chi2 < reached.chi2:
                largest, reached = more, describe(more, there.theta)
    basis = _directions(largest, reached)
    residual = reached.residual[: problem.n_data]
    parts = zip(
        problem.observations,
        problem.split(residual - basis @ (basis.T @ residual)),
        problem.split(basis),
        strict=False,
    )
    noisy = [o.with_noise_of(left, own) for o, left, own in parts if isinstance(o, TimeObservation)]
    known = replace(problem, observations=tuple(noisy))
    return known, fit(known, start=base.theta)


def _directions(problem: Problem, reached: Fit) -> Array:
    """What the parameters of a fit and every further effect do, an orthonormal basis."""
    catalogue = Catalogue(problem, reached)
    columns = [reached.jacobian[: problem.n_data]]
    columns += [one.columns[: problem.n_data] for own in catalogue.signatures.values() for one in own]
    return orthonormal(np.hstack(columns), 1e-3)
