"""Oil that is heated in front of the rolling contacts."""

import numpy as np

from specan.models import Parameter, effect
from specan.models.worm_gear.bearings import RPM, without_load

CATALOGUE = 1.84e-9


@effect(
    "inlet-shear-heating",
    scales=("bearing_rolling_moment", "bearing_oil_moment", "viscous_loss"),
    neutral={"strength": 0.0},
    aliases=("starvation", "oil-heating", "shear-thinning"),
    separate_by="cold oil at the highest speed, bearings alone if possible",
    reference="SKF, The SKF model for calculating the frictional moment: inlet shear heating reduction factor "
    "1/(1 + 1.84e-9 (n d_m)^1.28 nu^0.64)",
)
def inlet_shear_heating(
    bearing_speed,
    kinematic_viscosity,
    bearing_bore,
    bearing_outside,
    *,
    strength=Parameter(1.0, "1", min=0.5, max=1.5, lower=0.0, upper=20.0, doc="times the SKF coefficient"),
    share=Parameter(
        0.3, "1", min=0.0, max=1.0, doc="of the viscous loss without load that the bearings have"
    ),
):
    """Part of the oil in front of a rolling contact flows back, is sheared and heated.

    The film becomes thinner and rolling easier. It matters for large bearings, thick oil and high speed, and
    acts on the rolling moments and on that share of the viscous loss without load which is the bearings'.
    """
    mean_diameter = 500 * (bearing_bore + bearing_outside)  # mm
    rpm_mm = RPM * (bearing_speed.T * mean_diameter).T
    factor = 1.0 / (
        1.0 + strength * CATALOGUE * rpm_mm**1.28 * (1e6 * np.asarray(kinematic_viscosity)) ** 0.64
    )
    return {
        "bearing_rolling_moment": factor,
        "bearing_oil_moment": factor,
        "viscous_loss": without_load(factor, share),
    }
