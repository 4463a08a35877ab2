"""A frugal descent of least squares, for the many refits of a search.

Levenberg-Marquardt steps (Marquardt 1963) with the parameters held inside their bounds. The descent takes few
Jacobians: between exact ones the secant update of Broyden (1965) keeps the last one current at the price of one
residual, and a minimum is accepted only on an exact one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from specan.errors import ComputationError
from specan.models.kept import each_anew
from specan.study.estimation.linear import held_inside
from specan.study.estimation.problem import Problem
from specan.study.observation import Array

# In units of the reduced chi-square where that exceeds one: a fit that is bad needs no digits.
STEP_TOLERANCE = 1e-3  # chi-square that an exact Gauss-Newton step may still promise
STALL_TOLERANCE = 0.02  # or by which it has fallen over the last five exact Jacobians, in a valley that bends
MOST_JACOBIANS = 25  # of one descent, before it counts as not converged
SCREENING_JACOBIANS = 3  # Jacobians that each of several starts is led by before the others are left


@dataclass(frozen=True)
class Minimum:
    """Where a descent ended."""

    theta: Array
    residual: Array
    jacobian: Array
    chi2: float


class NotSettledError(ComputationError):
    """A descent that was still getting lower when it was given up.

    Attributes
    ----------
    reached : Minimum
        The lowest place that it came to.
    """

    def __init__(self, reached: Minimum, jacobians: int) -> None:
        super().__init__(f"it did not converge within {jacobians} Jacobians")
        self.reached = reached


def descend(problem: Problem, start: Array, slopes: Array | None = None) -> Minimum:
    """Minimise the sum of squares of a problem's residual from one start.

    Parameters
    ----------
    problem : Problem
    start : array
        Theta.
    slopes : array, optional
        Jacobian near the start. It is kept current by secants, and a minimum is then accepted on it:
        for problems whose Jacobian costs more than the verdict needs.

    Raises
    ------
    ComputationError
        Not finite at the start, or not settled after 25 Jacobians. A fit that is still far from many data and
        improves slowly is taken as it is: nothing is concluded from its exact minimum.
    """
    descent = _Descent(problem, start)
    history: list[float] = []
    for count in range(MOST_JACOBIANS):
        history.append(descent.chi2)
        guessed = slopes is not None and count == 0
        jacobian = slopes if slopes is not None and count == 0 else problem.jacobian(descent.theta)
        jacobian = finite(jacobian, "derivatives")
        slow = len(history) > 5 and history[-6] - history[-1] < descent.little
        found = descent.minimum(jacobian) if slow else descent.follow(jacobian, guessed)
        if found is None:
            continue
        if problem.settled(found.theta):
            return found
        descent, history = _Descent(problem, found.theta), []
    raise NotSettledError(descent.minimum(problem.jacobian(descent.theta)), MOST_JACOBIANS)


def descend_steps(problem: Problem, start: Array, jacobians: int) -> Array:
    """Where some exact Jacobians lead: near a minimum, if there is one near."""
    descent = _Descent(problem, start)
    for _ in range(jacobians):
        if descent.follow(problem.jacobian(descent.theta), guessed=False) is not None:
            break
    return descent.theta


def best_screened(problem: Problem, starts: Sequence[Array]) -> Array:
    """Where some Jacobians lead that of several starts from which they lead lowest.

    Raises
    ------
    ComputationError
        None is finite.
    """
    if len(starts) == 1:
        return starts[0]
    reached, why = led(problem, starts, SCREENING_JACOBIANS)
    if not reached:
        raise ComputationError(why)
    return reached[0]


def led(problem: Problem, starts: Sequence[Array], jacobians: int) -> tuple[list[Array], str]:
    """Where some Jacobians lead from several starts, the lowest first; and why the last of those failed that did."""

    def one(start: Array) -> tuple[float, Array] | str:
        try:
            theta = descend_steps(problem, start, jacobians)
        except ComputationError as fault:
            return fault.found
        residual = problem.residual(theta)
        return float(residual @ residual), theta

    tried = each_anew(one, starts)
    reached = sorted((r for r in tried if not isinstance(r, str)), key=lambda r: r[0])
    return [theta for _, theta in reached], next((why for why in tried[::-1] if isinstance(why, str)), "")


def unit(problem: Problem, chi2: float) -> float:
    """Chi-square per degree of freedom, at least one; the unit of the convergence tolerances."""
    # 20: 0.02 of chi-square, which no verdict shows
    return max(chi2 / (problem.n_data + problem.n_priors), 1.0) * (20.0 if problem.strategy.frugal else 1.0)


class _Descent:
    """A descent by secants: theta, inside its bounds, the residual there, and the damping of its next step."""

    def __init__(self, problem: Problem, start: Array) -> None:
        self.problem, self.size = problem, problem.scale
        self.low, self.high = problem.bounds
        self.theta, residual = self.at(np.asarray(start, dtype=float))
        if residual is None:
            raise ComputationError("the model gives values that are not finite at the start of a fit")
        self.residual = residual
        # Of the first step, in units of the diagonal of J'J. In a valley of nearly collinear parameters 1e-4 shortens
        # every step; where an evaluation is expensive a step that fails costs more than that.
        self.damping = 1e-4 if problem.strategy.frugal else 1e-8

    @property
    def chi2(self) -> float:
        return float(self.residual @ self.residual)

    def at(self, theta: Array) -> tuple[Array, Array | None]:
        """A place inside the bounds, and the residual there; None where the model has no finite value."""
        inside = np.clip(theta, self.low, self.high)
        try:
            residual = self.problem.residual(inside)
        except ComputationError:  # a loop of the model that does not converge there: the step was too long
            return inside, None
        return inside, residual if np.all(np.isfinite(residual)) else None

    def minimum(self, jacobian: Array) -> Minimum:
        return Minimum(self.theta, self.residual, jacobian, self.chi2)

    @property
    def little(self) -> float:
        """By how much five Jacobians must lower chi-square to be worth going on."""
        # 10.0: reduced chi-square above which the exact minimum of a frugal fit is of no interest
        far_off = self.problem.strategy.frugal and self.chi2 > 10.0 * (
            self.problem.n_data + self.problem.n_priors
        )
        # 0.05: share by which five Jacobians have to lower chi-square there to be worth going on
        return 0.05 * self.chi2 if far_off else STALL_TOLERANCE * unit(self.problem, self.chi2)

    def follow(self, jacobian: Array, guessed: bool) -> Minimum | None:
        """Steps by secants from one Jacobian; the minimum if it, or a guess kept current, promises no more."""
        slope, start = jacobian * self.size, self.theta
        # 12: steps between two exact Jacobians
        for secant in range(12):
            step, promised = self._step(slope, self.damping)
            enough = STEP_TOLERANCE * unit(self.problem, self.chi2)
            if promised < enough:
                # 1e-6: damping with which a minimum is confirmed: a large one must not pass for it
                if (secant == 0 or guessed) and self._step(slope, 1e-6)[1] < enough:
                    return self.minimum(slope / self.size)
                if secant > 0:
                    return None
            before, residual = self.theta, self.residual
            trial, there = self.at(before + step * self.size)
            if secant == 0 and there is not None and there @ there > self.chi2:
                trial, there = self._bent(slope, step, trial, there)
            moved = (trial - before) / self.size
            if there is not None and moved @ moved > 0:
                slope = slope + np.outer(there - residual - slope @ moved, moved) / (moved @ moved)
            gained = -np.inf if there is None else float(residual @ residual - there @ there)
            if there is None or gained <= 0:
                self.damping = min(max(self.damping * 10, 1e-6), 1e10)
                if secant > 0 and (guessed or self.theta is not start):
                    return None  # a new Jacobian tells more; where nothing has moved it would be the same
                slope = jacobian * self.size  # the exact one is better than a secant over a step that failed
                continue
            if gained > 0.5 * promised and self.damping > 1e-7:
                trial, there = self._further(before, trial, there)
            self.theta, self.residual = trial, there
            if gained > 0.3 * promised:
                self.damping = max(self.damping / 10, 1e-12)
            if gained < 0.1 * promised:
                return None
        return None

    def _step(self, slope: Array, damping: float) -> tuple[Array, float]:
        """Damped step inside the bounds and the fall in chi-square that it promises."""
        low, high = (self.low - self.theta) / self.size, (self.high - self.theta) / self.size
        gradient, normal = slope.T @ self.residual, slope.T @ slope
        weight = damping * np.maximum(np.diag(normal), 1e-12)
        step = _solve(normal + np.diag(weight), -gradient)
        if np.any((step < low) | (step > high)):
            root = np.linalg.cholesky(normal + np.diag(weight + 1e-12 * np.diag(normal).max()))
            right = np.linalg.solve(root, gradient)
            ends = np.minimum(low, 0.0), np.maximum(high, 0.0) + 1e-300
            step = np.clip(held_inside(np.asarray(root.T, dtype=float), right, *ends), low, high)
        after = self.residual + slope @ step
        return step, float(self.residual @ self.residual - after @ after)

    def _bent(self, slope: Array, step: Array, trial: Array, there: Array) -> tuple[Array, Array]:
        """Where a step that has failed leads if it is bent with the valley; where it led, if that is better.

        It takes half the acceleration along the step: with the second difference r'' = 2 off that is
        -(J'J + damping)^-1 J' r'' (Transtrum & Sethna 2012, arXiv:1201.5885). One that is longer than the step itself
        is not trusted.
        """
        off, normal = there - self.residual - slope @ step, slope.T @ slope
        weight = self.damping * np.maximum(np.diag(normal), 1e-12)
        turn = -_solve(normal + np.diag(weight), slope.T @ off)
        length, most = float(np.linalg.norm(turn)), float(np.linalg.norm(step))
        turn = turn * min(1.0, most / length) if length > 0 else turn
        other, beside = self.at(self.theta + (step + turn) * self.size)
        return (trial, there) if beside is None or beside @ beside > there @ there else (other, beside)

    def _further(self, theta: Array, trial: Array, there: Array) -> tuple[Array, Array]:
        """Go on in the direction of a good damped step while it pays: a valley costs residuals, no Jacobians."""
        reach = 2.0
        # 8: of a step that keeps paying
        for _ in range(8):
            beyond, residual = self.at(theta + reach * (trial - theta))
            if residual is None or residual @ residual >= there @ there:
                break
            theta, trial, there = trial, beyond, residual
        return trial, there


def _solve(matrix: Array, right: Array) -> Array:
    root = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled = matrix / np.outer(root, root)
    try:
        return np.linalg.solve(scaled + 1e-14 * np.eye(root.size), right / root) / root
    except np.linalg.LinAlgError:
        return np.linalg.lstsq(scaled, right / root, rcond=1e-12)[0] / root


def finite(array: Array, what: str = "values") -> Array:
    """The array, of which every number must be finite."""
    if not np.all(np.isfinite(array)):
        raise ComputationError(f"the model gives {what} that are not finite")
    return array
