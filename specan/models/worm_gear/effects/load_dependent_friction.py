"""Friction that depends on how hard the flanks are pressed."""

import numpy as np

from specan.models import Parameter, effect
from specan.models.worm_gear.mesh import power_step

REFERENCE_LOAD = 4e4  # N/m: 45 N*m on a wheel of 90 mm and 25 mm width
NO_LOAD = 0.02  # of the reference load: keeps the law finite where the flanks hardly touch


@effect(
    "load-dependent-friction",
    adds_to="friction_coefficient",
    neutral={"change": 0.0},
    valid={"friction_coefficient": (0.0, 1.0, "1")},
    aliases=("bearing-friction", "iso-bearings"),
    separate_by="torque over a decade at one speed and temperature",
    reference="exponents: 0.2 for steel gears (Schlenk, in ISO/TR 14179-2:2001); of an elastohydrodynamic film at "
    "most that of the Hertz pressure, 1.03, which is load^0.5 on a line, and less as the film heats (Xu, "
    "dissertation, Ohio State University, 2005); hydrodynamic -0.5, at a constant film -1 (Cameron, Basic "
    "Lubrication Theory, 1981); worm gears: minor (AGMA 98FTM10). Size and exponent are left free here",
)
def load_dependent_friction(
    tooth_load,
    *,
    change=Parameter(0.005, "1", min=-0.03, max=0.02, lower=-0.2, upper=0.2, doc="of mu, from 40 to 80 kN/m"),
    exponent=Parameter(0.2, "1", min=-1.0, max=0.5, lower=-2.0, upper=4.0, doc="of the load's power"),
):
    """A higher load on the flanks makes the oil film thinner (friction rises) or more effective (friction falls).

    mu = mu_0 + c ((x^a - 1)/(2^a - 1)) with x the load over 40 kN/m: the power law mu ~ (F/b)^a beside a share
    that does not depend on the load. The loss over torque is curved, which a constant coefficient of friction
    cannot cause. No
    film makes friction rise as fast as the load itself: where the data ask for an exponent above 0.5 by
    more than
    its uncertainty, another effect is likely whose loss is a power of the torque (a collar, a twisted housing).
    """
    return change * power_step(np.hypot(tooth_load / REFERENCE_LOAD, NO_LOAD), exponent)
