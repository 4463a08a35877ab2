"""Friction of the rolling bearings by the older catalogues' formula."""

from specan.models import Parameter, effect
from specan.models.worm_gear.bearings import WHEEL, WORM


@effect(
    "palmgren-bearings",
    adds_to=("worm_bearing_torque", "wheel_bearing_torque"),
    neutral={"scale": 0.0},
    aliases=("bearing-friction",),
    separate_by="turn the shafts in their bearings without the mesh, at several speeds and loads",
    reference="Palmgren: M0 = 1e-7 f0 (nu n)^(2/3) d_m^3, M1 = f1 P1 d_m with f1 = z (P0/C0)^0.55 (Harris, Rolling "
    "Bearing Analysis; SKF General Catalogue 1989; ISO/TR 14179-2), f0 = 2 in an oil bath, z = 0.0009",
)
def palmgren_bearings(
    bearing_load_moment,
    bearing_oil_moment,
    *,
    scale=Parameter(1.0, "1", min=0.3, max=1.5, lower=0.0, upper=4.0, doc="measured over calculated moment"),
):
    """Balls roll in oil and slide a little in their grooves, as Palmgren measured them.

    A published form of the same part as `bearing-friction`, not an effect beside it: one moment
    proportional to (viscosity x speed)^(2/3) and independent of load, and one proportional to the load to
    the power 1.55 and independent of speed and oil.
    """
    moment = bearing_load_moment + bearing_oil_moment
    return {
        "worm_bearing_torque": scale * moment[WORM].sum(axis=0),
        "wheel_bearing_torque": scale * moment[WHEEL].sum(axis=0),
    }
