"""Friction of the rolling bearings by the thermal rating of gear drives."""

from specan.models import Parameter, effect
from specan.models.worm_gear.bearings import WHEEL, WORM


@effect(
    "iso-bearings",
    adds_to=("worm_bearing_torque", "wheel_bearing_torque"),
    neutral={"scale": 0.0},
    aliases=("bearing-friction", "load-dependent-friction"),
    separate_by="turn the shafts in their bearings without the mesh, at several speeds and loads",
    reference="ISO/TR 14179-1: load-dependent moment f1 P1 d_m with f1 = 0.0006 to 0.0009 (P0/C0)^0.55 for deep groove "
    "ball bearings; what the oil in the bearings takes is not separated from the churning",
)
def iso_bearings(
    bearing_load_moment,
    *,
    scale=Parameter(1.0, "1", min=0.3, max=1.5, lower=0.0, upper=4.0, doc="measured over calculated moment"),
):
    """Balls slide a little in their grooves, the more the higher the load.

    A published form of the same part as `bearing-friction`, not an effect beside it: proportional to the load to the
    power 1.55 and independent of speed and oil, as where the bearings run nearly dry.
    """
    return {
        "worm_bearing_torque": scale * bearing_load_moment[WORM].sum(axis=0),
        "wheel_bearing_torque": scale * bearing_load_moment[WHEEL].sum(axis=0),
    }
