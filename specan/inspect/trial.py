"""What a model says of its measurement, with or without further effects; nothing is written."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specan.errors import RequestError
from specan.models import Use
from specan.models.effect import ParameterName
from specan.report.residual_map import ResidualMap, residual_map
from specan.study.build_problem import parameter_table
from specan.study.estimation.continuation import linearised
from specan.study.estimation.fit import Fit, fit
from specan.study.estimation.prediction_error import ObservableError, observable_errors
from specan.study.estimation.problem import Problem
from specan.study.selection.candidates import Candidate, candidates
from specan.study.selection.starting_values import kept_values, starting_values
from specan.study.study import STARTS, Study


@dataclass(frozen=True, eq=False)
class Trial:
    """A fitted model over the measurements.

    Attributes
    ----------
    uses : tuple of str
        The effects that were tried; empty for the model as it is.
    predictions : tuple of array
        One an observation of the problem.
    where : ResidualMap or None
        Where the model fails; None where no operating variable varies.
    """

    uses: tuple[str, ...]
    problem: Problem
    fit: Fit
    errors: tuple[ObservableError, ...]
    predictions: tuple[NDArray[np.float64], ...]
    where: ResidualMap | None

    @property
    def name(self) -> str:
        """In words."""
        return " with ".join(self.uses)

    @property
    def parameters(self) -> list[tuple[str, ...]]:
        """Those of the tried effects, or all, with their intervals."""
        table = parameter_table(self.problem, self.fit)
        own = [(n, p) for n, p in table.items() if not self.uses or ParameterName(n).owner in self.uses]
        return [
            (n, f"{p['value']:.4g}", f"{p['low']:.4g} to {p['high']:.4g}", "" if p["unit"] == "1" else p["unit"],
             "at its bound" if p["at_bound"] else "" if p["plausible"] else "implausible")
            for n, p in own
        ]  # fmt: skip


def as_it_is(study: Study) -> Trial:
    """The study's model, fitted; of many rows from where its last step left it, unless somebody changed it since."""
    last = study.history.last
    if (
        not study.problem.strategy.secondary_refits
        and last is not None
        and not study.edited
        and "best" not in vars(study)
    ):
        return _trial(
            (), study.problem, fit(study.problem, start=kept_values(study.problem, last.parameters))
        )
    return _trial((), study.problem, study.shown)


def candidates_of(study: Study) -> tuple[list[Candidate], dict[str, str]]:
    """Effects that could be tried, and those that these data cannot test, with the reason."""
    return candidates(study.problem)


def try_effects(study: Study, now: Fit, uses: Sequence[str]) -> Trial:
    """Refit with further effects.

    Parameters
    ----------
    study : Study
    now : Fit
        Of the model as it is.
    uses : sequence of str

    Raises
    ------
    RequestError
        These data cannot test one of them.
    ComputationError
        No start converged.
    """
    found, not_testable = candidates_of(study)
    known = {str(c.use): c for c in found}
    for name in uses:
        if name not in known:
            why = not_testable.get(Use.parse(name).name, "it is in the model or unknown")
            raise RequestError(f"{name} cannot be tried: {why}")
    problem = study.problem.with_uses([known[name].use for name in uses])
    if problem.strategy.linearised_covariance:  # as when the effect is accepted
        problem = linearised(
            problem, starting_values(problem, [known[name].use for name in uses], now.values)
        )
        return _trial(tuple(uses), problem, fit(problem))
    return _trial(tuple(uses), problem, fit(problem, start=now.values, starts=STARTS))


def _trial(uses: tuple[str, ...], problem: Problem, best: Fit) -> Trial:
    predictions = problem.plain(best.theta)
    errors = observable_errors(problem, problem.observations, predictions)
    return Trial(uses, problem, best, tuple(errors), tuple(predictions), residual_map(problem, best))
