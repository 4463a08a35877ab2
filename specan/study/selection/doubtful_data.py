"""Rows without load that contradict the others: run in another way, and nothing says so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from specan.study.data.operating_table import IDLE
from specan.study.estimation.fit import fit
from specan.study.observation.table import TableObservation
from specan.study.selection.refits import Refit

# Family-wise probability below which rows stand out, as of a lack of fit; and that above which the rest is whole.
STANDS_OUT, WHOLE = 1e-3, 0.05
MOST_LINES = 6  # of a table that a sentence names
LEAST_ROWS = 3  # of each kind, below which kinds are not compared


def rows_of_two_kinds(refit: Refit) -> str:
    """A sentence on idle rows that contradict the loaded ones: the model fails on all, and meets the loaded ones.

    The model is refitted without the rows near zero of a condition that `idles`. Empty where the model meets the data,
    where one kind is missing, and where the table tells the kinds apart already (a column that varies).
    """
    problem, (observation, *others) = refit.problem, refit.problem.observations
    if others or not isinstance(observation, TableObservation) or refit.lack_of_fit >= STANDS_OUT:
        return ""
    conditions = problem.assembly.model.conditions
    for name, condition in conditions.items():
        told = np.ptp(observation.conditions.get(condition.idles, np.ones(1))) > 0
        if not condition.idles or name not in observation.conditions or told:
            continue
        size = np.abs(observation.conditions[name])
        loaded = size > IDLE * size.max()
        if loaded.sum() < LEAST_ROWS or (~loaded).sum() < LEAST_ROWS:
            continue
        part = problem.over([observation.take(loaded)])
        rest = Refit(frozenset(), part, fit(part, start=refit.fit.theta))
        if rest.dof > 0 and rest.lack_of_fit > WHOLE:
            kinds = conditions[condition.idles]
            ask = f"; the column {kinds.column!r} can say so ({kinds.doc[0].lower()}{kinds.doc[1:].rstrip('.')})"
            ask = ask if _asks_for(refit, observation.take(~loaded), kinds.name) else ""
            where = _where(observation, np.flatnonzero(~loaded))
            return f"rows without load contradict the others: without them ({where}) the model fits{ask}"
    return ""


def _asks_for(refit: Refit, idle: TableObservation, kinds: str) -> bool:
    """Whether a column that tells the kinds apart would change what the model says of rows without load."""
    one, other = (
        refit.problem.over(
            [
                replace(
                    idle,
                    conditions={**idle.conditions, kinds: np.full(idle.n, told)},
                    series=None,
                    position=None,
                )
            ]
        )
        for told in (1.0, 0.0)
    )
    theta = refit.fit.theta
    return not np.array_equal(one.predictions(theta)[0], other.predictions(theta)[0])


def _where(observation: TableObservation, rows: NDArray[np.intp]) -> str:
    """Conditions and lines."""
    place = ", ".join(
        f"{name} {values[rows[0]]:g}"
        for name, values in observation.labels.items()
        if np.issubdtype(np.asarray(values).dtype, np.number) and rows.size <= MOST_LINES
    )
    numbers = np.arange(1, observation.n + 1) if observation.lines is None else observation.lines
    lines = [str(line) for line in numbers[rows]]
    more = " and more" if len(lines) > MOST_LINES else ""
    named = f"line{'s' if len(lines) > 1 else ''} {', '.join(lines[:MOST_LINES])}{more}"
    return f"{place}; {named}" if place else named
