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
    reference="Morse & Ingard, Theoretical Acoustics, ch. 8: monopole and dipole; Lamb, Hydrodynamics, 114: ellipsoid",
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
    length_x=Parameter(1.0, "1", min=0.5, max=2.0, lower=0.2, upper=5.0, doc="along x, over volume^(1/3)"),
    length_y=Parameter(1.0, "1", min=0.5, max=2.0, lower=0.2, upper=5.0, doc="along y, over volume^(1/3)"),
):
    """A rigid object displaces air that would be compressed and moved: each mode shifts differently.

    A mode falls where the object is in a pressure node, and rises where it is in an antinode. Air that moves along an
    axis flows around the ellipsoid of the object's proportions as if its volume were ``1 / (1 - L)`` times as large, with
    the depolarisation factor L of that axis: 3/2 for a ball.
    """
    place = point(room_origin + np.array([x, y, z]) * room_dimensions)
    radius = float((3 * volume / (4 * np.pi)) ** (1 / 3)) or 1e-6
    omega = 2 * np.pi * frequency
    monopole = -1j * omega * volume / (density * sound_speed**2)
    # The field that a ball adds to its own slope makes 3/2 of one; another object has another share of its own field.
    around = 1 / (1 - _depolarisation(length_x, length_y, 1 / (length_x * length_y)))
    dipoles = -volume / (1j * omega * density) * (around / (1 + around / 3))[:, None]
    return (
        LocalLoad(Port(place, 0, radius, ball=True), monopole),
        *(LocalLoad(Port(place, 0, radius, ball=True, slope=k), dipole) for k, dipole in enumerate(dipoles)),
    )


def _depolarisation(*axes):
    """``L_i = (a b c / 2) int_0^inf ds / ((s + a_i^2) sqrt((s + a^2)(s + b^2)(s + c^2)))`` by Carlson's R_D."""
    from scipy.special import elliprd

    a, b, c = np.square(axes)
    return np.prod(axes) / 3 * np.array([elliprd(b, c, a), elliprd(c, a, b), elliprd(a, b, c)])
