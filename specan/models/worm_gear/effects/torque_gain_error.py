"""Gain errors of the torque sensors."""

from specan.models import Parameter, effect


@effect(
    "torque-gain-error",
    scales=("indicated_input_torque", "output_torque"),
    neutral={"input": 0.0, "output": 0.0},
    aliases=("tooth-friction",),
    separate_by="exchange the two sensors, or load both with a lever arm and weights",
    reference="multiplicative error of a sensor; 0.1 % to 0.5 % is usual",
    instrument=True,
)
def torque_gain_error(
    *,
    input=Parameter(
        0.3, "percent", min=-1.0, max=1.0, lower=-20.0, upper=20.0, doc="indicated over true, less 1"
    ),
    output=Parameter(
        0.3, "percent", min=-1.0, max=1.0, lower=-20.0, upper=20.0, doc="indicated over true, less 1"
    ),
):
    """A torque sensor reads some parts in a thousand too high.

    The loss is the small difference of two large torques, so a gain error changes it many times more. It is
    proportional to the torque and looks like a change of the coefficient of friction: T^1 n^1 nu^0.
    """
    return {"indicated_input_torque": 1.0 + input, "output_torque": 1.0 / (1.0 + output)}
