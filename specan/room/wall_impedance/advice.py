"""What would determine the walls that a measurement left open: further microphones, or a covered wall.

Nothing is simulated: the information matrix of what is measured plus that of what could be, at the admittances
that were found, gives the uncertainty that would be left.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from specan.result import gathered, picked
from specan.room.model.places import free_places, with_microphones
from specan.room.model.receivers import receivers_of
from specan.room.study.field_observation import field_observations
from specan.room.study.receiver_places import (
    by_receiver,
    few_lines,
    planned,
    spoken_place,
)
from specan.room.wall_impedance.surface_impedance import Impedance
from specan.room.wall_impedance.wall_admittance import WallFit, WallProblem
from specan.study.observation import Array

MICROPHONES = 4  # that are proposed together


@dataclass(frozen=True)
class Advice:
    """A measurement that would help, and what it would tell.

    Attributes
    ----------
    kind : str
        ``positions`` or ``cover-wall``.
    places_m : tuple
        Of further microphones.
    wall : str
        That would be covered.
    determines : tuple of (wall, nominal Hz)
        What would be determined and is not.
    of : int
        How many wall-bands are not.
    """

    kind: str
    places_m: tuple[tuple[float, ...], ...]
    wall: str
    determines: tuple[tuple[str, float], ...]
    of: int

    @property
    def text(self) -> str:
        """In words."""
        count = len(self.determines)
        told = f"would determine {count} of the {self.of} undetermined wall-bands"
        told += f" ({_listed(self.determines)})" if count else ""
        if self.kind == "positions":
            where = ", ".join(spoken_place(p) for p in self.places_m)
            return f"{len(self.places_m)} further microphones at {where} {told}"
        return f"covering wall {self.wall} with a rigid board and recording once more {told}"

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        found = picked(self, "kind places_m wall determines open=of text")
        return found | {"determines": [{"wall": w, "third_octave_hz": f} for w, f in self.determines]}


def _listed(found: tuple[tuple[str, float], ...]) -> str:
    return "; ".join(f"{w}: {', '.join(f'{b:g}' for b in bands)} Hz" for w, bands in gathered(found).items())


def advise(found: Impedance) -> tuple[Advice, ...]:
    """Which further microphones, and which covered wall, would determine what is open; nothing if nothing is."""
    goal = _Goal.of(found)
    if not goal.places.size:
        return ()
    problem, theta = found.fit.problem, found.fit.at(found.fit.beta)
    jacobian = problem.jacobian(theta)
    known = jacobian.T @ jacobian
    box = receivers_of(problem.assembly.model).box
    further = () if box is None else (_further_microphones(problem, theta, known, goal),)
    return (*further, _covered_wall(found.fit, known, goal))


@dataclass(frozen=True, eq=False)
class _Goal:
    """Wall-bands that are open: their place among the admittances, and the standard error they need."""

    names: tuple[tuple[str, float], ...]
    places: Array
    needed: float
    own: int

    @classmethod
    def of(cls, found: Impedance) -> _Goal:
        fit = found.fit
        names, places = [], []
        for row in found.rows:
            if row.wall in fit.walls and not row.determined:
                band = int(np.argmin(np.abs(fit.mid_hz - row.mid_hz)))
                names.append((row.wall, row.third_octave_hz))
                places.append(fit.walls.index(row.wall) * len(fit.mid_hz) + band)
        needed = found.accuracy / (4 * 1.96) / np.sqrt(max(fit.reduced_chi2, 1.0))
        return cls(tuple(names), np.array(places, dtype=int), needed, len(fit.theta))

    def errors(self, information: Array) -> Array:
        """Standard errors that an information matrix leaves."""
        index = self.own + self.places
        return np.sqrt(np.diag(np.linalg.inv(information))[index])

    def shortfall(self, information: Array) -> float:
        """By how much, in logarithms, the errors together are too large."""
        return float(np.sum(np.maximum(np.log(self.errors(information) / self.needed), 0.0)))

    def reached(self, information: Array) -> tuple[tuple[str, float], ...]:
        """What would be determined."""
        enough = self.errors(information) <= self.needed
        return tuple(name for name, ok in zip(self.names, enough, strict=True) if ok)


def _further_microphones(problem: WallProblem, theta: Array, known: Array, goal: _Goal) -> Advice:
    """One place after the other, each the best beside those that are taken."""
    places = free_places(receivers_of(problem.assembly.model).rig)
    model, names = with_microphones(problem.assembly.model, places)
    wider = replace(problem, assembly=model.assemble(problem.assembly.uses))
    further = planned(field_observations(problem.observations)[0], names)
    each = [part.T @ part for part in by_receiver(*_seen(wider, further, theta))]
    chosen: list[int] = []
    for _ in range(min(MICROPHONES, len(places))):
        left = [k for k in range(len(places)) if k not in chosen]
        best = min(left, key=lambda k: goal.shortfall(known + each[k]))
        chosen.append(best)
        known = known + each[best]
    taken = tuple(tuple(float(x) for x in places[k]) for k in chosen)
    return Advice("positions", taken, "", goal.reached(known), len(goal.names))


def _seen(problem: WallProblem, observation: Any, theta: Array) -> tuple[Any, Array]:
    """What would be measured, with its errors in the field of theta, and its whitened derivatives."""
    seen = problem.uncertain(observation, theta)
    return seen, seen.whiten(problem.over([seen]).sensitivities(theta)[0])


def _covered_wall(fit: WallFit, known: Array, goal: _Goal) -> Advice:
    """A wall behind a rigid board takes nothing: what changes was its own."""
    tried = []
    bands = len(fit.mid_hz)
    few = few_lines(field_observations(fit.problem.observations)[0])
    for number, wall in enumerate(fit.walls):
        beta = fit.beta.copy()
        beta[number] = 0.0
        _, slopes = _seen(fit.problem, few, fit.at(beta))
        for part in (0, 1):
            first = goal.own + part * beta.size + number * bands
            slopes[:, first : first + bands] = 0.0
        both = known + slopes.T @ slopes
        tried.append(
            (goal.shortfall(both), Advice("cover-wall", (), wall, goal.reached(both), len(goal.names)))
        )
    return min(tried, key=lambda pair: pair[0])[1]
