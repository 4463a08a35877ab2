"""What a model says of its measurement, with or without one more effect; nothing is written."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specan.errors import RequestError
from specan.study.assemble import parameter_table
from specan.study.candidates import Candidate, candidates
from specan.study.error import ObservableError, observable_errors
from specan.study.fit import Fit, fit
from specan.study.observation.table import TableObservation
from specan.study.problem import Problem
from specan.study.study import STARTS, Study


@dataclass(frozen=True, eq=False)
class Trial:
    """A fitted model over the measured tables.

    Attributes
    ----------
    name : str
        The effect that was tried; empty for the model as it is.
    measured, predicted, z : arrays (rows,)
        Of all measurements; z is (model - measured) / sigma.
    observable : array of str (rows,)
    """

    name: str
    problem: Problem
    fit: Fit
    errors: tuple[ObservableError, ...]
    measured: NDArray[np.float64]
    predicted: NDArray[np.float64]
    z: NDArray[np.float64]
    observable: NDArray[np.str_]

    @property
    def parameters(self) -> list[tuple[str, ...]]:
        """Those of the tried effect, with their intervals."""
        table = parameter_table(self.problem, self.fit)
        own = [(n, p) for n, p in table.items() if not self.name or n.rpartition(".")[0] == self.name]
        return [
            (n, f"{p['value']:.4g}", f"{p['low']:.4g} to {p['high']:.4g}", p["unit"],
             "at its bound" if p["at_bound"] else "" if p["plausible"] else "implausible")
            for n, p in own
        ]  # fmt: skip


def as_it_is(study: Study) -> Trial:
    """The study's model, fitted."""
    return _trial("", study.problem, study.best)


def candidates_of(study: Study) -> tuple[list[Candidate], dict[str, str]]:
    """Effects that could be tried, and those that these data cannot test, with the reason."""
    return candidates(study.problem)


def try_effect(study: Study, name: str) -> Trial:
    """Refit with one more effect.

    Raises
    ------
    RequestError
        These data cannot test it.
    ComputationError
        No start converged.
    """
    found, not_testable = candidates_of(study)
    for candidate in found:
        if str(candidate.use) == name:
            best = fit(candidate.extended, start=study.best.values, starts=STARTS)
            return _trial(name, candidate.extended, best)
    raise RequestError(f"{name} cannot be tried: {not_testable.get(name, 'it is in the model or unknown')}")


def tables_of(problem: Problem) -> Sequence[TableObservation]:
    """The measured tables.

    Raises
    ------
    RequestError
        The study rests on recordings.
    """
    tables = [o for o in problem.observations if isinstance(o, TableObservation)]
    if len(tables) != len(problem.observations):
        raise RequestError(
            "the page of a study is drawn for tables only, and this one rests on recordings",
            remedy="use specan study compare and specan study report",
        )
    return tables


def _trial(name: str, problem: Problem, best: Fit) -> Trial:
    predictions = problem.predictions(best.theta)
    tables = tables_of(problem)
    measured = np.concatenate([o.measured for o in tables])
    predicted = np.concatenate(predictions)
    sigma = np.concatenate([o.sigma for o in tables])
    return Trial(
        name,
        problem,
        best,
        tuple(observable_errors(problem, problem.observations, predictions)),
        measured,
        predicted,
        (predicted - measured) / sigma,
        np.concatenate([o.observable for o in tables]),
    )
