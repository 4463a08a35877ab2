"""Single readings and single conditions that carry a misfit: a mistake in the table looks like physics otherwise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from specan.study.observation.table import TableObservation
from specan.study.selection.f_test import lack_of_fit_probability
from specan.study.selection.refits import Refit

# Family-wise probability below which rows stand out, as of a lack of fit; and that above which the rest is whole.
STANDS_OUT, WHOLE = 1e-3, 0.05
MOST_LINES = 6


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
        or observation.cell is None
    ):
        return ""
    if problem.dear or refit.lack_of_fit >= STANDS_OUT or observation.lines is None:
        return ""
    readings = [np.array([k]) for k in range(observation.n)]
    conditions = [np.flatnonzero(observation.cell == cell) for cell in np.unique(observation.cell)]
    for kind, blocks in (("reading", readings), ("condition", conditions)):
        falls = np.array([_fall(refit, block) for block in blocks])
        worst = int(np.argmax(falls))
        block = blocks[worst]
        chance = len(blocks) * lack_of_fit_probability(falls[worst], block.size, problem.noise_dof)
        rest = lack_of_fit_probability(
            max(refit.lack - falls[worst], 0.0), max(refit.dof - block.size, 1.0), problem.noise_dof
        )
        if chance < STANDS_OUT and rest > WHOLE:
            where = _where(observation, block)
            return f"one {kind} carries the misfit ({where}): without it the model fits; check it before anything else"
    return ""


def _fall(refit: Refit, rows: NDArray[np.intp]) -> float:
    basis, residual = refit.linear.basis[rows], refit.linear.residual[rows]
    left = np.eye(rows.size) - basis @ basis.T
    return float(residual @ np.linalg.lstsq(left, residual, rcond=1e-9)[0])


def _where(observation: TableObservation, rows: NDArray[np.intp]) -> str:
    """Conditions and lines."""
    assert observation.lines is not None
    place = ", ".join(f"{name} {values[rows[0]]:g}" for name, values in observation.labels.items()
                      if np.issubdtype(np.asarray(values).dtype, np.number))  # fmt: skip
    lines = [str(line) for line in observation.lines[rows]]
    more = " and more" if len(lines) > MOST_LINES else ""
    word = "line" if len(lines) == 1 else "lines"
    return f"{place}; {word} {', '.join(lines[:MOST_LINES])}{more}" if place else f"{word} {', '.join(lines)}"
