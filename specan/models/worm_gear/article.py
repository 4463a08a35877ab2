"""The equations of the article as printed: tooth engagement (eq. 1) and loads of the bearings (eqs 4-7).

M. Bizon, K. Dziedziech, A. Macheta, Worm gear analysis in terms of numerical modelling, Mechanics and Control 31
(2012) 4, 133-140. A rig file chooses them by ``mesh = "article"`` under ``[model]``. Both go by what is put into
the gear, so that bearing friction closes a loop.
"""

from __future__ import annotations

import numpy as np

from specan.models.quantity import Quantity, quantity
from specan.models.worm_gear.bearings import AXES
from specan.models.worm_gear.rig import Rig

SOURCE = "Bizon, Dziedziech, Macheta 2012"


def article_quantities(rig: Rig) -> list[Quantity]:
    """What takes the place of the worm mesh and of statics."""
    return [_mesh_loss(rig), bearing_radial_load, bearing_axial_load]


def _mesh_loss(rig: Rig) -> Quantity:
    factor = 2.3 * (1 / rig.gear.z_worm + 1 / rig.gear.z_wheel)

    @quantity(unit="W", reference=f"{SOURCE}, eq. 1 (after Gopinath and Mayuram): 2.3 mu (1/z1 + 1/z2) W")
    def mesh_loss(friction_coefficient, output_power, bearing_loss, no_load_loss):
        """Power lost in tooth engagement, a share of the power that is put in."""
        share = factor * friction_coefficient
        return share / (1 - share) * (np.abs(output_power) + bearing_loss + no_load_loss)

    return mesh_loss


@quantity(unit="N", axes=AXES, reference=f"{SOURCE}, eqs 4-7, whose numbers hold for its own gear")
def bearing_radial_load(input_torque, friction_coefficient):
    """Radial load of each bearing: C and D of the worm's shaft, A and B of the wheel's."""
    mu = friction_coefficient
    lever = 0.00564 + 0.0166 * mu
    along = (0.939 - 0.324 * mu) / lever
    couple = (0.024 - 0.00567 * mu) / (0.000598 + 0.00176 * mu)
    per_torque = [
        (35.169, couple),
        (21.947, 0.117 / lever - couple),
        (0.0548 / lever - 41.45, 0.468 * along),
        (0.0622 / lever + 41.45, 0.532 * along),
    ]
    return np.stack([np.hypot(x, y) * np.abs(input_torque) for x, y in per_torque])


@quantity(unit="N", axes=AXES, reference=f"{SOURCE}: eqs 4-7 leave the axial load out")
def bearing_axial_load(bearing_radial_load):
    """Axial load of each bearing: none."""
    return np.zeros_like(bearing_radial_load)
