"""The noise of recordings: what the largest explanation leaves, so that it cannot take a missing effect in."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any

from specan.errors import ComputationError
from specan.models import Assembly
from specan.study.estimation.fit import Fit, describe, fit
from specan.study.estimation.levenberg_marquardt import descend
from specan.study.estimation.problem import Problem
from specan.study.evidence.marginal import Marginal, Tangent
from specan.study.evidence.promises import Catalogue
from specan.study.observation import Array
from specan.study.observation.time import TimeObservation

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
        with suppress(ComputationError):
            more = largest.with_uses([promises[0].use])
            there = descend(more, more.start(promises[0].starts[0]))
            if there.chi2 < reached.chi2:
                largest, reached = more, describe(more, there.theta)
    residual = problem.split(reached.residual[: problem.n_data])
    noisy = [
        o.with_noise_of(left, _responses(o, largest.assembly, largest.values_at(reached.theta)))
        for o, left in zip(problem.observations, residual, strict=False)
        if isinstance(o, TimeObservation)
    ]
    known = replace(problem, observations=tuple(noisy))
    return known, fit(known, start=base.theta)


def _responses(o: TimeObservation, assembly: Assembly, values: Mapping[str, Any]) -> dict[str, Array]:
    """Change of all rows after an impulse in the rate of each state, when a recording begins."""
    model, plain = assembly.model, o.predict(assembly, values)
    found = {}
    for name in model.rates.states if model.rates else ():
        start = model.quantities[f"{name}_start"]
        size = IMPULSE * o.spread(assembly, values, name)
        moved = replace(start, function=lambda *given, of=start, by=size, **own: of(*given, **own) + by)
        shifted = replace(model, quantities={**model.quantities, start.name: moved})
        found[name] = o.predict(shifted.assemble(assembly.uses), values) - plain
    return found
