"""R5: the air takes more, or less, than assumed."""

from specan.models import Parameter, effect


@effect(
    "air-absorption",
    adds_to="relative_humidity",
    neutral={"humidity": 0.0},
    aliases=("wall-impedance",),
    separate_by="a hygrometer; the slope over frequency",
    reference="ISO 9613-1:1993, clause 6",
)
def air_absorption(
    *, humidity=Parameter(0.2, "1", min=-0.4, max=0.4, lower=-0.45, upper=0.49, doc="difference")
):
    """The air is drier or damper than the rig file says: attenuation changes, most at high frequencies."""
    return humidity
