"""The sound field of a room with a vibrating piston in one of its walls."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from specan.api.studies import Study
    from specan.room.wall_impedance.surface_impedance import Impedance

__all__ = ["impedance"]


def impedance(
    study: Study,
    wall: str | None = None,
    *,
    accuracy: float = 0.1,
    progress: Callable[[str], None] | None = None,
) -> Impedance:
    """Surface impedance and absorption of every wall of a room, per third octave.

    Parameters
    ----------
    study : Study
        Of a room.
    wall : str, optional
        This wall alone: ``x0``, ``x1``, ``y0`` ...
    accuracy : float
        Half-width of the 95 % interval up to which absorption counts as determined.
    progress : callable, optional
        Told in a few words what is being done.

    Returns
    -------
    Impedance
        One row for each wall and third octave, with 95 % intervals.

    Raises
    ------
    RequestError
        The study is of no room, or the room has no such wall.
    """
    from specan.room.wall_impedance.surface_impedance import study_impedance

    found = study_impedance(study.opened, accuracy, progress)
    return found if wall is None else found.only(wall)
