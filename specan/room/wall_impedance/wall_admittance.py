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
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.errors import ComputationError, RequestError, SpecanError
from specan.models import Assembly, Parameter, Use, effect
from specan.room.model.known_walls import with_nothing_stated
from specan.study.estimation.continuation import down_weighted
from specan.study.estimation.problem import Problem
from specan.study.observation import Array
from specan.study.observation.frf import FrfObservation
from specan.study.selection.candidates import without

Complex = NDArray[np.complex128]

SPREAD = 1.0  # standard deviation of what an admittance may be before anything was measured
START = 0.03  # softer than most walls: peaks are wide, and a fit finds its way
CRUDE_SPREAD = 0.1
STEP = 1e-4  # of an admittance, for its derivative
LONGEST = 0.1  # that one step may change an admittance by
SETTLED = 1.0  # fall of chi-square below which a fit has ended; the quadratic about it does the rest
LEAST = -0.5  # real part: a wall that gives energy is not a wall, but the centre of an interval may lie there
MOST_STEPS = 25
ROUNDS = 2  # of fit and of linearising the common errors about it


@effect("free-walls", adds_to="wall_admittance", neutral={"spectrum": 0.0})
def free_walls(
    frequency,
    *,
    spectrum=Parameter(0.0, "1", lower=-np.inf, upper=np.inf, fixed=True, doc="array (walls, lines)"),
):
    """The admittance of all walls, line by line."""
    return spectrum


USE = Use("free-walls")


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
    theta, names : array, tuple of str
        The other parameters that were fitted.
    reduced_chi2 : float
        The covariance is widened by it where it exceeds one.
    space, state : Space, Point
        What was fitted, and where; to go on from.
    """

    walls: tuple[str, ...]
    mid_hz: Array
    beta: Complex
    covariance: Array
    theta: Array
    names: tuple[str, ...]
    reduced_chi2: float
    space: Space
    state: Point

    def of(self, wall: int, band: int) -> tuple[complex, Array]:
        """Admittance of one wall in one band, and the covariance (2, 2) of its real and imaginary part."""
        place = wall * len(self.mid_hz) + band
        both = [place, place + self.beta.size]
        return complex(self.beta[wall, band]), self.covariance[np.ix_(both, both)]


@dataclass(frozen=True, eq=False)
class Point:
    """A point in the space that is fitted over: the problem's own parameters, and the admittances."""

    theta: Array
    beta: Complex

    def moved(self, step: NDArray[np.floating]) -> Point:
        """Further by a step."""
        own, size = self.theta.size, self.beta.size
        change = step[own : own + size] + 1j * step[own + size :]
        beta = self.beta + change.reshape(self.beta.shape)
        return Point(self.theta + step[:own], np.maximum(beta.real, LEAST) + 1j * beta.imag)


def wall_fit(
    problem: Problem,
    start: Mapping[str, Any] | None = None,
    progress: Callable[[str], None] | None = None,
) -> WallFit:
    """Estimate the admittance of every wall in every third octave.

    Parameters
    ----------
    problem : Problem
        A room over recordings. What it says of the walls is put aside; its other effects stay.
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
    space = Space.of(problem, start or {})
    state = space.beginning()
    say("a first fit on few lines")
    state = space.crude().descend(state)
    for _ in range(ROUNDS):
        space = space.linearised(state)
        say("all lines, with everything that is uncertain")
        state = space.descend(state)
    return space.result(state)


@dataclass(frozen=True, eq=False)
class Space:
    """The problem without its walls, and a basis for them.

    Attributes
    ----------
    problem : Problem
        Its admittance is held at nothing.
    assembly : Assembly
        With `free_walls`.
    mid_hz : array
    spread : float
        Standard deviation of the prior of real and imaginary part.
    first : array
        Where the other parameters start.
    """

    problem: Problem
    assembly: Assembly
    mid_hz: Array
    spread: float
    first: Array

    @classmethod
    def of(cls, problem: Problem, start: Mapping[str, Any]) -> Space:
        """Take what a problem says of its walls out of it."""
        model = problem.assembly.model
        if "wall_admittance" not in model.quantities:
            raise RequestError(
                f"the model {model.name} has no walls",
                expected="a study of a room",
                remedy="see specan model list",
            )
        if not all(isinstance(o, FrfObservation) for o in problem.observations):
            raise RequestError("the study holds no recordings", expected="transfer functions of microphones")
        for use in problem.assembly.uses:
            if set(model.effects[use.name].changes) <= {"wall_admittance", "wall_data_error"}:
                problem = without(problem, use)
        problem = problem.holding({"wall_admittance.common": 0.0})
        model = with_nothing_stated(model)  # what is estimated can then be held against it
        problem = replace(problem, assembly=model.assemble(problem.assembly.uses))
        assembly = model.with_effect(free_walls).assemble({*problem.assembly.uses, USE})
        known = {n: v for n, v in start.items() if n not in problem.priors}
        lines = np.concatenate([o.conditions["frequency"] for o in problem.observations])
        return cls(problem, assembly, third_octaves(lines.min(), lines.max()), SPREAD, problem.start(known))

    @property
    def observations(self) -> tuple[FrfObservation, ...]:
        """Recordings."""
        return self.problem.observations  # type: ignore[return-value]

    @property
    def walls(self) -> tuple[str, ...]:
        """Names of the walls."""
        return tuple(self.assembly.model.axes["wall"])

    def beginning(self) -> Point:
        """All walls alike, everything else as certified."""
        return Point(self.first, np.full((len(self.walls), len(self.mid_hz)), START, dtype=complex))

    def values(self, observation: FrfObservation, state: Point) -> dict[str, Any]:
        """SI values of all parameters as an observation sees them."""
        spectrum = state.beta @ self._basis(observation)
        values = self.problem.seen_by(observation, self.problem.values_at(state.theta))
        return {**values, "free-walls.spectrum": spectrum}

    def _basis(self, observation: FrfObservation) -> Array:
        return spline_basis(observation.conditions_at_nodes["frequency"], self.mid_hz)

    # --- residual and derivative ------------------------------------------------------------------

    def residual(self, state: Point) -> Array:
        """Whitened differences of all recordings, then of the priors."""
        parts = [
            o.whiten(o.predict(self.assembly, self.values(o, state)) - o.measured) for o in self.observations
        ]
        return np.concatenate([*parts, self.prior(state)])

    def prior(self, state: Point) -> Array:
        """What goes against certificates, and against the wide prior of the admittances."""
        centred = (state.beta - START) / self.spread
        own = [(state.theta[k] - mean) / sd for k, (mean, sd) in self._certified.items()]
        return np.concatenate([own, centred.real.ravel(), centred.imag.ravel()])

    def jacobian(self, state: Point) -> Array:
        """Derivative of `residual`."""
        parts = [o.whiten(self.slopes(o, state)) for o in self.observations]
        free = 2 * state.beta.size
        certified = np.zeros((len(self._certified), state.theta.size + free))
        for row, (k, (_, sd)) in enumerate(self._certified.items()):
            certified[row, k] = 1 / sd
        wide = np.eye(free, state.theta.size + free, k=state.theta.size) / self.spread
        return np.concatenate([*parts, certified, wide])

    @cached_property
    def _certified(self) -> dict[int, tuple[float, float]]:
        """Place in theta of everything with a certificate, with its mean and standard uncertainty."""
        owners = [name.whole for name in self.problem.names]
        return {k: self.problem.priors[o] for k, o in enumerate(owners) if o in self.problem.priors}

    def slopes(self, observation: FrfObservation, state: Point) -> Array:
        """Derivative of an observation's prediction by theta, by real parts, by imaginary parts."""
        here = self.values(observation, state)
        basis = self._basis(observation)
        changes: list[tuple[str, Any, float]] = []
        for wall in range(len(self.walls)):
            moved = here["free-walls.spectrum"].copy()
            moved[wall] += STEP
            changes.append(("free-walls.spectrum", moved, STEP))
        for k, scale in enumerate(self.problem.scale):
            theta = state.theta.copy()
            theta[k] += 1e-3 * scale
            name = self.problem.names[k].whole
            value = self.problem.seen_by(observation, self.problem.values_at(theta))[name]
            changes.append((name, value, 1e-3 * scale))
        many = [here, *({**here, name: value} for name, value, _ in changes)]
        quantity = observation.quantity
        found = (
            e[quantity]
            for e in self.assembly.evaluate_many(observation.conditions_at_nodes, many, [quantity])
        )
        centre = next(found)
        slopes = [(one - centre) / step for one, (_, _, step) in zip(found, changes, strict=True)]
        by_line, others = slopes[: len(self.walls)], slopes[len(self.walls) :]
        walls = [observation.folding(slope * shape) for slope in by_line for shape in basis]
        own = [observation.folding(slope) for slope in others]
        columns = [*own, *walls, *(1j * c for c in walls)]
        return np.stack([rows_of(observation, c) for c in columns], axis=1)

    # --- descent ----------------------------------------------------------------------------------

    def descend(self, state: Point) -> Point:
        """Levenberg-Marquardt steps, none longer than `LONGEST` in any admittance."""
        residual, damping = self.residual(state), 1e-4
        cost = float(residual @ residual)
        for _ in range(MOST_STEPS):
            jacobian = self.jacobian(state)
            normal, slope = jacobian.T @ jacobian, jacobian.T @ residual
            while True:
                step = -np.linalg.solve(normal + damping * np.diag(np.diag(normal)), slope)
                step *= min(1.0, LONGEST / np.max(np.abs(step[state.theta.size :])))
                tried = state.moved(step)
                after = self._tried(tried)
                fall = cost - (np.inf if after is None else float(after @ after))
                if fall > 0 or damping > 1e8:
                    break
                damping = 10 * max(damping, 1e-7)
            if after is None or fall <= 0:
                return state
            state, residual, cost, damping = tried, after, cost - fall, damping / 30
            if fall < SETTLED:
                return state
        if fall > 1e-4 * cost:
            raise ComputationError(
                "the fit of the walls does not converge",
                remedy="look whether the rig file describes the room, with specan study compare",
            )
        return state

    def _tried(self, state: Point) -> Array | None:
        try:
            found = self.residual(state)
        except SpecanError:  # walls for which the room has no clear modes: a shorter step
            return None
        return found if np.all(np.isfinite(found)) else None

    def crude(self) -> Space:
        """The same on few lines, seen without windows, all equally uncertain."""
        return replace(self, problem=down_weighted(self.problem), spread=CRUDE_SPREAD)

    def linearised(self, state: Point) -> Space:
        """The same with places, calibration and discrepancy as they act on the field that was found."""
        return replace(self, problem=self.problem.over([self.uncertain(o, state) for o in self.observations]))

    def uncertain(self, observation: FrfObservation, state: Point) -> FrfObservation:
        """With its common errors where they act on the field that was found."""
        return observation.about(self.assembly, self.values(observation, state))

    def result(self, state: Point) -> WallFit:
        """The quadratic about a minimum: its centre may lie where a wall would give energy."""
        jacobian, residual = self.jacobian(state), self.residual(state)
        covariance = np.asarray(np.linalg.inv(jacobian.T @ jacobian))
        step = -covariance @ (jacobian.T @ residual)
        own, size = state.theta.size, state.beta.size
        change = step[own : own + size] + 1j * step[own + size :]
        n = self.problem.n_effective
        reduced = float(residual @ residual) / max(n + len(self.problem.priors) - own, 1.0)
        return WallFit(
            self.walls,
            self.mid_hz,
            state.beta + change.reshape(state.beta.shape),
            covariance[own:, own:] * max(reduced, 1.0),
            state.theta + step[:own],
            self.problem.names,
            reduced,
            self,
            state,
        )


def rows_of(observation: FrfObservation, response: Complex) -> Array:
    """A response (microphones, lines) as the observation's rows."""
    return np.concatenate([response.real[observation.kept], response.imag[observation.kept]])


def third_octaves(low_hz: float, high_hz: float) -> Array:
    """Exact mid-band frequencies of third octaves, from the last below a band to the first above it (IEC 61260-1).

    Examples
    --------
    >>> third_octaves(101.0, 199.0).round(1).tolist()
    [100.0, 125.9, 158.5, 199.5]
    """
    place = 10 * np.log10(np.array([low_hz, high_hz]) / 1000)
    first, last = int(np.floor(place[0] + 1e-9)), int(np.ceil(place[1] - 1e-9))
    return np.asarray(1000 * 10.0 ** (np.arange(first, last + 1) / 10))


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
