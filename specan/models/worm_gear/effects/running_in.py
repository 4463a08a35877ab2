"""Wear that smooths a new gear."""

import numpy as np

from specan.models import Parameter, effect


@effect(
    "running-in",
    adds_to=("friction_coefficient", "no_load_loss"),
    neutral={"friction": 0.0, "drag": 0.0},
    needs=("elapsed_time",),
    separate_by="randomise the order of the measurements and repeat one reference point all along",
    reference="exponential approach of a wear process to its steady state (Niemann and Winter, "
    "Maschinenelemente III, on the running-in of worm gears); sizes and time are left free here",
)
def running_in(
    elapsed_time,
    worm_speed,
    *,
    friction=Parameter(
        0.005, "1", min=0.0, max=0.05, lower=-0.1, upper=0.3, doc="more of it between new flanks"
    ),
    drag=Parameter(0.02, "N*m", min=0.0, max=0.3, lower=-1.0, upper=5.0, doc="of seals at the start"),
    time=Parameter(5.0, "hour", min=0.2, max=100.0, lower=0.05, upper=500.0, doc="in which 63 % is gone"),
):
    """The bronze flanks of a new wheel adapt to the worm and the seal lips to the shaft: losses fall with time.

    The residual depends on time and not on torque, speed or temperature. If the conditions were run in
    order, it can look like any effect.
    """
    left = np.exp(-elapsed_time / time)
    return {"friction_coefficient": friction * left, "no_load_loss": drag * left * worm_speed}
