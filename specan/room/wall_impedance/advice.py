"""What would determine the walls that a measurement left open: further microphones.

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
from specan.room.wall_impedance.wall_admittance import WallProblem
from specan.study.observation import Array

MICROPHONES = 4  # that are proposed together


def advise(found: Impedance) -> list[dict[str, Any]]:
    """Further microphones that would determine more of the walls; empty where nothing is open, or no place is free.

    With their places, what would be determined and is not, how many wall-bands are not, and all that in words.
    """
    goal = _Goal.of(found)
    if not goal.names or receivers_of(found.fit.problem.assembly.model).box is None:
        return []
    problem, theta = found.fit.problem, found.fit.at(found.fit.beta)
    jacobian = problem.jacobian(theta)
    return [_further_microphones(problem, theta, jacobian.T @ jacobian, goal)]


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


def _further_microphones(problem: WallProblem, theta: Array, known: Array, goal: _Goal) -> dict[str, Any]:
    """One place after the other, each the best beside those that are taken."""
    places = free_places(receivers_of(problem.assembly.model).rig)
    model, names = with_microphones(problem.assembly.model, places)
    wider = replace(problem, assembly=model.assemble(problem.assembly.uses))
    further = receiver_places.planned(field_observations(problem.observations)[0], names)
    seen = wider.uncertain(further, theta)  # with its errors in the field of theta
    slopes = seen.whiten(wider.over([seen]).sensitivities(theta)[0])
    each = [part.T @ part for part in receiver_places.by_receiver(seen, slopes)]
    chosen: list[int] = []
    for _ in range(min(MICROPHONES, len(places))):
        left = [k for k in range(len(places)) if k not in chosen]
        best = min(left, key=lambda k: float(goal.short(known + each[k]).sum()))
        chosen.append(best)
        known = known + each[best]
    taken = places[chosen].tolist()
    reached = [name for name, lack in zip(goal.names, goal.short(known), strict=True) if lack <= 0]
    where = ", ".join(map(receiver_places.spoken_place, taken))
    by_wall = gathered(reached).items()
    listed = "; ".join(f"{wall}: {', '.join(f'{f:g}' for f in bands)} Hz" for wall, bands in by_wall)
    text = (
        f"{len(taken)} further microphones at {where} would determine {len(reached)} of the {len(goal.names)} "
        f"undetermined wall-bands" + (f" ({listed})" if listed else "")
    )
    determines = [{"wall": wall, "third_octave_hz": f} for wall, f in reached]
    return {"places_m": taken, "determines": determines, "open": len(goal.names), "text": text}
