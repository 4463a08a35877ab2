"""What would determine the walls that a measurement left open: further microphones, or a covered wall.

Nothing is simulated: the information matrix of what is measured plus that of what could be, at the admittances
that were found, gives the uncertainty that would be left.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from specan.result import gathered
from specan.room.model.places import free_places, receivers_of, with_microphones
from specan.room.study import receiver_places
from specan.room.study.field_observation import field_observations
from specan.room.wall_impedance.surface_impedance import ALL, Impedance
from specan.room.wall_impedance.wall_admittance import WallFit, WallProblem
from specan.study.observation import Array

MICROPHONES = 4  # that are proposed together


def advise(found: Impedance) -> list[dict[str, Any]]:
    """Which further microphones, and which covered wall, would determine what is open; nothing if nothing is.

    Of each: its kind (``positions`` or ``cover-wall``), the places of further microphones, the wall that would be
    covered, what would be determined and is not, how many wall-bands are not, and all that in words.
    """
    goal = _Goal.of(found)
    if not goal.names:
        return []
    problem, theta = found.fit.problem, found.fit.at(found.fit.beta)
    jacobian = problem.jacobian(theta)
    known = jacobian.T @ jacobian
    box = receivers_of(problem.assembly.model).box
    further = [] if box is None else [_further_microphones(problem, theta, known, goal)]
    return [*further, _covered_wall(found.fit, known, goal)]


@dataclass(frozen=True, eq=False)
class _Goal:
    """Wall-bands that are open: their place in theta, and the standard error they need."""

    names: list[tuple[str, float]]
    places: list[int]
    needed: float

    @classmethod
    def of(cls, found: Impedance) -> _Goal:
        fit, open_ = found.fit, found.table[~found.table["determined"] & (found.table["wall"] != ALL)]
        bands = np.argmin(np.abs(open_["mid_hz"].to_numpy()[:, None] - fit.mid_hz), axis=1)
        walls = [fit.walls.index(wall) for wall in open_["wall"]]
        places = (len(fit.theta) + np.array(walls, dtype=int) * len(fit.mid_hz) + bands).tolist()
        needed = found.accuracy / (4 * 1.96) / np.sqrt(max(fit.reduced_chi2, 1.0))
        return cls(list(zip(open_["wall"], open_["third_octave_hz"], strict=True)), places, needed)

    def short(self, information: Array) -> Array:
        """By how much, in logarithms, the errors that an information matrix leaves are too large."""
        errors = np.sqrt(np.diag(np.linalg.inv(information))[self.places])
        return np.maximum(np.log(errors / self.needed), 0.0)

    def advice(self, kind: str, information: Array, what: str, **more: Any) -> dict[str, Any]:
        """What some measurement would determine."""
        reached = [name for name, lack in zip(self.names, self.short(information), strict=True) if lack <= 0]
        told = f"{what} would determine {len(reached)} of the {len(self.names)} undetermined wall-bands"
        each = gathered(reached).items()
        listed = "; ".join(f"{wall}: {', '.join(f'{f:g}' for f in bands)} Hz" for wall, bands in each)
        determines = [{"wall": wall, "third_octave_hz": f} for wall, f in reached]
        about = {"places_m": [], "wall": "", **more, "determines": determines, "open": len(self.names)}
        return {"kind": kind, **about, "text": told + (f" ({listed})" if listed else "")}


def _further_microphones(problem: WallProblem, theta: Array, known: Array, goal: _Goal) -> dict[str, Any]:
    """One place after the other, each the best beside those that are taken."""
    places = free_places(receivers_of(problem.assembly.model).rig)
    model, names = with_microphones(problem.assembly.model, places)
    wider = replace(problem, assembly=model.assemble(problem.assembly.uses))
    further = receiver_places.planned(field_observations(problem.observations)[0], names)
    each = [part.T @ part for part in receiver_places.by_receiver(*_seen(wider, further, theta))]
    chosen: list[int] = []
    for _ in range(min(MICROPHONES, len(places))):
        left = [k for k in range(len(places)) if k not in chosen]
        best = min(left, key=lambda k: float(goal.short(known + each[k]).sum()))
        chosen.append(best)
        known = known + each[best]
    taken = places[chosen].tolist()
    what = f"{len(taken)} further microphones at {', '.join(map(receiver_places.spoken_place, taken))}"
    return goal.advice("positions", known, what, places_m=taken)


def _seen(problem: WallProblem, observation: Any, theta: Array) -> tuple[Any, Array]:
    """What would be measured, with its errors in the field of theta, and its whitened derivatives."""
    seen = problem.uncertain(observation, theta)
    return seen, seen.whiten(problem.over([seen]).sensitivities(theta)[0])


def _covered_wall(fit: WallFit, known: Array, goal: _Goal) -> dict[str, Any]:
    """A wall behind a rigid board takes nothing: what changes was its own."""
    tried = []
    bands = len(fit.mid_hz)
    few = receiver_places.few_lines(field_observations(fit.problem.observations)[0])
    for number, wall in enumerate(fit.walls):
        beta = fit.beta.copy()
        beta[number] = 0.0
        _, slopes = _seen(fit.problem, few, fit.at(beta))
        for part in (0, 1):
            first = len(fit.theta) + part * beta.size + number * bands
            slopes[:, first : first + bands] = 0.0
        tried.append((wall, known + slopes.T @ slopes))
    wall, best = min(tried, key=lambda one: float(goal.short(one[1]).sum()))
    what = f"covering wall {wall} with a rigid board and recording once more"
    return goal.advice("cover-wall", best, what, wall=wall)
