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
LEAST_REPEATED = 20  # rows whose repeats tell what is usual
ODD = 6.0  # usual deviations beyond which a repeat is shown
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
        if chance < STANDS_OUT and _without(refit, observation, block) > WHOLE:
            where = _where(observation, block)
            return f"one {kind} carries the misfit ({where}): without it the model fits; check it before anything else"
    return ""


def odd_repeat(refit: Refit) -> str:
    """A sentence on a reading that lies far from the repeats of its condition; the scatter takes it in otherwise.

    Deviations from the mean of a replicate group, in units of 1.4826 times the median of their sizes (a scale that
    a few outliers do not move); what the model predicts for the conditions that were read is taken off before.
    """
    problem, observation = refit.problem, refit.problem.observations[0]
    if len(problem.observations) > 1 or not isinstance(observation, TableObservation):
        return ""
    if observation.lines is None or observation.replicate_group is None:
        return ""
    _, index, counts = np.unique(observation.replicate_group, return_inverse=True, return_counts=True)
    repeated = counts[index] > 1
    if repeated.sum() < LEAST_REPEATED:
        return ""
    left = (observation.measured - problem.predictions(refit.fit.theta)[0]) / observation.sigma
    off = np.abs(left - (np.bincount(index, left) / counts)[index]) / np.sqrt(
        1 - 1 / np.maximum(counts[index], 2)
    )
    usual = 1.4826 * float(np.median(off[repeated]))
    worst = int(np.argmax(np.where(repeated, off, 0.0)))
    if not off[worst] > ODD * usual:
        return ""
    group = np.flatnonzero(index == index[worst])
    lines = group if group.size == 2 else np.array([worst])
    what = "two repeats differ" if group.size == 2 else "a repeat lies off"
    times = f"{off[worst] / usual:.0f} times the usual scatter"
    return f"{_where(observation, lines)}: {what} by {times}; check it, the stated scatter is larger for it"


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


def _without(refit: Refit, observation: TableObservation, rows: NDArray[np.intp]) -> float:
    """Lack of fit of the other rows, refitted: a large error bends the fit out of the reach of linear algebra.

    What repeats of the other rows hold is no longer known by number, and counts as fit.
    """
    kept = np.ones(observation.n, dtype=bool)
    kept[rows] = False
    part = refit.problem.over([observation.take(kept)])
    rest = Refit(frozenset(), part, fit(part, start=refit.fit.theta, starts=2))
    return rest.lack_of_fit


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
