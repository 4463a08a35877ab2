"""Friction that depends on how hard the flanks are pressed."""

import numpy as np

from specan.models import Parameter, effect
from specan.models.worm_gear.power_step import power_step

REFERENCE_LOAD = 4e4  # N/m: 45 N*m on a wheel of 90 mm and 25 mm width
NO_LOAD = 0.02  # of the reference load: keeps the law finite where the flanks hardly touch


@effect(
    "load-dependent-friction",
    adds_to="friction_coefficient",
    neutral={"change": 0.0},
    valid={"friction_coefficient": (0.0, 1.0, "1")},
    aliases=("bearing-friction",),
    separate_by="torque over a decade at one speed and temperature",
    reference="ISO/TR 14179-2:2001: mu ~ (F_bt/b)^0.2; hydrodynamic films: between mu ~ load^-0.5 and, at a "
    "constant film, load^-1 (Cameron, Basic Lubrication Theory, 1981); size and exponent are left free here",
)
def load_dependent_friction(
    tooth_load,
    *,
    change=Parameter(0.005, "1", min=-0.03, max=0.02, lower=-0.2, upper=0.2, doc="of mu, from 40 to 80 kN/m"),
    exponent=Parameter(0.2, "1", min=-1.0, max=3.0, lower=-2.0, upper=4.0, doc="of the load's power"),
):
    """Flanks that are pressed harder wear their film thinner (friction rises) or use it better (friction falls).

    mu = mu_0 + c ((x^a - 1)/(2^a - 1)) with x the load over 40 kN/m: the power law mu ~ (F/b)^a, a straight line
    (a = 1), or anything between. The loss over torque bends as no constant coefficient of friction makes it.
    """
    return change * power_step(np.hypot(tooth_load / REFERENCE_LOAD, NO_LOAD), exponent)
