"""Effects of the air in the room, and of its edges."""

import numpy as np

from specan.models import Parameter, effect


@effect(
    "temperature",
    adds_to="air_temperature",
    separate_by="a thermometer",
    reference="ISO 9613-1:1993, annex A: c = 343.2 sqrt(T / 293.15)",
    instrument=True,
)
def temperature(
    *, offset=Parameter(1.0, "K", min=-10.0, max=10.0, lower=-30.0, upper=30.0, doc="true less nominal")
):
    """All natural frequencies change by the same factor, 0.17 % per kelvin, as in a room of another size."""
    return np.squeeze(offset)  # a vector of one where every recording has its own


@effect(
    "air-absorption",
    adds_to="relative_humidity",
    separate_by="a hygrometer; the slope over frequency",
    reference="ISO 9613-1:1993, clause 6",
)
def air_absorption(
    *, humidity=Parameter(0.2, "1", min=-0.4, max=0.4, lower=-0.45, upper=0.49, doc="difference")
):
    """The air is drier or damper than the rig file says: attenuation changes, most at high frequencies."""
    return humidity


@effect(
    "dimension-error",
    scales="room_dimensions",
    at="dimension",
    aliases=("temperature", "wall-impedance", "leaning-wall", "scatterer"),
    separate_by="a tape measure; a thermometer",
    reference="k_x = n pi / L_x",
)
def dimension_error(
    *, error=Parameter(0.003, "1", min=-0.01, max=0.01, lower=-0.03, upper=0.03, doc="of the edge")
):
    """One edge is not as drawn: only modes with a number along that edge move."""
    return 1 + error
