"""The balance of power, and what the instruments indicate of it."""

from __future__ import annotations

import numpy as np

from specan.models.quantity import quantity


def _ratio(part, whole):
    """Not a number where nothing goes in: an ideal gear without load has no efficiency."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.true_divide(part, whole)


@quantity(unit="W")
def viscous_loss():
    """Power that the oil's viscosity takes without load; an ideal gear loses none."""
    return 0.0


@quantity(unit="W")
def no_load_loss(viscous_loss):
    """Power lost whether the gear carries load or not: to the oil, to seals, to the air."""
    return viscous_loss


@quantity(unit="W")
def power_loss(mesh_loss, bearing_loss, no_load_loss):
    """Power that the gear turns into heat."""
    return mesh_loss + bearing_loss + no_load_loss


@quantity(unit="W")
def output_power(output_torque, wheel_speed):
    """Power at the output shaft."""
    return output_torque * wheel_speed


@quantity(unit="N*m")
def input_torque(output_power, power_loss, worm_speed):
    """True torque at the input shaft."""
    return (output_power + power_loss) / worm_speed


@quantity(unit="1")
def efficiency(output_power, power_loss):
    """True power out over power in."""
    return _ratio(output_power, output_power + power_loss)


@quantity(unit="N*m")
def indicated_input_torque(input_torque):
    """Input torque as its sensor indicates it."""
    return input_torque


@quantity(unit="1")
def indicated_efficiency(indicated_output_torque, indicated_input_torque, gear_ratio):
    """Efficiency as it is worked out from what the two torque sensors indicate."""
    return _ratio(indicated_output_torque, gear_ratio * indicated_input_torque)


@quantity(unit="W")
def indicated_power_loss(indicated_output_torque, indicated_input_torque, gear_ratio, worm_speed):
    """Power loss as it is worked out from what the two torque sensors indicate."""
    return (indicated_input_torque - indicated_output_torque / gear_ratio) * worm_speed


QUANTITIES = [
    viscous_loss, no_load_loss, power_loss, output_power, input_torque, efficiency,
    indicated_input_torque, indicated_efficiency, indicated_power_loss,
]  # fmt: skip
