"""Where a model fails on order lines: families of lines beside the harmonics, in dB and in standard uncertainties.

A model that shows no line where one was measured has no relative error, so blocks are judged by the left-out chi-square
alone (`specan.study.localisation.localise`), and their level says how far the model lies below or above the
measurement there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.planetary_gear.study.order_lines import OrderLinesObservation
from specan.result import first_of, gathered
from specan.study.estimation.fit import Fit, misfit_p_value
from specan.study.estimation.prediction_error import LeftOut
from specan.study.estimation.problem import Problem
from specan.study.localisation.localise import Block, Localisation, Trend, tested
from specan.study.observation import Array

LOUDER = 2.0  # dB between the first and the last level from which a failure is said to grow or fall
MOST_SENTENCES, MOST_FAMILIES = 3, 4  # that are told, and in each
MOST_Z = 40.0  # beyond which a normal law gives no number


def localise(problem: Problem, best: Fit) -> Localisation:
    """Find the families of order lines, and their harmonics, sensors and operating points, at which a model fails."""
    algebra = LeftOut(problem, best)
    lines = _Lines(problem, problem.plain(best.theta)[0])
    blocks = [_block(algebra, lines, *place) for place in _places(lines.labels) if lines.apart(place[1])]
    marked = sorted(tested(blocks), key=lambda b: b.p_value)
    fails = [b for b in marked if b.significant and set(b.where) == {"orders"}]
    whole = [b for b in marked if set(b.where) == {"orders"}]
    trend = Trend("orders", min((b.p_value for b in whole), default=1.0), bool(fails), "", "orders")
    return Localisation(tuple(marked), (trend,), tuple(_sentences(lines, fails)))


class _Lines:
    """Measured, predicted and noise of every row, with labels."""

    def __init__(self, problem: Problem, predicted: Array) -> None:
        (seen,) = problem.observations
        assert isinstance(seen, OrderLinesObservation)
        self.predicted, self.measured, self.noise = predicted, seen.measured, seen.sigma
        self.labels, self.variables = seen.labels, seen.variables
        self.order = seen.rows(seen.known.order)
        # of the line that a row is a part of: its error and its size
        self.gap = seen.rows(np.abs(seen.lines_of(predicted) - seen.amplitude))
        self.size = seen.rows(np.abs(seen.amplitude))
        self.allowed = np.hypot(seen.known.near * self.size, np.sqrt(2) * self.noise)
        self.middle = _middle(seen, predicted)
        self.observable = seen.observable
        self.unit = problem.assembly.model.observables[self.observable].unit

    def apart(self, rows: NDArray[np.bool_]) -> bool:
        """Whether lines are further off than the model is declared to be, whatever errors of others make likely."""
        return bool(np.sum(self.gap[rows] ** 2) > np.sum(self.allowed[rows] ** 2))

    def level(self, rows: NDArray[np.bool_]) -> float:
        """Model over measurement, dB; both with the noise, below which nothing is known."""
        noise = np.sum(self.noise[rows] ** 2)
        model, measured = (np.sum(lines[rows] ** 2) + noise for lines in (self.predicted, self.measured))
        return float(10 * np.log10(model / measured))

    def furthest_off(self, rows: NDArray[np.bool_]) -> str:
        """The line with the largest error, in words."""
        row = int(np.argmax(np.where(rows, self.gap, -1.0)))
        percent = 100 * self.gap[row] / max(self.size[row], 1e-300)
        return f"most at order {self.order[row]:.5g} of {self.labels['channel'][row]}, off by {percent:.0f} %"

    def missing(self, rows: NDArray[np.bool_]) -> float:
        """What the model lacks, over the harmonic that each line lies about, dB."""
        gap = (self.measured[rows] - self.predicted[rows]) ** 2 - self.noise[rows] ** 2
        share = float(np.mean(gap / np.maximum(self.middle[rows] ** 2, 1e-300)))
        return float(10 * np.log10(max(share, 1e-300)))


def _middle(o: OrderLinesObservation, predicted: Array) -> Array:
    """Root mean square, over its two parts, of the line that the model has strongest about each row's harmonic."""
    own, middle = np.abs(o.lines_of(predicted)), np.zeros(o.kept.shape)
    for h in np.unique(o.known.harmonic):
        about = o.known.harmonic == h
        line = np.argmax(np.where(o.kept & about, own, -1.0), axis=1)[:, None]
        middle[:, about] = np.abs(np.take_along_axis(o.amplitude, line, axis=1)) / np.sqrt(2)
    return o.rows(middle)


def _places(labels: Mapping[str, NDArray[Any]]) -> list[tuple[dict[str, Any], NDArray[np.bool_]]]:
    """Every family, and every family at each level of another label."""
    found = []
    for family in dict.fromkeys(labels["orders"].tolist()):
        mine = labels["orders"] == family
        found.append(({"orders": family}, mine))
        for name, values in labels.items():
            levels = np.unique(values).tolist()
            if name == "orders" or len(levels) < 2:
                continue
            found += [({"orders": family, name: v}, mine & (values == v)) for v in levels]
    return [(where, rows) for where, rows in found if np.any(rows)]


def _block(algebra: LeftOut, lines: _Lines, where: Mapping[str, Any], rows: NDArray[np.bool_]) -> Block:
    from scipy.special import ndtri_exp

    statistic, dof = algebra.statistic(rows)
    p = misfit_p_value(statistic, dof, algebra.problem.noise_dof)
    level = lines.level(rows)
    size = min(float(-ndtri_exp(np.log(max(p, 1e-300) / 2))), MOST_Z)
    error = float(np.sqrt(np.mean((lines.predicted[rows] - lines.measured[rows]) ** 2)))
    percent = 100 * (10 ** (level / 20) - 1)
    return Block(
        where, lines.observable, int(rows.sum()), statistic, p, float(np.copysign(size, level)), percent,
        float(np.copysign(error, level)), lines.unit, level_dB=level, variables=lines.variables,
    )  # fmt: skip


def _sentences(lines: _Lines, fails: Sequence[Block]) -> list[str]:
    """Families with their levels, those of one course in one sentence, and the line that is furthest off."""
    alike = gathered((_course(lines, block.where["orders"]), block) for block in fails)
    found = []
    for course, blocks in list(alike.items())[:MOST_SENTENCES]:
        each = [f"{b.where['orders']}: {b.text} (z = {b.z:.1f})" for b in blocks]
        rows = np.isin(lines.labels["orders"], [b.where["orders"] for b in blocks])
        found.append(f"fails at orders {first_of(each, MOST_FAMILIES)}{course}; {lines.furthest_off(rows)}")
    return found


def _course(lines: _Lines, family: str) -> str:
    """``, growing with h`` where the missing lines grow against their harmonic; likewise with a condition."""
    rows, said = lines.labels["orders"] == family, ""
    for name, values in lines.labels.items():
        levels = np.unique(values[rows]).tolist()
        if name in ("orders", "channel") or len(levels) < 2:
            continue
        course = [lines.missing(rows & (values == level)) for level in levels]
        steps = np.diff(course)
        if abs(course[-1] - course[0]) > LOUDER and (np.all(steps > 0) or np.all(steps < 0)):
            words = "h" if name == "harmonic" else lines.variables[name].words
            said += f", {'growing' if steps[0] > 0 else 'falling'} with {words}"
    return said
