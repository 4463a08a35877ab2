"""The last steps of a fit: to the minimum itself, whatever unit its chi-square is counted in.

Levenberg-Marquardt steps (Marquardt 1963; damped in units of the Jacobian's columns, Moré 1978) with the
second-order correction of geodesic acceleration (Transtrum & Sethna 2012, arXiv:1201.5885), which follows a valley
that bends. Derivatives are of fourth order, with steps that change the predictions by a fixed share whatever the
size of a parameter. Steps end where the residual is orthogonal to everything that the parameters can do (the
relative offset of Bates & Watts 1981), which is no matter of how uncertain the data are said to be.
"""

from __future__ import annotations

import numpy as np

from specan.errors import ComputationError
from specan.study.estimation.levenberg_marquardt import STEP_TOLERANCE, Minimum, finite_residual, unit
from specan.study.estimation.problem import Problem
from specan.study.observation import Array

SHARE = 1e-4  # of all predictions, by which a step of a derivative changes them: rounding then errs by 1e-12
MOST_OF_ITSELF = 1e-3  # of a parameter's size, which a step does not exceed
ORTHOGONAL = 1e-16  # share of chi-square that another step may still promise
ROUNDED = 1e-10  # share of chi-square below which rounding hides whether a step lowers it
ROUNDING = 1e-14  # of chi-square, that a sum over some hundred rows may be off by
UNDETERMINED = 1e-11  # of the largest singular value: directions that no step goes in
FAR = 1e-3  # share of chi-square promised, above which derivatives of second order do
MOST_JACOBIANS = 200  # of one refinement
MOST_DAMPED = 25  # tries of one step
REACH = 0.1  # of a step, at which its acceleration is measured
MOST_BEND = 0.75  # acceleration over velocity, both of a step that is trusted


def refine(problem: Problem, start: Array) -> tuple[Minimum, bool]:
    """Minimise the sum of squares of a problem's residual from a place near the minimum.

    Returns
    -------
    minimum : Minimum
        With a Jacobian of fourth order.
    settled : bool
        Whether another step promises less chi-square than a fit is taken to show.

    Raises
    ------
    ComputationError
        Not finite at the start.
    """
    descent = _Refinement(problem, start)
    before, promised, order = np.inf, descent.derive(2), 2
    for _ in range(MOST_JACOBIANS):
        if order == 2 and promised < FAR * descent.chi2:
            order, promised = 4, descent.derive(4)
        chi2 = descent.chi2
        moved = promised > ORTHOGONAL * chi2 and descent.step()
        gained = moved and descent.chi2 < chi2 * (1 - ROUNDING)
        if order == 4 and not (gained or (moved and promised <= ROUNDED * chi2 and promised <= before / 2)):
            break  # rounding, or the accuracy of the model, is reached
        order = order if gained else 4
        before, promised = promised, descent.derive(order)
    return descent.minimum(), promised < STEP_TOLERANCE * unit(problem, descent.chi2)


class _Refinement:
    """Where the steps stand: theta, the residual and Jacobian there, and the damping of the next step."""

    def __init__(self, problem: Problem, start: Array) -> None:
        self.problem = problem
        self.low, self.high = problem.bounds()
        self.theta = np.clip(start, self.low, self.high)
        residual = finite_residual(problem, self.theta)
        if residual is None:
            raise ComputationError("the model gives values that are not finite at the start of a fit")
        self.residual = residual
        self.damping = 0.0
        self.jacobian = _finite(problem.jacobian(self.theta))
        self.predicted = float(
            np.linalg.norm(problem.whiten(np.concatenate(problem.predictions(self.theta))))
        )

    @property
    def chi2(self) -> float:
        return float(self.residual @ self.residual)

    def minimum(self) -> Minimum:
        return Minimum(self.theta, self.residual, self.jacobian, self.chi2)

    def derive(self, order: int) -> float:
        """Derive at theta; the fall in chi-square that an undamped step promises."""
        self.jacobian = _finite(self.problem.jacobian(self.theta, self._steps(), order))
        uphill = self.jacobian.T @ self.residual
        held = ((self.theta <= self.low) & (uphill > 0)) | ((self.theta >= self.high) & (uphill < 0))
        self.moving = np.flatnonzero(~held & np.any(self.jacobian != 0, axis=0))
        slopes = self.jacobian[:, self.moving]
        self.norms = np.linalg.norm(slopes, axis=0)
        left, values, right = np.linalg.svd(slopes / self.norms, full_matrices=False)
        determined = values > UNDETERMINED * values.max(initial=0.0)
        self.left, self.values, self.right = left[:, determined], values[determined], right[determined]
        return float(np.sum((self.left.T @ self.residual) ** 2))

    def _steps(self) -> Array:
        """Steps of derivatives: such that each changes the predictions by the same share."""
        columns = np.linalg.norm(self.jacobian[: self.problem.n_data], axis=0)
        most = MOST_OF_ITSELF * np.maximum(self.problem.scale, np.abs(self.theta))
        share = SHARE * self.predicted / np.maximum(columns, 1e-300)
        return np.where(share > 0, np.minimum(share, most), most)

    def step(self) -> bool:
        """Take a step that does not raise chi-square, if there is one."""
        for _ in range(MOST_DAMPED):
            velocity = self._solve(self.residual)
            after = self.residual + self.jacobian @ velocity
            promised = self.chi2 - float(after @ after)
            near_the_end = promised < ROUNDED * self.chi2
            moved = velocity if near_the_end else self._bent(velocity)
            if moved is not None:
                theta = np.clip(self.theta + moved, self.low, self.high)
                residual = finite_residual(self.problem, theta)
                allowed = self.chi2 * (1 + 1e-3 * ROUNDED if near_the_end else 1.0)
                if residual is not None and residual @ residual <= allowed:
                    self.theta, self.residual = theta, residual
                    self.damping = self.damping / 10 if self.damping > 1e-12 else 0.0
                    return True
            if near_the_end:
                return False
            self.damping = max(4 * self.damping, 1e-6)
        return False

    def _solve(self, right: Array) -> Array:
        """Damped solution of J step = -right, zero for what is held."""
        step = np.zeros(self.theta.size)
        damped = self.values * (self.left.T @ right) / (self.values**2 + self.damping)
        step[self.moving] = -(self.right.T @ damped) / self.norms
        return step

    def _bent(self, velocity: Array) -> Array | None:
        """The step with half its acceleration, from the second difference along it; None where that is too large."""
        near = finite_residual(self.problem, np.clip(self.theta + REACH * velocity, self.low, self.high))
        if near is None:
            return None
        turn = 2 / REACH * ((near - self.residual) / REACH - self.jacobian @ velocity)
        acceleration = self._solve(turn)
        length = np.linalg.norm(self.norms * velocity[self.moving])
        if np.linalg.norm(self.norms * acceleration[self.moving]) > MOST_BEND * length:
            return None
        return velocity + acceleration / 2


def _finite(array: Array) -> Array:
    if not np.all(np.isfinite(array)):
        raise ComputationError("the model gives derivatives that are not finite")
    return array
