"""Starts for models that are integrated, where a fit ends far from the recording.

Over a whole recording the sum of squares of a model that drifts out of step has minima everywhere. Where its states
follow the measurement, ``dx/dt = f(x) + p (y - x)`` with the pace ``p`` of the measured motion (Luenberger's observer),
it forgets its errors within a fraction of a period, and a descent from anywhere ends near the truth, if the effects
are the right ones.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from specan.errors import ComputationError
from specan.models import Condition, Model, Parameter, effect
from specan.models.rates import TIME
from specan.study.estimation.levenberg_marquardt import NotSettledError, descend
from specan.study.estimation.problem import Problem
from specan.study.observation.time import TimeObservation

FAR = 0.5  # of the RMS of a measured state, from which a straight line from a fit leads nowhere


def following(problem: Problem, values: Mapping[str, Any]) -> tuple[dict[str, Any], float] | None:
    """Values of parameters with which states that follow the measurement come nearest to it, and chi-square there.

    None where the model is near the measurement at these values, or no state is measured.
    """
    observations = tuple(o for o in problem.observations if isinstance(o, TimeObservation))
    model = problem.assembly.model
    if not model.rates.scales or not any(_far(o, problem, values) for o in observations):
        return None
    led, uses = _led(model.solver, observations)
    assembly = led.assemble([*problem.assembly.uses, *uses])
    follows = replace(problem, assembly=assembly, observations=_seen(model.solver, observations))
    try:
        found = descend(follows, follows.start(values))
    except NotSettledError as fault:
        found = fault.reached
    except ComputationError:
        return None
    return follows.values_at(found.theta), found.chi2


def _far(o: TimeObservation, problem: Problem, values: Mapping[str, Any]) -> bool:
    predicted = o.predict(problem.assembly, problem.values_at(problem.start(values)))
    states = np.isin(o.observable, list(problem.assembly.model.rates.scales))
    error, size = (o.measured - predicted)[states], o.measured[states]
    return not np.mean(error**2) < FAR**2 * np.var(size)


@lru_cache(maxsize=2)
def _led(solver: Any, observations: tuple[TimeObservation, ...]) -> tuple[Model, list[str]]:
    """The model of a solver with one effect more for each measured state, and the names of these."""
    model: Model = solver.model
    rates: Any = model.rates
    conditions, effects = dict(model.conditions), []
    for number, name in enumerate(rates.scales):
        recorded, unit = f"{name}_recorded", rates.states[name].unit
        measured = [
            (o.conditions[TIME][rows], o.measured[rows]) for o in observations for rows in o.chains[name]
        ]
        change = np.concatenate([np.gradient(y, t) for t, y in measured if y.size > 1])
        pace = float(np.sqrt(np.mean(change**2)) / np.std(np.concatenate([y for _, y in measured])))
        conditions[recorded] = Condition(recorded, unit, f"Recorded {name}.", recorded, unit)

        @effect(f"following-{number}", adds_to=f"d{name}", neutral={"pace": 0.0})
        def follow(recorded, state, *, pace=Parameter(pace, "1/s", min=0.0, max=10 * pace, fixed=True)):
            """The state follows its recording."""
            return pace * (recorded - state)

        effects.append(replace(follow, reads=(recorded, name)))
    return replace(model, conditions=conditions).with_effect(*effects), [one.name for one in effects]


@lru_cache(maxsize=2)
def _seen(solver: Any, observations: tuple[TimeObservation, ...]) -> tuple[TimeObservation, ...]:
    """The observations with what is measured of states among their conditions, straight across what was left out."""
    found = []
    for o in observations:
        conditions, recording = o._series
        more = {}
        for name, scale in solver.model.rates.scales.items():
            more[f"{name}_recorded"] = values = np.zeros(recording.size)
            for number in np.unique(recording):
                rows = (o.observable == name) & (o._recording == number)
                lines = recording == number
                values[lines] = np.interp(
                    conditions[TIME][lines], o.conditions[TIME][rows], scale * o.measured[rows]
                )
        found.append(replace(o, series=({**conditions, **more}, recording), position=o._position))
    return tuple(found)
