"""R6: the air is warmer or colder than assumed."""

from specan.models import Parameter, effect


@effect(
    "temperature",
    adds_to="air_temperature",
    neutral={"offset": 0.0},
    aliases=("dimension-error",),
    separate_by="a thermometer",
    reference="ISO 9613-1:1993, annex A: c = 343.2 sqrt(T / 293.15)",
    instrument=True,
)
def temperature(
    *, offset=Parameter(1.0, "K", min=-10.0, max=10.0, lower=-30.0, upper=30.0, doc="true less nominal")
):
    """All natural frequencies change by the same factor, 0.17 % per kelvin, as in a room of another size."""
    return offset
