"""Loss in the oil bath by the law of ISO/TR 14179-2."""

import numpy as np

from specan.models import Parameter, effect
from specan.models.worm_gear.effects.churning import REFERENCE_SPEED


@effect(
    "exponential-churning",
    adds_to="viscous_loss",
    neutral={"torque": 0.0},
    aliases=("churning",),
    separate_by="runs without load over a wide range of speeds with two oils",
    reference="ISO/TR 14179-2: hydraulic loss torque C_1 exp(C_2 v/v_t0) of wheels that dip in oil, whatever the oil; "
    "both constants are left free here",
)
def exponential_churning(
    worm_speed,
    oil_level,
    *,
    torque=Parameter(0.3, "N*m", min=0.0, max=3.0, lower=0.0, upper=30.0, doc="at 1500 rpm"),
    growth=Parameter(
        0.3, "1", min=0.0, max=1.5, lower=-1.0, upper=5.0, doc="of its logarithm from standstill to 1500 rpm"
    ),
    level_exponent=Parameter(
        0.5, "1", min=0.0, max=2.0, lower=-1.0, upper=5.0, doc="power of the oil level over the standard one",
        needs=("oil_level",),
    ),
):  # fmt: skip
    """Rotating parts throw the oil about:

    a torque that grows exponentially with speed and does not depend on viscosity.

    A published form of the same part as `churning`, not an effect beside it.
    """
    speed = worm_speed / REFERENCE_SPEED
    return oil_level**level_exponent * torque * np.exp(growth * (speed - 1.0)) * worm_speed
