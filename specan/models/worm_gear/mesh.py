"""Tooth engagement: normal force between the flanks and the power that their sliding takes."""

from __future__ import annotations

import math

import numpy as np

from specan.models.quantity import Quantity, quantity
from specan.models.worm_gear.rig import Rig


@quantity(unit="1")
def friction_coefficient():
    """Coefficient of friction between the flanks; an ideal gear has none."""
    return 0.0


@quantity(unit="N*m")
def output_torque(indicated_output_torque):
    """True torque at the output shaft."""
    return indicated_output_torque


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


def article_mesh_loss(rig: Rig) -> Quantity:
    """The article's eq. 1, a loss of spur gears: ``2.3 mu (1/z1 + 1/z2) W``."""
    factor = 2.3 * (1 / rig.gear.z_worm + 1 / rig.gear.z_wheel)

    @quantity(unit="W", reference="Bizon, Dziedziech, Macheta 2012, eq. 1 (after Gopinath and Mayuram)")
    def mesh_loss(friction_coefficient, wheel_torque, wheel_speed):
        """Power lost in tooth engagement, with the transmitted power taken at the output."""
        return factor * friction_coefficient * np.abs(wheel_torque) * wheel_speed

    return mesh_loss


def mesh_quantities(rig: Rig) -> list[Quantity]:
    """The mesh in the form that the rig file chooses."""
    loss = article_mesh_loss(rig) if rig.model.mesh == "article" else mesh_loss
    return [friction_coefficient, output_torque, wheel_torque, tooth_load, normal_force_per_torque, loss]
