"""Zero errors of the torque sensors."""

from specan.models import Parameter, effect


@effect(
    "torque-zero-error",
    adds_to=("indicated_input_torque", "output_torque"),
    neutral={"input": 0.0, "output": 0.0},
    aliases=("seal-drag", "bearing-preload", "thermal-lag", "shear-thinning", "brake-drag"),
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

    At the input it looks like a seal, T^0 n^1 nu^0. At the output the true torque differs from the
    indicated one: all losses belong to a neighbouring torque, and idle runs deviate. Runs with the brake
    uncoupled have no
    output torque, and no error of it.
    """
    return {"indicated_input_torque": input, "output_torque": -output * brake_coupled}
