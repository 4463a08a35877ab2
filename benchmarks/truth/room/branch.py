"""What moves in or behind a wall: mass, resistance and spring in series, one equation of motion each.

Their velocity v into the wall obeys ``m dv/dt + R v + s u = p`` with ``du/dt = v``; all per unit area. A sheet under
tension T feels ``- T laplace(u)`` beside ``s u``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from truth.room.box import Box, Disc
from truth.room.line import Real


@dataclass(frozen=True)
class Motion:
    """Mass, resistance and stiffness per unit area: kg/m^2, Pa s/m, Pa/m."""

    mass: float
    resistance: float
    stiffness: float

    def spread_over(self, share: float) -> Motion:
        """The same on a part of a wall, as seen by sound that is much longer than the gaps."""
        return Motion(self.mass / share, self.resistance / share, self.stiffness / share)


@dataclass(frozen=True)
class Lining:
    """A whole wall that gives way: each point on its own (locally reacting), or as a sheet under tension.

    Attributes
    ----------
    tension : float
        N/m; the sheet's edges are free.
    """

    wall: str
    motion: Motion
    tension: float = 0.0


@dataclass(frozen=True)
class Plug:
    """A disc in a wall that moves as one: the air in the neck of a resonator or in an opening."""

    disc: Disc
    motion: Motion


class Branch:
    """A lining or a plug while time runs; the velocity lives half a step after the pressure."""

    def __init__(self, box: Box, part: Lining | Plug, step_s: float) -> None:
        self._motion, self._step = part.motion, step_s
        self.gather: Real | None = None
        self._bending: Callable[[Real], Real] | None = None
        if isinstance(part, Lining):
            self.nodes, self.area = box.face(part.wall)
            if part.tension:
                self._bending = partial(box.minus_laplacian_on, part.wall)
                self._tension = part.tension
        else:
            self.nodes, _ = box.face(part.disc.wall)
            basis, weights = box.disc(part.disc)
            self.gather = weights @ basis / part.disc.area_m2
            self.area = part.disc.area_m2 * self.gather
        n = len(self.nodes) if self.gather is None else 1
        self._velocity, self._way = np.zeros(n), np.zeros(n)

    def volume_acceleration(self, pressure: Real) -> Real:
        """Advance by one step under the nodal pressure; volume acceleration that leaves the room at each node.

        The resistance acts on the mean of the old and the new velocity, so that the step is centred.
        """
        driving = pressure[self.nodes]
        if self.gather is not None:
            driving = np.atleast_1d(self.gather @ driving)
        motion, step = self._motion, self._step
        half = 0.5 * step * motion.resistance / motion.mass
        back = motion.stiffness * self._way
        if self._bending is not None:
            back = back + self._tension * self._bending(self._way)
        force = (driving - back) / motion.mass
        velocity = ((1.0 - half) * self._velocity + step * force) / (1.0 + half)
        acceleration = (velocity - self._velocity) / step
        self._velocity = velocity
        self._way = self._way + step * velocity
        return self.area * acceleration
