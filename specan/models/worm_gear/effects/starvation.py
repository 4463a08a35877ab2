"""Bearings that run out of oil."""

import numpy as np

from specan.models import Parameter, effect
from specan.models.worm_gear.bearing_table import K_Z
from specan.models.worm_gear.bearings import RPM, without_load

OIL_BATH = 3e-8


@effect(
    "starvation",
    scales=("bearing_rolling_moment", "bearing_oil_moment", "viscous_loss"),
    neutral={"strength": 0.0},
    aliases=("inlet-shear-heating", "oil-heating", "shear-thinning"),
    separate_by="a series of oil levels at high speed",
    reference="SKF, The SKF model for calculating the frictional moment: kinematic replenishment/starvation "
    "factor exp(-K_rs nu n (d + D) sqrt(K_Z / (2 (D - d)))), K_rs 3e-8 in an oil bath, 6e-8 with grease",
)
def starvation(
    bearing_speed,
    kinematic_viscosity,
    oil_level,
    bearing_bore,
    bearing_outside,
    *,
    strength=Parameter(1.0, "1", min=0.3, max=3.0, lower=0.0, upper=50.0, doc="K_rs over 3e-8"),
    share=Parameter(
        0.3, "1", min=0.0, max=1.0, doc="of the viscous loss without load that the bearings have"
    ),
    level_exponent=Parameter(
        1.0,
        "1",
        min=0.0,
        max=3.0,
        lower=-1.0,
        upper=6.0,
        doc="power of the standard oil level over the actual",
        needs=("oil_level",),
    ),
):
    """Each ball pushes the oil aside, and the next ball arrives before the oil has flowed back.

    With thick oil and high speed the contacts have too little oil, and the rolling loss falls instead of
    growing. It begins earlier at a lower oil level. It acts on the rolling moments and on
    that share of the viscous loss without load which is the bearings'.
    """
    bore, outside = 1e3 * bearing_bore, 1e3 * bearing_outside
    geometry = (bore + outside) * np.sqrt(K_Z / (2 * (outside - bore)))
    reach = 1e6 * RPM * kinematic_viscosity * (bearing_speed.T * geometry).T
    factor = np.exp(-strength * OIL_BATH * oil_level**-level_exponent * reach)
    return {
        "bearing_rolling_moment": factor,
        "bearing_oil_moment": factor,
        "viscous_loss": without_load(factor, share),
    }
