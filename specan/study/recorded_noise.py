"""The noise of recordings: what the largest explanation leaves, so that it cannot take a missing effect in."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from specan.errors import ComputationError
from specan.models import Assembly
from specan.study.estimation.fit import Fit, describe, fit
from specan.study.estimation.levenberg_marquardt import Minimum, descend
from specan.study.estimation.problem import Problem
from specan.study.evidence.marginal import Marginal, Tangent
from specan.study.evidence.promises import Catalogue, Promise
from specan.study.observation import Array
from specan.study.observation.time import TimeObservation

TRIED = 5  # effects that promise most
LEAST_DOF = 10  # of the variance of the noise
IMPULSE = 1e-3  # standard deviations of a state, small enough for a straight line


def with_noise_of_largest(problem: Problem, base: Fit) -> tuple[Problem, Fit, str]:
    """Observations whitened by what the model with every effect leaves, the model fitted under that, and a doubt.

    Parameters
    ----------
    problem : Problem
    base : Fit
        A fit of it.

    Returns
    -------
    tuple of Problem, Fit and str
        The last says why the noise cannot be told; empty where it can.
    """
    if not all(isinstance(o, TimeObservation) for o in problem.observations):
        return problem, base, ""
    largest, reached = problem, base
    for _ in range(2):  # effects that are added before the noise is looked at
        catalogue = Catalogue(largest, reached)
        marginal = Marginal(Tangent.at(largest, reached.theta, reached.residual, reached.jacobian))
        promises = sorted(catalogue.promises(marginal), key=lambda p: -p.ln_gain)
        if not promises or promises[0].ln_gain <= 0:
            break
        found = [fit for promise in promises[:TRIED] for fit in _fits_with(promise, largest, reached)]
        best = min(found, key=lambda one: one[1].chi2, default=None)
        if best is None or best[1].chi2 >= reached.chi2:
            break
        largest, reached = best[0], describe(best[0], best[1].theta)
    residual = problem.split(reached.residual[: problem.n_data])
    noisy: list[TimeObservation] = []
    for o, left in zip(problem.observations, residual, strict=False):
        assert isinstance(o, TimeObservation)
        # the variance of the noise is known with so many degrees of freedom, by the kurtosis of what is left
        if 2 * np.sum(left**2) ** 2 < LEAST_DOF * np.sum(left**4):
            return problem, base, _lies_in_few(o, left)
        noisy.append(o.with_noise_of(left, _responses(o, largest.assembly, largest.values_at(reached.theta))))
    known = replace(problem, observations=tuple(noisy))
    return known, fit(known, start=base.theta), ""


def _lies_in_few(o: TimeObservation, left: Array) -> str:
    order = np.argsort(-np.abs(left))
    share = np.cumsum(left[order] ** 2) / np.sum(left**2)
    few, worst = int(np.searchsorted(share, 0.5)) + 1, int(order[0])
    return (
        f"half of what is left of {o.observable[worst]} lies in {few} of {left.size} samples, around "
        f"{o.place_of(worst)}: no noise is like that. A sensor that fails, or a machine that runs away there? Look at "
        "the recording, and leave that time out (--hold-out time=FROM..TO)"
    )


def _fits_with(promise: Promise, problem: Problem, reached: Fit) -> Iterator[tuple[Problem, Minimum]]:
    """Fits with one effect more, from where a straight line leads and from its default values."""
    more = problem.with_uses([promise.use])
    for start in (promise.starts[0], problem.values_at(reached.theta)):
        with suppress(ComputationError):
            yield more, descend(more, more.start(start))


def _responses(o: TimeObservation, assembly: Assembly, values: Mapping[str, Any]) -> dict[str, Array]:
    """Change of all rows after an impulse in the rate of each state, when a recording begins."""
    model, plain, found = assembly.model, o.predict(assembly, values), {}
    for name in model.rates.states:
        start = model.quantities[f"{name}_start"]
        size = IMPULSE * o.spread(assembly, values, name)
        moved = replace(start, function=lambda *given, of=start, by=size, **own: of(*given, **own) + by)
        shifted = replace(model, quantities={**model.quantities, start.name: moved})
        shifted.solver.steps = model.solver.steps
        found[name] = o.predict(shifted.assemble(assembly.uses), values) - plain
    return found
