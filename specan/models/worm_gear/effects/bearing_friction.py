"""Friction of the rolling bearings."""

from specan.models import Parameter, effect
from specan.models.worm_gear.bearings import WHEEL, WORM


@effect(
    "bearing-friction",
    adds_to=("worm_bearing_torque", "wheel_bearing_torque"),
    neutral={"scale": 0.0},
    reference="SKF model for the frictional moment (catalogue 10000 EN 2013, pp. 97-112)",
)
def bearing_friction(
    bearing_moment,
    *,
    scale=Parameter(1.0, "1", min=0.3, max=1.5, lower=0.0, upper=4.0, doc="measured over catalogue moment"),
):
    """Balls roll in oil and slide a little in their grooves.

    The SKF model gives the moment of each bearing from its radial and axial load, the speed and the viscosity:
    rolling goes with load^0.54 and (viscosity x speed)^0.6, sliding with load^1.67. A catalogue value has
    an uncertainty of about 30 %, and published models of the same bearing (SKF, Palmgren in Harris, Rolling
    Bearing Analysis, ISO/TR
    14179-1) differ by up to a factor of three at light load; one scale applies to all four bearings.
    """
    return {
        "worm_bearing_torque": scale * bearing_moment[WORM].sum(axis=0),
        "wheel_bearing_torque": scale * bearing_moment[WHEEL].sum(axis=0),
    }
