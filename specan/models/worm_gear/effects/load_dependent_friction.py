"""Friction that depends on how hard the flanks are pressed."""

import numpy as np

from specan.models import Parameter, effect

REFERENCE_LOAD = 4e4  # N/m: 45 N*m on a wheel of 90 mm and 25 mm width
NO_LOAD = 0.02  # of the reference load: keeps the law finite where the flanks hardly touch


@effect(
    "load-dependent-friction",
    scales="friction_coefficient",
    neutral={"exponent": 0.0},
    aliases=("bearing-friction",),
    separate_by="torque over a decade at one speed and temperature",
    reference="ISO/TR 14179-2:2001: mu ~ (F_bt/b)^0.2; hydrodynamic films: mu ~ (load)^-0.5 "
    "(Cameron, Basic Lubrication Theory, 1981)",
)
def load_dependent_friction(
    tooth_load,
    *,
    exponent=Parameter(
        0.1, "1", min=-0.5, max=0.3, lower=-2.0, upper=2.0, doc="mu ~ load^exponent, at 40 kN/m"
    ),
    bend=Parameter(
        0.0, "1", min=0.0, max=3.0, doc="how much faster it changes at high load; 0: a power law", fixed=True
    ),
):
    """Flanks that are pressed harder wear their film thinner (friction rises) or use it better (friction falls).

    mu ~ (F/b)^a gives a loss with T^(1+a) n: a bend in the loss over torque that no constant coefficient of
    friction has. With its second shape set free, mu = mu_0 exp(a (x^k - 1)/k) with x the load over 40 kN/m, the
    friction may also change slowly at low load and fast at high load.
    """
    load = np.log(np.hypot(tooth_load / REFERENCE_LOAD, NO_LOAD))
    power = np.maximum(bend, 1e-9)  # (x^k - 1)/k is the logarithm where k vanishes
    return np.exp(exponent * np.expm1(power * load) / power)
