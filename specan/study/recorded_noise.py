"""The noise of recordings: what the largest explanation leaves, so that it cannot take a missing effect in."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from specan.errors import ComputationError
from specan.models import Assembly
from specan.models.rates import TIME
from specan.study.estimation.fit import Fit, describe, fit
from specan.study.estimation.growing import far, grown
from specan.study.estimation.levenberg_marquardt import best_screened, descend
from specan.study.estimation.problem import Problem
from specan.study.evidence.faults import unspoilt
from specan.study.evidence.marginal import Marginal, Tangent
from specan.study.evidence.promises import Catalogue, Promise
from specan.study.observation import Array
from specan.study.observation.time import TimeObservation


class NoiseError(ComputationError):
    """What is left is no noise."""


def with_noise_of_largest(problem: Problem, base: Fit) -> tuple[Problem, Fit, Catalogue | None]:
    """Observations whitened by what the model with every effect leaves, the model fitted under that, its catalogue.

    Parameters
    ----------
    problem : Problem
    base : Fit
        A fit of it.

    Returns
    -------
    tuple of Problem, Fit and Catalogue
        Of other data as they are, and without catalogue.

    Raises
    ------
    NoiseError
        It cannot be told.
    """
    if not all(isinstance(o, TimeObservation) for o in problem.observations):
        return problem, base, None
    largest, reached, first = problem, base, Catalogue(problem, base)
    for catalogue in (first, None):  # effects that are added before the noise is looked at
        catalogue = catalogue or Catalogue(largest, reached, before=first, anew=False)
        marginal = Marginal(Tangent.at(largest, reached.theta, reached.residual, reached.jacobian))
        promises = sorted(catalogue.promises(marginal), key=lambda p: -p.ln_gain)
        if not promises or promises[0].ln_gain <= 0:
            break
        promises = _likeliest_first(promises, largest, reached, catalogue)
        # 5: effects that promise most
        found = [one for promise in promises[:5] for one in _led_with(promise, largest)]
        if not found:
            break
        _, more, theta = min(found, key=lambda one: one[0])
        with suppress(ComputationError):
            theta = descend(more, theta).theta
        best = describe(more, theta)
        if best.chi2 >= reached.chi2:
            break
        largest, reached = more, best
    residual = problem.split(unspoilt(largest, reached.theta, reached.residual[: problem.n_data]))
    noisy: list[TimeObservation] = []
    for o, left in zip(problem.observations, residual, strict=False):
        assert isinstance(o, TimeObservation)
        # the variance of the noise is known with 10 degrees of freedom or more, by the kurtosis of what is left
        if 2 * np.sum(left**2) ** 2 < 10 * np.sum(left**4):
            raise NoiseError(_lies_in_few(o, left))
        values = largest.values_at(reached.theta)
        if why := _runs_apart(o, largest, values):
            raise NoiseError(why)
        noisy.append(o.with_noise_of(left, _responses(o, largest.assembly, values)))
    known = replace(problem, observations=tuple(noisy))
    return known, fit(known, start=base.theta), first.whitened_by(known)


def _lies_in_few(o: TimeObservation, left: Array) -> str:
    order = np.argsort(-np.abs(left))
    share = np.cumsum(left[order] ** 2) / np.sum(left**2)
    few, worst = int(np.searchsorted(share, 0.5)) + 1, int(order[0])
    return (
        f"half of the squared error of {o.observable[worst]} is in {few} of {left.size} samples, around "
        f"{o.place_of(worst)}: that is not noise. Did a sensor fail there, or did the machine run away? Look at "
        "the recording, and leave that time out (--hold-out time=FROM..TO)"
    )


def _likeliest_first(
    promises: list[Promise], problem: Problem, reached: Fit, catalogue: Catalogue
) -> list[Promise]:
    """Promises in their order, or by how near fits that grow with the recording come, where the model is far from it.

    Raises
    ------
    NoiseError
        With the best of them nobody can predict the recording to its end.
    """
    if not far(problem, problem.values_at(reached.theta)):
        return promises
    models = [problem.with_uses([p.use]) for p in promises]
    order = sorted(
        zip(promises, models, grown(models), strict=True), key=lambda one: (-one[2].share, one[2].chi2)
    )
    catalogue.led = {promise.use: led.values for promise, _, led in order if led.share == 1}
    best, likeliest, led = order[0]
    for o in problem.observations:
        if isinstance(o, TimeObservation) and (why := _runs_apart(o, likeliest, led.values)):
            raise NoiseError(f"with {best.use}, {why}")
    return [replace(p, starts=(led.values, *p.starts)) for p, _, led in order]


def _led_with(promise: Promise, problem: Problem) -> Iterator[tuple[float, Problem, Array]]:
    """Chi-square, problem and place that some steps with one effect more lead to."""
    more = replace(problem, one_sided=True).with_uses([promise.use])
    with suppress(ComputationError):
        theta = best_screened(more, promise.on_the_way(more))
        yield float(np.sum(more.residual(theta) ** 2)), more, theta


def _runs_apart(o: TimeObservation, problem: Problem, values: Mapping[str, Any]) -> str:
    """Why nobody can foretell a recording to its end; empty where one can."""
    apart = 100.0  # times by which a change of a start grows, beyond what constant rates make of it
    small, smaller = (_responses(o, problem.assembly, values, size) for size in (1e-3, 1e-4))
    error = o.measured - o.predict(problem.assembly, values)
    lost = far(problem, values)
    for chains in o.chains.values():
        rows = max(chains, key=lambda chain: chain.size)
        time = o.conditions[TIME][rows]
        early, after = (np.mean(part**2) for part in np.split(error[rows], [rows.size // 10]))
        if not lost and after <= 2**2 * early:  # what is predicted to the end is no worse there
            continue
        for state, response in small.items():
            size, straight = np.abs(response[rows]), np.abs(smaller[state][rows]) * 10
            soon = float(np.max(size[: rows.size // 10], initial=0.0))
            late = float(np.max(size))
            # what grows until the motion itself is no larger is no straight line of the start any more
            full = late > apart * 1e-3 * np.std(o.measured[rows]) and np.max(straight) > 2 * late
            if soon > 0 and (full or late > apart * soon):
                # over which it grows by e squared
                seconds = 2 * float(time[np.argmax(size)] - time[0]) / np.log(late / soon)
                return (
                    f"a small change of {state} at the start grows more than {apart:g} times over the recording: the "
                    "motion is chaotic, or runs away, and cannot be predicted to the end. Compare it in pieces "
                    f"with starts of their own: Model.from_rates(..., window_s={float(f'{seconds:.1g}'):g})"
                )
    return ""


def _responses(
    o: TimeObservation, assembly: Assembly, values: Mapping[str, Any], share: float = 1e-3
) -> dict[str, Array]:
    """Change of all rows after an impulse in the rate of each state, when a recording begins.

    By a share of the standard deviation of the state: a thousandth is small enough for a straight line.
    """
    model, plain, found = assembly.model, o.predict(assembly, values), {}
    for name in model.rates.states:
        start = model.quantities[f"{name}_start"]
        size = share * o.spread(assembly, values, name)
        moved = replace(start, function=lambda *given, of=start, by=size, **own: of(*given, **own) + by)
        shifted = replace(model, quantities={**model.quantities, start.name: moved})
        shifted.solver.steps = model.solver.steps
        found[name] = o.predict(shifted.assemble(assembly.uses), values) - plain
    return found
