"""The noise of recordings: what the largest explanation leaves, so that it cannot take a missing effect in."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any

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
IMPULSE = 1e-3  # standard deviations of a state, small enough for a straight line


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
        found = [fit for promise in promises[:TRIED] for fit in _fits_with(promise, largest, reached)]
        best = min(found, key=lambda one: one[1].chi2, default=None)
        if best is None or best[1].chi2 >= reached.chi2:
            break
        largest, reached = best[0], describe(best[0], best[1].theta)
    residual = problem.split(reached.residual[: problem.n_data])
    noisy = [
        o.with_noise_of(left, _responses(o, largest.assembly, largest.values_at(reached.theta)))
        for o, left in zip(problem.observations, residual, strict=False)
        if isinstance(o, TimeObservation)
    ]
    known = replace(problem, observations=tuple(noisy))
    return known, fit(known, start=base.theta)


def _fits_with(promise: Promise, problem: Problem, reached: Fit) -> Iterator[tuple[Problem, Minimum]]:
    """Fits with one effect more, from where a straight line leads and from its default values."""
    more = problem.with_uses([promise.use])
    for start in (promise.starts[0], problem.values_at(reached.theta)):
        with suppress(ComputationError):
            yield more, descend(more, more.start(start))


def _responses(o: TimeObservation, assembly: Assembly, values: Mapping[str, Any]) -> dict[str, Array]:
    """Change of all rows after an impulse in the rate of each state, when a recording begins."""
    model, rates = assembly.model, assembly.model.rates
    if rates is None:
        return {}
    plain, found = o.predict(assembly, values), {}
    for name in rates.states:
        start = model.quantities[f"{name}_start"]
        size = IMPULSE * o.spread(assembly, values, name)
        moved = replace(start, function=lambda *given, of=start, by=size, **own: of(*given, **own) + by)
        shifted = replace(model, quantities={**model.quantities, start.name: moved})
        rates.solver(shifted).steps = rates.solver(model).steps
        found[name] = o.predict(shifted.assemble(assembly.uses), values) - plain
    return found
