"""What the equations of an explanation may be wrong by, and what no equation describes, as covariances.

No equation is exact. What a set of effects changes against the base may be wrong by a share of it, smoothly over the
operating variables. What nothing describes is of the size of the prediction or of the data, as smooth.

Complex lines of recordings are many, and pass resonances that an equation puts a little beside their place: there a
further share is wrong of each line by itself, and what nothing describes differs from line to line. All channels share
the smooth part, or each has its own.

Smooth functions have the covariance exp(-d^2 / 2), d the distance of two operating points in units of a length, each
variable on a scale of 0 to 1 over its measured range.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import cache
from typing import Any

import numpy as np
from scipy.linalg import toeplitz

from specan.study.data.open_tables import choices, stretched
from specan.study.data.setpoints import operating
from specan.study.estimation.problem import Problem
from specan.study.evidence.faults import SIZES, levels, ln_mean, sizes_of
from specan.study.evidence.marginal import FORMS, Marginal
from specan.study.evidence.noise import Noise, Rough
from specan.study.observation import Array
from specan.study.observation.time import TimeObservation


def operating_variables(problem: Problem) -> list[Array]:
    """Those that vary, of all measured rows."""
    names = operating(problem.assembly.model, problem.observations[0].conditions)
    each = [
        np.concatenate([np.asarray(o.conditions[name], float) for o in problem.observations])
        for name in names
        if all(name in o.conditions for o in problem.observations)
    ]
    return [x for x in each if np.ptp(x) > 0]


def operating_points(problem: Problem) -> Array:
    """Operating variables of all measured rows, each from 0 to 1 over its range; shape (n, d)."""
    columns = [stretched(x, float(x.min()), float(x.max())) for x in operating_variables(problem)]
    return np.stack(columns, axis=1) if columns else np.zeros((problem.n_data, 0))


def kernel_root(points: Array, length: float) -> Array:
    """Columns R with R R' the covariance of a smooth function, by pivoted Cholesky decomposition.

    Parameters
    ----------
    points : array, shape (n, d)
    length : float
        Over which the function changes, in ranges of a variable.

    Examples
    --------
    >>> import numpy as np
    >>> root = kernel_root(np.linspace(0, 1, 50)[:, None], 0.5)
    >>> root.shape[1] < 10, bool(np.all(np.abs(np.sum(root**2, axis=1) - 1) < 1e-3))
    (True, True)
    """
    left = np.ones(points.shape[0])
    columns: list[Array] = []
    # 1e-3: of the variance, that a root may leave out
    # 100: columns of a root
    while left.max() > 1e-3 and len(columns) < 100:
        k = int(np.argmax(left))
        column = np.exp(-0.5 * np.sum(((points - points[k]) / length) ** 2, axis=1))
        for other in columns:
            column = column - other * other[k]
        column /= np.sqrt(left[k])
        columns.append(column)
        left = np.maximum(left - column**2, 0.0)
    return np.stack(columns, axis=1)


FORM_LENGTH = 0.5  # ranges of the operating variables, over which an error of form changes
UNKNOWN_LENGTHS = (0.25, 0.5, 1.0)  # the same of what no effect describes
LEVELS_APART = 1 / 16  # the same of what changes from level to level, where levels come again
UNKNOWN_SIZES = (*SIZES, 1.0)  # of it, up to the whole prediction
# Shares of unknown functions: smooth, straight lines, at one level of a variable or from it on.
KINDS = (0.7, 0.1, 0.2)
ROUGH = (0.0, 0.01, 0.03, 0.3)  # shares to which it may be wrong in each line by itself
DELAYS = 30  # samples over which what is left may answer to the inputs, as many as noise may follow itself
POWERS: tuple[Callable[[Array], Array], ...] = (np.square, lambda x: x**3, lambda x: x * np.abs(x))

# Form of the noise, columns, and deviations of their coefficients.
Wrong = tuple[Noise | None, Array, tuple[float, ...]]


class OverConditions:
    """Smooth functions of the operating variables of tables, of any choice of them."""

    def __init__(self, problem: Problem) -> None:
        self.points = operating_points(problem)
        self._choices = choices(self.points.shape[1])
        # a search asks for the same ones hundreds of times
        self._root = cache(lambda variables, length: kernel_root(self.points[:, variables], length))

    def of_change(self, problem: Problem, change: Array) -> Iterator[Wrong]:
        """What the equations behind a change of the prediction may be wrong by, in each form; the largest last.

        Several observables may be wrong alike, or each in a way of its own.

        Parameters
        ----------
        problem : Problem
            With the observations that the change is over.
        change : array, shape (n,)
        """
        for variables in self._choices:
            for one in _alike_or_not(problem, self._root(variables, FORM_LENGTH)):
                yield None, problem.whiten(change[:, None] * one), FORMS

    def gain_of_unknown(self, problem: Problem, predicted: Array, beside: Marginal) -> float:
        """ln of the evidence with what no equation describes over that without, summed over its sizes and forms."""
        kinds, sizes = [], np.array(UNKNOWN_SIZES)
        likeliest, best = 0.0, np.zeros((0, 0))
        for share, columns in self._unknown(problem, predicted):
            gains = []
            for white in map(problem.whiten, columns):
                gains.append(beside.beside(white, sizes)[0])
                if gains[-1].max() > likeliest:
                    likeliest, best, own = gains[-1].max(), white, gains
                    place = len(gains) - 1
            kinds.append((share, gains))
        if best.size:
            own[place] = beside.with_pulls(best, sizes)[0]
        each = [ln_mean(np.ravel(gains)) + np.log(share) for share, gains in kinds if gains]
        return float(np.logaddexp.reduce(each))

    def _unknown(self, problem: Problem, predicted: Array) -> Iterator[tuple[float, Iterable[Array]]]:
        """Columns of functions of the size of the prediction, of each kind with its share."""
        if any(isinstance(o, TimeObservation) for o in problem.observations):
            yield 1.0, delayed_functions(problem, predicted)
            return
        # Straight lines: the order of rows often goes with a variable, and a drift is straight too.
        lines = ((x[:, None] - x.mean()) / np.ptp(x) for x in operating_variables(problem))
        # at one level of an operating variable, as at a resonance, or from one on
        root = self._root(self._choices[-1], max(UNKNOWN_LENGTHS))
        at_levels = (rows[:, None] * root for rows in levels(problem))
        sizes = sizes_of(problem, predicted)
        for share, roots in zip(KINDS, (self._smooth(problem), lines, at_levels), strict=True):
            yield share, (size[:, None] * one for one in roots for size in sizes)

    def _smooth(self, problem: Problem) -> Iterator[Array]:
        """Columns of smooth functions, of every choice of variables and length.

        Several observables may fail alike, or each in a way of its own.
        """
        for variables in self._choices:
            points = self.points[:, variables]
            distinct = np.unique(np.round(points / LEVELS_APART), axis=0).shape[0]
            again = 2 * distinct <= points.shape[0]  # what every row has for itself is scatter
            for length in (LEVELS_APART, *UNKNOWN_LENGTHS) if again else UNKNOWN_LENGTHS:
                yield from _alike_or_not(problem, self._root(variables, length))


def delayed_functions(problem: Problem, predicted: Array) -> Iterator[Array]:
    """What answers to the inputs with a delay and not in proportion, of the size of the prediction.

    Noise does not go with the inputs, whatever it follows in time; what an effect leaves does. Volterra's series, with
    powers of the prediction for products of inputs, each behind a filter of `DELAYS` taps.
    """
    blocks: list[list[Array]] = [[] for _ in POWERS]
    first = 0
    for o in problem.observations:
        for chains in o.chains.values() if isinstance(o, TimeObservation) else ():
            both = first + np.concatenate(chains)
            size = float(np.std(predicted[both])) or 1.0
            for power, block in zip(POWERS, blocks, strict=True):
                columns = np.zeros((problem.n_data, DELAYS))
                for rows in chains:
                    shape = power((predicted[first + rows] - np.mean(predicted[both])) / size)
                    columns[first + rows] = toeplitz(shape, np.zeros(DELAYS))
                level = float(np.sqrt(np.mean(columns[both, 0] ** 2)))
                block.append(columns * size / (level or 1.0))
        first += o.n
    each = [np.hstack(block) for block in blocks]
    yield from (*each, np.hstack(each))


class AlongLines:
    """Errors of complex lines: smooth along them and common to the channels, and of each line by itself."""

    def of_change(self, problem: Problem, change: Array) -> Iterator[Wrong]:
        """See `OverConditions`."""
        lines: Any = problem.observations
        parts = problem.split(change)[:-1]
        turned = np.concatenate([o.turned(part) for o, part in zip(lines, parts, strict=True)])
        sizes = np.concatenate([o.sizes(part) / o.unshared for o, part in zip(lines, parts, strict=True)])
        along, row = np.unique(np.concatenate([o.along for o in lines]), return_inverse=True)
        channels = np.concatenate([np.asarray(o.labels["channel"]) for o in lines])
        own = (channels[:, None] == np.unique(channels)).astype(float)
        root = kernel_root(along[:, None], FORM_LENGTH)[row]
        for of, roughs in ((np.ones((row.size, 1)), ROUGH), (own, ROUGH[::2])):
            each = (root[:, :, None] * of[:, None, :]).reshape(row.size, -1)
            white = problem.whiten(np.hstack([change[:, None] * each, turned[:, None] * each]))
            # 0.1: standard deviations that a column changes all rows by, below which it says nothing
            white = white[:, np.sum(white**2, axis=0) * FORMS[-1] ** 2 > 0.1**2]
            for rough in roughs:
                yield Rough(rough * sizes) if rough else None, white, FORMS

    def gain_of_unknown(self, problem: Problem, predicted: Array, beside: Marginal) -> float:
        """See `OverConditions`."""
        lines: Any = problem.observations
        counts = beside.tangent.seen(np.ones((problem.n_data, 1)))[:, 0]
        found = []
        for usual in zip(*(o.usual_sizes for o in lines), strict=True):
            sizes = np.concatenate([size / o.unshared for o, size in zip(lines, usual, strict=True)])
            for share in UNKNOWN_SIZES:
                noise = Rough(share * sizes * counts)
                found.append(Marginal(beside.tangent.with_noise(noise), beside.columns).ln_evidence)
        return float(ln_mean(found)) - beside.ln_evidence


def _alike_or_not(problem: Problem, root: Array) -> list[Array]:
    """Columns that all observables share, and where there are several, the same of each alone."""
    own = list(problem.observable_rows.values())
    return [root] if len(own) == 1 else [root, np.hstack([root * rows[:, None] for rows in own])]
