"""R17: an object is in the room."""

import numpy as np

from specan.models import Parameter, effect
from specan.models.room.field import LocalLoad
from specan.models.room.port import Port, point


@effect(
    "scatterer",
    joins="local_loads",
    neutral={"volume": 0.0},
    aliases=("dimension-error",),
    separate_by="taking it out",
    reference="Morse & Ingard, Theoretical Acoustics, ch. 8: small rigid sphere, monopole and dipole",
)
def scatterer(
    frequency,
    density,
    sound_speed,
    room_origin,
    room_dimensions,
    *,
    volume=Parameter(1e-3, "m^3", min=1e-4, max=1e-2, lower=0.0, upper=2e-2, doc="of the object"),
    x=Parameter(0.35, "1", min=0.0, max=1.0, doc="place over the room's edge"),
    y=Parameter(0.35, "1", min=0.0, max=1.0, doc="place over the room's edge"),
    z=Parameter(0.35, "1", min=0.0, max=1.0, doc="place over the room's edge"),
):
    """A rigid object displaces air that would be compressed and moved: each mode shifts differently.

    A mode falls where the object is in a pressure node, and rises where it is in an antinode.
    """
    place = point(room_origin + np.array([x, y, z]) * room_dimensions)
    radius = float((3 * volume / (4 * np.pi)) ** (1 / 3)) or 1e-6
    omega = 2 * np.pi * frequency
    monopole = -1j * omega * volume / (density * sound_speed**2)
    dipole = -1.5 * volume / (1j * omega * density)
    return (
        LocalLoad(Port(place, 0, radius, ball=True), monopole),
        *(LocalLoad(Port(place, 0, radius, ball=True, slope=axis), dipole) for axis in range(3)),
    )
