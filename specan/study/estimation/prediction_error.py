"""How far a model is from what was measured: errors in the unit of the observable, and left-out residuals.

For a block b of rows the left-out residual - what the model, fitted to all other rows, says of b - and its covariance
follow from one fit without a refit. With R = W'(I - QQ')W, where W whitens and Q spans the whitened Jacobian, they are
R_bb^-1 (R r)_b and R_bb^-1, so that S_b = (R r)_b' R_bb^-1 (R r)_b is chi-square. The same algebra gives the mean
relative error of a block with its z: nuisance parameters cannot hide a failure in either.

For errors in cross-validation the model is refitted without each level of each operating variable in turn.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.data.levels import level
from specan.errors import ComputationError
from specan.result import picked
from specan.study.estimation.fit import Fit
from specan.study.estimation.levenberg_marquardt import descend
from specan.study.estimation.linear import Projection, chi2_beside, covariance_root
from specan.study.estimation.problem import Problem
from specan.study.observation import Array, Observation
from specan.study.observation.frf import ABOVE_NOISE, KeptLines
from specan.study.observation.table import TableObservation


def left_out_errors(problem: Problem, fit: Fit) -> list[ObservableError]:
    """Errors of a model on conditions that it was not fitted to, each level of each operating variable in turn.

    The model is fitted anew without every block, and predicts it. None where nothing can be left out, where a fit
    without a block fails, and where rows are many. The observable with most values comes first.
    """
    observation, *others = problem.observations
    if others or not isinstance(observation, TableObservation):
        return []
    left_out = blocks(observation.labels)
    # 400: rows above which the fits cost more than the verdict
    if not left_out or problem.strategy.frugal or observation.n > 400:
        return []
    (slopes,), predicted = problem.sensitivities(fit.theta), []
    for block in left_out:
        kept = np.ones(observation.n, dtype=bool)
        kept[block] = False
        rest = problem.over([observation.without(block)])
        if rest.n_data + rest.n_priors < len(rest.names):
            return []
        try:
            near = [rest.observations[0].whiten(slopes[kept]), fit.jacobian[problem.n_data :]]
            theta = descend(rest, fit.theta, np.concatenate(near)).theta
        except ComputationError:
            return []
        predicted.append(problem.over([observation.take(~kept)]).predictions(theta)[0])
    rows = np.concatenate(left_out)
    return errors_of(
        problem, observation.observable[rows], np.concatenate(predicted), observation.measured[rows]
    )


def blocks(labels: Mapping[str, NDArray[Any]]) -> list[NDArray[np.intp]]:
    """Rows at every level of every operating variable, one after the other.

    Random subsets would leak, since neighbouring lines and repeats share their errors. A variable
    with many values is cut into twelve groups of neighbours.
    """
    most = 12  # blocks of one operating variable
    found = []
    for values in labels.values():
        levels, index = np.unique(np.asarray(values), return_inverse=True)
        if levels.size > most:
            index = index * most // levels.size
        groups = [np.flatnonzero(index == level) for level in np.unique(index)]
        found += groups if len(groups) > 2 else []
    return found


LEAST_SHARE = 0.01  # of its variance that a direction must keep; less is the parameters' extrapolation


@dataclass(frozen=True)
class ObservableError:
    """Errors of one observable over some rows.

    Attributes
    ----------
    rms, bias : float
        Root mean square and mean of predicted less measured, in `unit`.
    relative_rms, relative_max : float
        Root mean square and largest magnitude of the same over the measured value, percent.
    level_dB : float or None
        RMS of the error of levels: of transfer functions over channels and third octaves, without lines
        within 10 dB of their noise; of order lines over sensors, families and harmonics, each line weighing the same.
    level_of : str
        What these are levels of.
    """

    observable: str
    unit: str
    n: int
    rms: float
    bias: float
    relative_rms: float
    relative_max: float
    level_dB: float | None = None
    level_of: str = ""

    def as_error(self) -> Any:
        """The form in which a history keeps it."""
        return {"value": self.rms, "unit": self.unit, "metric": f"RMS of {self.observable}"}

    def as_dict(self) -> Any:
        """Everything, for JSON."""
        names = (
            "observable n rms bias unit relative_rms_percent=relative_rms relative_max_percent=relative_max"
        )
        levels = "" if self.level_dB is None else " level_dB level_of"
        return picked(self, names + levels)


def observable_errors(
    problem: Problem, observations: Sequence[Observation], predictions: Sequence[Array]
) -> list[ObservableError]:
    """Errors of every observable, the one with most values first."""
    names = [np.broadcast_to(getattr(o, "observable", o.name), o.measured.shape) for o in observations]
    found = errors_of(
        problem,
        np.concatenate(names),
        np.concatenate(list(predictions)),
        np.concatenate([o.measured for o in observations]),
    )
    levels = [
        _levels_dB(o, p) for o, p in zip(observations, predictions, strict=True) if isinstance(o, KeptLines)
    ]
    levels = [own for own in levels if own.size]  # none of lines that all drown in their noise
    if not levels or len(found) > 1:
        return found
    what = next(o.level_of for o in observations if isinstance(o, KeptLines))
    return [replace(found[0], level_dB=float(np.sqrt(np.mean(np.concatenate(levels) ** 2))), level_of=what)]


def _levels_dB(observation: KeptLines, predicted: Array) -> Array:
    """Level of the prediction over what was measured, of every cell of an observation of complex lines."""
    own = [np.unique(observation.labels[name], return_inverse=True)[1] for name in observation.cells]
    _, cell = np.unique(np.stack(own), axis=1, return_inverse=True)
    counted, noise = observation.powers()
    floor = np.bincount(cell.ravel(), weights=noise)
    each = (np.bincount(cell.ravel(), counted * values**2) for values in (predicted, observation.measured))
    power = np.array([*each], dtype=float) + floor
    found = level(power[0], power[1])
    return found[np.isfinite(found) & (power[1] > (1 + ABOVE_NOISE) * floor)]


def errors_of(
    problem: Problem, names: NDArray[Any], predicted: Array, measured: Array
) -> list[ObservableError]:
    """Errors of every observable out of rows of several, the one with most values first."""
    found = []
    for name in dict.fromkeys(names.tolist()):
        own = measured[names == name]
        gap, size = predicted[names == name] - own, np.abs(own)
        # near a zero a value is not a measure of an error
        if own.min() < 0 < own.max():
            size = np.full(size.shape, np.sqrt(np.mean(own**2)))
        relative = 100 * gap[size > 0] / size[size > 0]
        known = problem.assembly.model.observables.get(name)
        found.append(
            ObservableError(
                observable=name,
                unit=known.unit if known else "",
                n=int(gap.size),
                rms=float(np.sqrt(np.mean(gap**2))),
                bias=float(np.mean(gap)),
                relative_rms=float(np.sqrt(np.mean(relative**2))) if relative.size else float("nan"),
                relative_max=float(np.max(np.abs(relative))) if relative.size else float("nan"),
            )
        )
    return sorted(found, key=lambda e: -e.n)


@dataclass(frozen=True, eq=False)
class HeldOut:
    """What a fit says about data that it has never seen.

    Attributes
    ----------
    chi2 : float
        r' (V + J C J')^-1 r: the uncertainty of the parameters is part of the prediction's.
    sigma : tuple of array
        Standard uncertainty of predicted less measured, parameters included, one array an observation.
    """

    errors: tuple[ObservableError, ...]
    chi2: float
    n: int
    predictions: tuple[Array, ...]
    sigma: tuple[Array, ...]

    @property
    def reduced_chi2(self) -> float:
        """Chi-square per value."""
        return self.chi2 / self.n


def held_out_error(problem: Problem, best: Fit, observations: Sequence[Observation]) -> HeldOut:
    """Predict observations that were not fitted, with the covariance of the prediction."""
    joint = problem.over([*problem.observations, *observations])
    theta, covariance = _begun(problem, *_carried_over(problem, best, joint), joint)
    seen = len(problem.observations)
    predictions = joint.predictions(theta)[seen:]
    slopes = joint.sensitivities(theta)[seen:]
    white = np.concatenate([o.whiten(s) for o, s in zip(observations, slopes, strict=True)])
    gap = np.concatenate([o.whiten(p - o.measured) for o, p in zip(observations, predictions, strict=True)])
    chi2 = chi2_beside(gap, white @ covariance_root(covariance))
    sigma = [
        np.sqrt(o.sigma**2 + np.einsum("ij,jk,ik->i", s, covariance, s))
        for o, s in zip(observations, slopes, strict=True)
    ]
    shown = joint.plain(theta)[seen:]
    errors = observable_errors(problem, observations, shown)
    return HeldOut(tuple(errors), chi2, int(gap.size), tuple(shown), tuple(sigma))


def _carried_over(problem: Problem, best: Fit, joint: Problem) -> tuple[Array, Array]:
    """Theta and covariance of a problem with more recordings.

    A parameter of a recording that was not fitted is taken as the mean of those that were, with their
    scatter as its uncertainty.
    """
    place = {name: k for k, name in enumerate(problem.names)}
    theta = np.empty(len(joint.names))
    covariance = np.zeros((theta.size, theta.size))
    known = [k for k, name in enumerate(joint.names) if name in place]
    old = [place[joint.names[k]] for k in known]
    theta[known] = best.theta[old]
    covariance[np.ix_(known, known)] = best.covariance[np.ix_(old, old)]
    for k, name in enumerate(joint.names):
        if name not in place:
            fitted = [best.theta[i] for n, i in place.items() if n.whole == name.whole]
            theta[k], covariance[k, k] = np.mean(fitted), np.var(fitted)
    return theta, covariance


def _begun(problem: Problem, theta: Array, covariance: Array, joint: Problem) -> tuple[Array, Array]:
    """The same with the starts of states that recordings beside the fitted ones tell themselves."""
    rates, fitted = problem.assembly.model.rates, set(problem.names)
    starts = {f"{name}_start" for name in (rates.states if rates else ())}
    place = {name: k for k, name in enumerate(joint.names) if name not in fitted and name.owner in starts}
    free = tuple(dict.fromkeys(name.whole for name in place))
    for o in joint.observations if free else ():
        if set(o.recordings) <= set(problem.recordings):
            continue
        known = dict(joint.seen_by(o, joint.values_at(theta)))
        alone = replace(joint, observations=(o,), free=free, values=known)
        found = descend(alone, alone.start())
        of = [k for k, name in enumerate(alone.names) if name in place]
        at = [place[alone.names[k]] for k in of]
        theta[at] = found.theta[of]
        covariance[np.ix_(at, at)] = np.linalg.pinv(found.jacobian.T @ found.jacobian)[np.ix_(of, of)]
    return theta, covariance


class LeftOut:
    """The algebra of left-out rows of one fit.

    Without a block the other rows may leave a parameter open; the linear refit then must not run out of
    its domain. Parameters at a bound stay there, the others are held by half their domain's width.
    """

    def __init__(self, problem: Problem, best: Fit) -> None:
        self.problem = problem
        low, high = problem.bounds
        free = np.array([name not in best.at_bound for name in problem.names], dtype=bool)
        hold = np.diag(2 / (high - low))[free]  # zero where the domain has no end
        jacobian = np.vstack([best.jacobian, hold])[:, free]
        residual = np.concatenate([best.residual, np.zeros(hold.shape[0])])
        self.linear = Projection.of(residual, jacobian)
        self.projected = self.linear.project_out(residual)
        self.predicted = np.concatenate(problem.predictions(best.theta))
        self._other_rows = residual.size - problem.n_data

    def _taken_out(self, white: Array) -> Array:
        """Whitened columns over the data rows, with everything taken out that the parameters absorb."""
        whole = np.vstack([white, np.zeros((self._other_rows, white.shape[1]))])
        return self.linear.project_out(whole)

    @cached_property
    def _unit_columns(self) -> Array:
        """Columns of single rows, each in units of its own uncertainty."""
        sigma = np.concatenate([o.sigma for o in self.problem.observations])
        return self._taken_out(self.problem.whiten(np.diag(sigma)))

    def directions(self, blocks: Sequence[NDArray[np.bool_]]) -> list[tuple[float, float]]:
        """Mean relative error of the prediction over the rows of each block, and its z."""
        at_once = 256  # blocks whose directions are computed together
        found = []
        for first in range(0, len(blocks), at_once):
            part = blocks[first : first + at_once]
            raw = np.stack([np.where(rows, self.predicted, 0.0) for rows in part], 1)
            white = self.problem.whiten(raw)
            columns = self._taken_out(white)
            sizes, wholes = np.sum(columns**2, axis=0), np.sum(white**2, axis=0)
            for size, whole, along in zip(sizes, wholes, columns.T @ self.projected, strict=True):
                open_ = size <= LEAST_SHARE * whole
                found.append(
                    (float("nan"), 0.0) if open_ else (float(along / size), float(along / np.sqrt(size)))
                )
        return found

    def statistic(self, rows: NDArray[np.bool_]) -> tuple[float, float]:
        """S_b and its degrees of freedom: directions that only the block determines do not count."""
        columns = self._unit_columns[:, rows]
        values, vectors = np.linalg.eigh(columns.T @ columns)
        kept = values > LEAST_SHARE * max(values[-1], 1e-300)
        along = vectors[:, kept].T @ (columns.T @ self.projected)
        return float(np.sum(along**2 / values[kept])), float(np.sum(kept))
