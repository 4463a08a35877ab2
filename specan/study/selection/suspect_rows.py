"""Single readings and single conditions that carry a misfit: a mistake in the table looks like physics otherwise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from specan.study.data.plausible_rows import IDLE
from specan.study.estimation.fit import fit
from specan.study.observation.table import TableObservation
from specan.study.selection.f_test import lack_of_fit_probability
from specan.study.selection.refits import Refit

# Family-wise probability below which rows stand out, as of a lack of fit; and that above which the rest is whole.
STANDS_OUT, WHOLE = 1e-3, 0.05
MOST_LINES = 6  # of a table that a sentence names
LEAST_ROWS = 3  # of each kind, below which kinds are not compared
KINDS = "coupled"  # condition that tells runs with the brake from those without it


def suspect_rows(refit: Refit) -> str:
    """A sentence on the one condition, or the one reading, without which the model meets the data.

    The chi-square that rows b take with them is S_b = r_b' (I - H_bb)^-1 r_b, the fall of the minimum when they are
    left out, by linear algebra. Empty where the model meets the data, where nothing stands out, and where rows are few.
    """
    problem = refit.problem
    observation = problem.observations[0]
    if (
        len(problem.observations) > 1
        or not isinstance(observation, TableObservation)
        or observation.replicate_group is None
    ):
        return ""
    if not problem.strategy.secondary_refits or refit.lack_of_fit >= STANDS_OUT or observation.lines is None:
        return ""
    readings = [np.array([k]) for k in range(observation.n)]
    conditions = [
        np.flatnonzero(observation.replicate_group == cell) for cell in np.unique(observation.replicate_group)
    ]
    for kind, blocks in (("reading", readings), ("condition", conditions)):
        falls = np.array([_fall(refit, block) for block in blocks])
        worst = int(np.argmax(falls))
        block = blocks[worst]
        chance = len(blocks) * lack_of_fit_probability(falls[worst], block.size, problem.noise_dof)
        rest = lack_of_fit_probability(
            max(refit.lack_of_fit_chi2 - falls[worst], 0.0),
            max(refit.dof - block.size, 1.0),
            problem.noise_dof,
        )
        if chance < STANDS_OUT and rest > WHOLE:
            where = _where(observation, block)
            return f"one {kind} carries the misfit ({where}): without it the model fits; check it before anything else"
    return ""


def rows_of_two_kinds(refit: Refit) -> str:
    """A sentence on idle rows that contradict the loaded ones: the model fails on all, and meets the loaded ones.

    The model is refitted without the rows near zero of a condition that `idles`. Empty where the model meets the data,
    where one kind is missing, and where the table tells the kinds apart already (a column ``coupled`` that varies).
    """
    problem, observation = refit.problem, refit.problem.observations[0]
    if len(problem.observations) > 1 or not isinstance(observation, TableObservation):
        return ""
    if not problem.strategy.secondary_refits or refit.lack_of_fit >= STANDS_OUT:
        return ""
    conditions = problem.assembly.model.conditions
    told = KINDS in conditions and np.ptp(observation.conditions.get(KINDS, np.ones(1))) > 0
    for name, condition in conditions.items():
        if not condition.idles or name not in observation.conditions or told:
            continue
        size = np.abs(observation.conditions[name])
        loaded = size > IDLE * size.max()
        if loaded.sum() < LEAST_ROWS or (~loaded).sum() < LEAST_ROWS:
            continue
        part = problem.over([observation.take(loaded)])
        rest = Refit(frozenset(), part, fit(part, start=refit.fit.theta))
        if rest.dof > 0 and rest.lack_of_fit > WHOLE:
            ask = (
                "; if they were run with the brake uncoupled, say so in a column 'coupled' (0 there, else 1)"
                if KINDS in conditions
                else ""
            )
            where = _where(observation, np.flatnonzero(~loaded))
            return f"rows without load contradict the others: without them ({where}) the model fits{ask}"
    return ""


def _fall(refit: Refit, rows: NDArray[np.intp]) -> float:
    basis, residual = refit.linear.basis[rows], refit.linear.residual[rows]
    left = np.eye(rows.size) - basis @ basis.T
    return float(residual @ np.linalg.lstsq(left, residual, rcond=1e-9)[0])


def _where(observation: TableObservation, rows: NDArray[np.intp]) -> str:
    """Conditions and lines."""
    assert observation.lines is not None
    place = ", ".join(
        f"{name} {values[rows[0]]:g}"
        for name, values in observation.labels.items()
        if np.issubdtype(np.asarray(values).dtype, np.number) and rows.size <= MOST_LINES
    )
    lines = [str(line) for line in observation.lines[rows]]
    more = " and more" if len(lines) > MOST_LINES else ""
    word = "line" if len(lines) == 1 else "lines"
    return (
        f"{place}; {word} {', '.join(lines[:MOST_LINES])}{more}"
        if place
        else f"{word} {', '.join(lines[:MOST_LINES])}{more}"
    )
