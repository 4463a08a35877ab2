"""A zero of the input torque sensor that moves during a campaign."""

from specan.models import Parameter, effect


@effect(
    "zero-drift",
    adds_to="indicated_input_torque",
    neutral={"rate": 0.0},
    aliases=("running-in",),
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
