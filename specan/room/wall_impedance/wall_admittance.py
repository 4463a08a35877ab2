"""The walls' admittance as a free function of frequency: what recordings of a room say about it by themselves.

Every wall of a box has a complex specific admittance ``beta = rho c / Z`` at the mid-band frequency of every
third octave, with a cubic spline over the logarithm of frequency in between; nothing else is assumed of its
course. All walls are estimated together with the instruments' errors, the state of the air and the room's
edges, each held by its certificate, so that an interval of one wall allows for all of these.

A transfer function is a holomorphic function of the admittance, line by line. One evaluation a wall therefore
gives the derivatives by all of its parameters, real and imaginary, whatever their number.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from specan.arrays import Complex
from specan.dsp.bands import mid_frequencies
from specan.errors import ComputationError, RequestError
from specan.models import Parameter, effect
from specan.models.model import Model
from specan.models.quantity import constant
from specan.study.estimation.continuation import continuation_fit
from specan.study.estimation.fit import describe
from specan.study.estimation.levenberg_marquardt import NotSettledError, descend
from specan.study.estimation.problem import Problem
from specan.study.observation import Array
from specan.study.observation.frf import FrfObservation
from specan.study.selection.candidates import without

SPREAD = 1.0  # standard deviation of what an admittance may be before anything was measured
START = 0.03  # softer than most walls: peaks are wide, and a fit finds its way
CRUDE_SPREAD = 0.1
STEP = 1e-4  # of an admittance, for its derivative
LEAST = -0.5  # real part: a wall that gives energy is not a wall, but the centre of an interval may lie there
NEAR = 1e-4  # of chi-square that a step may still promise where a descent is given up
ROUNDS = 2  # of fit and of linearising the common errors about it


@effect("free-walls", adds_to="wall_admittance", neutral={"conductance": 0.0, "susceptance": 0.0})
def free_walls(
    frequency,
    free_band_hz,
    *,
    conductance=Parameter(START, "1", lower=LEAST, upper=np.inf, per="wall_band", doc="rho c / Z, real"),
    susceptance=Parameter(0.0, "1", lower=-np.inf, upper=np.inf, per="wall_band", doc="rho c / Z, imaginary"),
):
    """The admittance of all walls in all third octaves."""
    beta = np.asarray(conductance + 1j * susceptance).reshape(-1, len(free_band_hz))
    return beta @ spline_basis(frequency, free_band_hz)


REAL, IMAGINARY = "free-walls.conductance", "free-walls.susceptance"
CENTRES = {REAL: START, IMAGINARY: 0.0}  # of the priors


@dataclass(frozen=True, eq=False)
class WallFit:
    """Admittances of all walls, and how well they are known.

    Attributes
    ----------
    walls : tuple of str
    mid_hz : array (bands,)
        Exact mid-band frequencies of the third octaves.
    beta : complex array (walls, bands)
        Best admittance; where a wall is not determined it may be negative.
    covariance : array (2 walls bands, 2 walls bands)
        Of the real parts of `beta`, wall by wall, then of the imaginary parts.
    theta : array
        The other parameters that were fitted.
    reduced_chi2 : float
        The covariance is widened by it where it exceeds one.
    problem : WallProblem
        What was fitted, to go on from.
    """

    walls: tuple[str, ...]
    mid_hz: Array
    beta: Complex
    covariance: Array
    theta: Array
    reduced_chi2: float
    problem: WallProblem

    def mean(self, share: Array, band: int) -> tuple[complex, Array]:
        """Weighted mean of the walls' admittances in one band, and the covariance (2, 2) of its parts."""
        places = np.arange(len(self.walls)) * len(self.mid_hz) + band
        weights = np.zeros((2, len(self.covariance)))
        weights[0, places] = weights[1, places + self.beta.size] = share
        return complex(share @ self.beta[:, band]), weights @ self.covariance @ weights.T

    def at(self, beta: Complex) -> Array:
        """Theta of `problem` with these admittances."""
        return np.concatenate([self.theta, beta.real.ravel(), beta.imag.ravel()])


def wall_fit(
    problem: Problem,
    start: Mapping[str, Any] | None = None,
    progress: Callable[[str], None] | None = None,
) -> WallFit:
    """Estimate the admittance of every wall in every third octave.

    Parameters
    ----------
    problem : Problem
        A room over recordings. What it says of the walls is ignored; its other effects stay.
    start : mapping, optional
        SI values of other effects to start from; what has a certificate starts there.
    progress : callable, optional
        Told in words what is done.

    Raises
    ------
    RequestError
        The problem is not a room, or its data are no recordings.
    ComputationError
        The fit does not converge.
    """
    say = progress or (lambda text: None)
    free = WallProblem.of(problem)
    known = {n: v for n, v in (start or {}).items() if n not in free.priors}
    say("a first fit on few lines")
    crude = replace(free, priors={**free.priors, **_priors(CRUDE_SPREAD)})
    theta = free.start(continuation_fit(crude, [known]))
    for _ in range(ROUNDS):
        free = replace(free, observations=tuple(free.uncertain(o, theta) for o in free.observations))
        say("all lines, with everything that is uncertain")
        theta = _lowest(free, theta)
    best = describe(free, theta)
    own = len(best.theta) - 2 * len(free.walls) * len(free.mid_hz)
    real, imaginary = best.theta[own:].reshape(2, len(free.walls), -1)
    return WallFit(
        free.walls,
        free.mid_hz,
        real + 1j * imaginary,
        best.covariance[own:, own:] * max(best.reduced_chi2, 1.0),
        best.theta[:own],
        best.reduced_chi2,
        free,
    )


def _priors(spread: float) -> dict[str, tuple[float, float]]:
    return {name: (centre, spread) for name, centre in CENTRES.items()}


def _lowest(problem: Problem, theta: Array) -> Array:
    try:
        return descend(problem, theta).theta
    except NotSettledError as fault:
        reached = fault.reached
        left = reached.residual - reached.jacobian @ np.linalg.lstsq(reached.jacobian, reached.residual)[0]
        if reached.chi2 - left @ left > NEAR * reached.chi2:
            raise ComputationError(
                "the fit of the walls does not converge",
                remedy="check with specan study compare whether the rig file describes the room",
            ) from None
        return reached.theta  # a valley that bends: the quadratic about the place does the rest


@dataclass(frozen=True, eq=False)
class WallProblem(Problem):
    """A problem whose walls are free; they are the last elements of theta, all real parts, then all imaginary ones."""

    @classmethod
    def of(cls, problem: Problem) -> WallProblem:
        """Take what a problem says of its walls out of it, and free them."""
        model = problem.assembly.model
        if not all(isinstance(o, FrfObservation) for o in problem.observations):
            raise RequestError("the study holds no recordings", expected="transfer functions of microphones")
        for use in problem.assembly.uses:
            if set(model.effects[use.name].changes) <= {"wall_admittance", "wall_data_error"}:
                problem = without(problem, use)
        problem = problem.holding({"wall_admittance.common": 0.0})
        lines = np.concatenate([o.conditions["frequency"] for o in problem.observations])
        model = with_free_walls(model, third_octaves(lines.min(), lines.max()))
        as_given = {part.name: getattr(problem, part.name) for part in fields(problem)}
        freed = {
            "assembly": model.assemble({*problem.assembly.uses, "free-walls"}),
            "free": (*problem.free, *CENTRES),
            "priors": {**problem.priors, **_priors(SPREAD)},
        }
        return cls(**{**as_given, **freed})

    @property
    def walls(self) -> tuple[str, ...]:
        """Names of the walls."""
        return tuple(self.assembly.model.axes["wall"])

    @property
    def mid_hz(self) -> Array:
        """Exact mid-band frequencies of the third octaves."""
        return np.asarray(self.assembly.model.quantities["free_band_hz"]())

    def uncertain(self, observation: Any, theta: Array) -> Any:
        """With its common errors where they act on the field of theta."""
        return observation.about(self.assembly, self.seen_by(observation, self.values_at(theta)))

    def sensitivities(self, theta: Array, steps: Array | None = None, order: int = 2) -> list[Array]:
        """Derivatives of the predictions; those by the walls from one evaluation a wall."""
        values = self.values_at(theta)
        others = replace(self, free=self.free[: -len(CENTRES)], values=values)
        by_others = Problem.sensitivities(others, theta[: len(others.names)])
        return [
            np.column_stack([own, *self._by_walls(o, self.seen_by(o, values))])
            for o, own in zip(self.observations, by_others, strict=True)
        ]

    def _by_walls(self, observation: Any, here: Mapping[str, Any]) -> list[Array]:
        basis = spline_basis(observation.conditions_at_nodes["frequency"], self.mid_hz)
        steps = STEP * np.repeat(np.eye(len(self.walls)), len(basis), axis=1)
        many = [here, *({**here, REAL: here[REAL] + step} for step in steps)]
        evaluated = self.assembly.evaluate_many(observation.conditions_at_nodes, many, observation.quantities)
        centre, *moved = (one[observation.quantities[0]] for one in evaluated)
        slopes = [
            observation.folding((one - centre) / STEP * shape)[observation.kept]
            for one in moved
            for shape in basis
        ]
        return [np.concatenate([s.real, s.imag]) for s in (*slopes, *(1j * s for s in slopes))]


def with_free_walls(model: Model, mid_hz: Array) -> Model:
    """The model with walls of which nothing is stated, free in bands: what is found can be compared with statements."""
    bare = model.with_constants({"wall_tables": (), "known_walls": np.array([], dtype=int)})
    bands = constant("free_band_hz", mid_hz, "Hz", "Third octaves in which walls are free.")
    names = tuple(f"{wall} {f:.4g} Hz" for wall in model.axes["wall"] for f in mid_hz)
    return replace(
        bare,
        quantities={**bare.quantities, "free_band_hz": bands},
        axes={**bare.axes, "known_wall": (), "wall_band": names},
    ).with_effect(free_walls)


def third_octaves(low_hz: float, high_hz: float) -> Array:
    """Exact mid-band frequencies of third octaves, from the last below a band to the first above it (IEC 61260-1).

    Examples
    --------
    >>> third_octaves(101.0, 199.0).round(1).tolist()
    [100.0, 125.9, 158.5, 199.5]
    """
    place = 10 * np.log10(np.array([low_hz, high_hz]) / 1000)
    first, last = int(np.floor(place[0] + 1e-9)), int(np.ceil(place[1] - 1e-9))
    return mid_frequencies(np.arange(first, last + 1), 3)


def spline_basis(frequency_hz: Array, mid_hz: Array) -> Array:
    """Cubic splines over log frequency, one that is 1 at each mid-band frequency and 0 at the others.

    Examples
    --------
    >>> mid = third_octaves(100.0, 400.0)
    >>> spline_basis(mid, mid).round(9).tolist() == np.eye(len(mid)).tolist()
    True
    """
    from scipy.interpolate import CubicSpline

    at = np.log(np.clip(frequency_hz, mid_hz[0], mid_hz[-1]))
    if len(mid_hz) < 4:
        return np.stack([np.interp(at, np.log(mid_hz), one) for one in np.eye(len(mid_hz))])
    found: Array = CubicSpline(np.log(mid_hz), np.eye(len(mid_hz)))(at).T
    return found
