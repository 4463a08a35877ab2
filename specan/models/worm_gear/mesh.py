"""Tooth engagement: normal force between the flanks and the power that their sliding takes."""

from __future__ import annotations

import math

import numpy as np

from specan.models.quantity import quantity


@quantity(unit="1")
def friction_coefficient():
    """Coefficient of friction between the flanks; an ideal gear has none."""
    return 0.0


@quantity(unit="N*m")
def output_torque(indicated_output_torque, brake_coupled):
    """True torque at the output shaft; none where the brake is uncoupled, whatever its sensor indicates."""
    return indicated_output_torque * brake_coupled


IDLE = 0.05  # share of the largest output torque below which a run is one without load


def brake_quantity(idle_uncoupled: bool, largest_torque: float):
    """Whether the brake is coupled, from the column or, where the rig says so, from the indicated torque.

    Parameters
    ----------
    idle_uncoupled : bool
        Runs without load were run with the brake uncoupled.
    largest_torque : float
        Of the bench at the output, N*m.
    """

    @quantity(unit="1")
    def brake_coupled(coupled, indicated_output_torque):
        """Whether the brake is coupled to the output: 1, or 0."""
        if not idle_uncoupled:
            return coupled
        return coupled * (np.abs(indicated_output_torque) > IDLE * largest_torque)

    return brake_coupled


@quantity(unit="N*m")
def wheel_torque(output_torque, wheel_bearing_torque):
    """Torque that the mesh puts on the wheel: the output torque and what the wheel's bearings take."""
    return output_torque + wheel_bearing_torque


@quantity(unit="N/m")
def tooth_load(output_torque, wheel_radius, wheel_width):
    """Tangential force on the wheel over its face width: how hard the flanks are loaded."""
    return output_torque / (wheel_radius * wheel_width)


@quantity(unit="1/m", reference="statics of the flank: normal force and friction along the lead")
def normal_force_per_torque(friction_coefficient, wheel_radius, lead_angle, normal_pressure_angle):
    """Normal force between the flanks for a torque of 1 N*m on the wheel."""
    axial = math.cos(normal_pressure_angle) * math.cos(lead_angle)
    return 1.0 / (wheel_radius * (axial - friction_coefficient * math.sin(lead_angle)))


@quantity(unit="W", reference="friction force times sliding speed")
def mesh_loss(friction_coefficient, normal_force_per_torque, wheel_torque, sliding_speed):
    """Power lost in tooth engagement: what the sliding flanks take."""
    # A wheel that is driven backwards loads the other flank: the loss stays a loss.
    return friction_coefficient * normal_force_per_torque * np.abs(wheel_torque) * sliding_speed


QUANTITIES = [
    output_torque,
    wheel_torque,
    tooth_load,
    friction_coefficient,
    normal_force_per_torque,
    mesh_loss,
]
