"""Effects of the rolling bearings: what they lose, how they are loaded, how the oil reaches them."""

import numpy as np

from specan.models import Parameter, effect
from specan.worm_gear.model.bearings import RPM, WHEEL, WORM, without_load
from specan.worm_gear.model.effects.oil import SUPPLY
from specan.worm_gear.model.rig import K_Z

CATALOGUE = 1.84e-9  # SKF's coefficient of inlet shear heating
OIL_BATH = 3e-8  # SKF's K_rs in an oil bath
SCALE = Parameter(1.0, "1", min=0.3, max=1.5, lower=0.0, upper=4.0, doc="measured over calculated moment")
SHARE = Parameter(0.3, "1", min=0.0, max=1.0, doc="of the viscous loss without load that the bearings have")


@effect(
    "bearing-friction",
    adds_to=("worm_bearing_torque", "wheel_bearing_torque"),
    aliases=("load-dependent-friction", "palmgren-bearings"),
    reference="SKF model for the frictional moment (catalogue 10000 EN 2013, pp. 97-112)",
)
def bearing_friction(bearing_moment, *, scale=SCALE):
    """Balls roll in oil and slide a little in their grooves.

    The SKF model gives the moment of each bearing from its radial and axial load, the speed and the viscosity:
    rolling goes with load^0.54 and (viscosity x speed)^0.6, sliding with load^1.67. A catalogue value has
    an uncertainty of about 30 %, and published models of the same bearing (SKF, Palmgren in Harris, Rolling
    Bearing Analysis, ISO/TR
    14179-1) differ by up to a factor of three at light load; one scale applies to all four bearings.
    """
    return _on_both_shafts(scale, bearing_moment)


@effect(
    "palmgren-bearings",
    adds_to=("worm_bearing_torque", "wheel_bearing_torque"),
    separate_by="turn the shafts in their bearings without the mesh, at several speeds and loads",
    reference="Palmgren: M0 = 1e-7 f0 (nu n)^(2/3) d_m^3, M1 = f1 P1 d_m with f1 = z (P0/C0)^0.55 (Harris, Rolling "
    "Bearing Analysis; SKF General Catalogue 1989; ISO/TR 14179-2), f0 = 2 in an oil bath, z = 0.0009",
)
def palmgren_bearings(bearing_load_moment, bearing_oil_moment, *, scale=SCALE):
    """Balls roll in oil and slide a little in their grooves, as Palmgren measured them.

    A published form of the same part as `bearing-friction`, not an effect beside it: one moment
    proportional to (viscosity x speed)^(2/3) and independent of load, and one proportional to the load to
    the power 1.55 and independent of speed and oil.
    """
    return _on_both_shafts(scale, bearing_load_moment + bearing_oil_moment)


@effect(
    "iso-bearings",
    adds_to=("worm_bearing_torque", "wheel_bearing_torque"),
    aliases=("bearing-friction", "load-dependent-friction"),
    separate_by="turn the shafts in their bearings without the mesh, at several speeds and loads",
    reference="ISO/TR 14179-1: load-dependent moment f1 P1 d_m with f1 = 0.0006 to 0.0009 (P0/C0)^0.55 for deep groove "
    "ball bearings; what the oil in the bearings takes is not separated from the churning",
)
def iso_bearings(bearing_load_moment, *, scale=SCALE):
    """Balls slide a little in their grooves, the more the higher the load.

    A published form of the same part as `bearing-friction`, not an effect beside it: proportional to the load to the
    power 1.55 and independent of speed and oil, as where the bearings run nearly dry.
    """
    return _on_both_shafts(scale, bearing_load_moment)


@effect(
    "axial-preload",
    adds_to="bearing_axial_load",
    aliases=("mesh-starvation", "thermal-lag", "brake-drag"),
    separate_by="take the spring or the shims out and repeat a few conditions; runs without load against runs "
    "under load",
    reference="a constant axial force beside that of the mesh, in the SKF model for the frictional moment (catalogue "
    "10000 EN 2013); preloads of spring-loaded and adjusted deep groove bearings: up to some percent of C0",
)
def axial_preload(
    bearing_axial_load,
    *,
    force=Parameter(
        300.0, "N", min=50.0, max=2000.0, lower=0.0, upper=10000.0, doc="on each locating bearing"
    ),
):
    """A spring, a shim or a tight fit presses the bearings of a shaft together, with or without load.

    The balls then carry a load although the gear idles. Rolling and sliding moments grow
    as if the mesh pushed harder along the shaft: strongly at light load, less where the mesh already pushes.
    """
    return force * (bearing_axial_load >= 0)


@effect(
    "bearing-preload",
    adds_to="no_load_loss",
    aliases=("seal-drag", "torque-zero-error"),
    separate_by="runs without load over the whole range of temperatures",
    reference="linear thermal expansion of shaft against housing; both coefficients are left free here",
)
def bearing_preload(
    worm_speed,
    oil_temperature,
    *,
    growth=Parameter(5.0, "mN*m/K", min=-20.0, max=20.0, lower=-200.0, upper=200.0, doc="torque per kelvin"),
    free_temperature=Parameter(
        40.0,
        "degC",
        min=-20.0,
        max=120.0,
        lower=-20.0,
        upper=120.0,
        doc="at which there is none",
        needs=("indicated_oil_temperature",),
    ),
):
    """A shaft that expands more than its housing presses its bearings together; the drag follows temperature.

    M = k (theta - theta_0), at any load and speed: a straight line over temperature where the viscous losses are
    curved.
    """
    return growth * (oil_temperature - free_temperature) * worm_speed


@effect(
    "inlet-shear-heating",
    scales=("bearing_rolling_moment", "bearing_oil_moment", "viscous_loss"),
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
    share=SHARE,
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
    return _on_rolling(factor, share)


@effect(
    "starvation",
    scales=("bearing_rolling_moment", "bearing_oil_moment", "viscous_loss"),
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
    share=SHARE,
    level_exponent=SUPPLY,
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
    return _on_rolling(factor, share)


def _on_both_shafts(scale, moment):
    return {
        "worm_bearing_torque": scale * moment[WORM].sum(axis=0),
        "wheel_bearing_torque": scale * moment[WHEEL].sum(axis=0),
    }


def _on_rolling(factor, share):
    return {
        "bearing_rolling_moment": factor,
        "bearing_oil_moment": factor,
        "viscous_loss": without_load(factor, share),
    }
