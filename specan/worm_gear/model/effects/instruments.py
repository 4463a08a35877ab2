"""Errors of the torque sensors and the thermometer."""

import numpy as np

from specan.models import Parameter, effect
from specan.models.quantity import direction

STILL = 0.02  # share of the largest torque that counts as a change
GAIN = Parameter(
    0.3, "percent", min=-1.0, max=1.0, lower=-20.0, upper=20.0, doc="indicated over true, less 1"
)


@effect(
    "torque-zero-error",
    adds_to=("indicated_input_torque", "output_torque"),
    neutral={"input": 0.0, "output": 0.0},
    aliases=("seal-drag", "brake-drag", "mesh-starvation"),
    separate_by="read both sensors at standstill and unloaded before and after, exchange them, "
    "run without load in both directions",
    reference="additive error of a sensor; 0.05 % of full scale is good for strain-gauge torque sensors",
    instrument=True,
)
def torque_zero_error(
    brake_coupled,
    *,
    input=Parameter(0.05, "N*m", min=-0.2, max=0.2, lower=-2.0, upper=2.0, doc="indicated less true torque"),
    output=Parameter(
        0.5, "N*m", min=-2.0, max=2.0, lower=-20.0, upper=20.0, doc="indicated less true torque"
    ),
):
    """A torque sensor reads a torque without load.

    At the input it looks like the drag of a seal: the same torque at every load, speed and viscosity. At the output
    the true torque differs from the indicated one: all losses belong to a neighbouring torque, and idle runs
    deviate. Runs with the brake uncoupled have no output torque, and no error of it.
    """
    return {"indicated_input_torque": input, "output_torque": -output * brake_coupled}


@effect(
    "torque-gain-error",
    scales=("indicated_input_torque", "output_torque"),
    neutral={"input": 0.0, "output": 0.0},
    separate_by="exchange the two sensors, or load both with a lever arm and weights",
    reference="multiplicative error of a sensor; 0.1 % to 0.5 % is usual",
    instrument=True,
)
def torque_gain_error(*, input=GAIN, output=GAIN):
    """A torque sensor reads some parts in a thousand too high.

    The loss is the small difference of two large torques, so a gain error changes it many times more. It is
    proportional to the torque and looks like a change of the coefficient of friction.
    """
    return {"indicated_input_torque": 1.0 + input, "output_torque": 1.0 / (1.0 + output)}


@effect(
    "torque-hysteresis",
    adds_to="indicated_input_torque",
    needs=("elapsed_time",),
    separate_by="approach the same torque once from below and once from above",
    reference="reversibility error of a torque measuring device, half the difference between increasing and decreasing "
    "torque (VDI/VDE 2646; ISO 376 for forces): taken as one width over the whole range",
    instrument=True,
)
def torque_hysteresis(
    output_torque,
    elapsed_time,
    *,
    half_width=Parameter(
        0.02, "N*m", min=-0.1, max=0.1, lower=-1.0, upper=1.0, doc="read too high after the load was raised"
    ),
):
    """The sensor, or dry friction in its coupling, lags behind the load.

    A reading after the load was raised is too high (or too low) by as much as one after it was lowered is
    too low.
    """
    torque = np.asarray(output_torque, dtype=float)
    if np.ndim(torque) == 0 or np.ndim(elapsed_time) == 0:
        return 0.0 * torque
    return half_width * direction(torque, elapsed_time, STILL * np.max(np.abs(torque), initial=0.0))


@effect(
    "zero-drift",
    adds_to="indicated_input_torque",
    needs=("elapsed_time",),
    separate_by="read the sensor at standstill and unloaded before, during and after the campaign; "
    "randomise the order of the measurements",
    reference="zero drift of torque transducers over time (terms of VDI/VDE 2646); taken as straight over the campaign",
    instrument=True,
)
def zero_drift(
    elapsed_time,
    *,
    rate=Parameter(0.01, "N*m/hour", min=-0.1, max=0.1, lower=-1.0, upper=1.0, doc="of the indicated torque"),
):
    """The sensor at the input warms up or creeps, and its reading without torque drifts steadily.

    All readings drift equally at any load and speed. Running-in, in contrast, acts on the loaded flanks and
    ends.
    """
    return rate * elapsed_time


@effect(
    "temperature-bias",
    adds_to="oil_temperature",
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
