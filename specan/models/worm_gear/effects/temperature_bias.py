"""A thermometer that errs."""

from specan.models import Parameter, effect


@effect(
    "temperature-bias",
    adds_to="oil_temperature",
    neutral={"bias": 0.0},
    aliases=("churning",),
    separate_by="a second thermometer, at another place in the sump",
    reference="additive error of a resistance thermometer and its place; 2 K is usual in a stirred sump",
    instrument=True,
)
def temperature_bias(
    *,
    bias=Parameter(
        1.0, "K", min=-2.0, max=2.0, lower=-30.0, upper=30.0, doc="indicated less true temperature"
    ),
):
    """The thermometer does not show the temperature of the oil.

    Every viscous loss is scaled by nearly the same factor, which a fitted no-load loss can reproduce. With
    a free churning power the effect is hardly ever visible.
    """
    return -bias
