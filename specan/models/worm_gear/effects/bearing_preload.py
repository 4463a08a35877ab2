"""Bearings that are squeezed as the housing and the shafts grow."""

from specan.models import Parameter, effect


@effect(
    "bearing-preload",
    adds_to="no_load_loss",
    neutral={"growth": 0.0},
    aliases=("seal-drag", "torque-zero-error"),
    separate_by="runs without load over the whole range of temperatures",
    reference="linear thermal expansion of shaft against housing; both coefficients are left free here",
)
def bearing_preload(
    worm_speed,
    oil_temperature,
    *,
    growth=Parameter(5.0, "mN*m/K", min=-20.0, max=20.0, lower=-200.0, upper=200.0, doc="torque per kelvin"),
    free_temperature=Parameter(
        40.0,
        "degC",
        min=-20.0,
        max=120.0,
        lower=-20.0,
        upper=120.0,
        doc="at which there is none",
        needs=("indicated_oil_temperature",),
    ),
):
    """A shaft that expands more than its housing presses its bearings together; the drag follows temperature.

    M = k (theta - theta_0), at any load: T^0 n^1, a straight line over temperature where the viscous
    losses are curved.
    """
    return growth * (oil_temperature - free_temperature) * worm_speed
