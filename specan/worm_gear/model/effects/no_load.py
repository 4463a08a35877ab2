"""Losses without load: what turns in oil and air, and what rubs on the shafts."""

import numpy as np

from specan.models import Parameter, effect
from specan.worm_gear.model.effects.oil import IDLE_TORQUE, REFERENCE_VISCOSITY

REFERENCE_SPEED = 157.07963267948966  # rad/s: 1500 rpm
LEVEL_EXPONENT = Parameter(
    0.5, "1", min=0.0, max=2.0, lower=-1.0, upper=5.0, doc="power of the oil level over the standard one",
    needs=("oil_level",),
)  # fmt: skip


@effect(
    "churning",
    adds_to="viscous_loss",
    neutral={"power": 0.0, "constant": 0.0},
    aliases=("exponential-churning", "temperature-bias"),
    reference="Bizon, Dziedziech, Macheta 2012, eq. 3, with a free power of the viscosity "
    "(Changenet and Velex 2007, J. Mech. Des. 129:128: 0.21 laminar, 0 turbulent)",
)
def churning(
    worm_speed,
    kinematic_viscosity,
    oil_level,
    *,
    power=Parameter(50.0, "W", min=0.0, max=500.0, lower=0.0, upper=5000.0, doc="at 1500 rpm, 100 mm^2/s"),
    exponent=Parameter(1.5, "1", min=0.8, max=2.2, lower=0.2, upper=3.5, doc="power of the speed"),
    viscosity_exponent=Parameter(
        0.4,
        "1",
        min=0.0,
        max=1.0,
        lower=-0.5,
        upper=1.5,
        doc="power of the viscosity",
        needs=("indicated_oil_temperature",),
    ),
    constant=Parameter(15.0, "W", min=-50.0, max=150.0, lower=-500.0, upper=1000.0, doc="at 100 mm^2/s"),
    level_exponent=LEVEL_EXPONENT,
):
    """Rotating parts displace and shear the oil: a loss without load, which falls with warm oil.

    The article's empirical law nu(T) (alpha omega^beta + C), in which C bends the power law over the speeds that were
    measured: the article has -15 W. With a free power of the viscosity it also
    describes the viscous losses of bearings and mesh without load. It falls with the oil level.
    """
    speed = worm_speed / REFERENCE_SPEED
    viscosity = kinematic_viscosity / REFERENCE_VISCOSITY
    return oil_level**level_exponent * viscosity**viscosity_exponent * (power * speed**exponent + constant)


@effect(
    "exponential-churning",
    adds_to="viscous_loss",
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
    level_exponent=LEVEL_EXPONENT,
):  # fmt: skip
    """Rotating parts throw the oil about:

    a torque that grows exponentially with speed and does not depend on viscosity.

    A published form of the same part as `churning`, not an effect beside it.
    """
    speed = worm_speed / REFERENCE_SPEED
    return oil_level**level_exponent * torque * np.exp(growth * (speed - 1.0)) * worm_speed


@effect(
    "windage",
    adds_to="no_load_loss",
    separate_by="widen the range of speeds, and vary the oil level: windage does not follow it",
    reference="turbulent drag on a rotating disc: power with the 2.8th to 3rd power of the speed "
    "(Schlichting, Boundary-Layer Theory, ch. XXI); SKF drag losses go with n^3 as well",
)
def windage(
    worm_speed,
    *,
    power=Parameter(4.0, "W", min=0.5, max=20.0, lower=0.0, upper=500.0, doc="at 1500 rpm"),
    exponent=Parameter(3.0, "1", min=2.7, max=3.0, lower=2.6, upper=3.2, doc="power of the speed"),
):
    """Rotating parts drag air or oil mist along: a loss with about the third power of the speed.

    It depends on neither load nor viscosity; it is negligible at low speed and large at high speed. The drag of
    bearings in an oil bath has the same law and cannot be distinguished from it.
    """
    return power * (worm_speed / REFERENCE_SPEED) ** exponent


@effect(
    "mesh-pocketing",
    adds_to="no_load_loss",
    aliases=("windage",),
    separate_by="an oil of another viscosity and equal density: churning changes, squeezing does not; "
    "a wider range of speeds distinguishes it from windage",
    reference="momentum of the oil squeezed out between the teeth, torque ~ rho b n m^2 v (Mauz 1987; "
    "Butsch 1989 on squeeze losses); its size is left free here",
)
def mesh_pocketing(
    worm_speed,
    *,
    power=Parameter(8.0, "W", min=0.5, max=50.0, lower=0.0, upper=1000.0, doc="at 1500 rpm"),
):
    """Teeth that come into mesh squeeze the oil out of the gaps and throw it away.

    The power is proportional to the square of the speed and to the density of the oil; it depends on neither load
    nor viscosity. A churning law with a free exponent can reproduce most of it.
    """
    return power * (worm_speed / REFERENCE_SPEED) ** 2


@effect(
    "seal-drag",
    adds_to="no_load_loss",
    separate_by="run without load in both directions of rotation, check the zero of the input torque sensor "
    "at standstill before and after, or take the seal out",
    reference="DIN 3996 and SKF radial shaft seals: a torque that goes with the square of the shaft diameter "
    "and with neither load nor oil; its size is left free here",
)
def seal_drag(
    worm_speed,
    *,
    torque=Parameter(0.1, "N*m", min=0.02, max=0.5, lower=0.0, upper=5.0, doc="at the worm shaft"),
):
    """The lip of a radial shaft seal rubs on the shaft with a torque that does not depend on load or oil.

    The power is proportional to the speed. A zero error of the input torque sensor looks exactly the same, and a
    fitted no-load loss can reproduce much of it.
    """
    return torque * worm_speed


@effect(
    "brake-drag",
    adds_to="output_torque",
    separate_by="idle runs with the brake or belt taken off beside idle runs with it",
    reference="residual torque of powder, hysteresis and eddy current brakes and of belts: one half to some percent of "
    "their rated torque, in data sheets of such brakes; left free here",
)
def brake_drag(
    indicated_output_torque,
    brake_coupled,
    *,
    drag=Parameter(0.5, "N*m", min=0.05, max=3.0, lower=0.0, upper=20.0, doc="at the output, in runs without load"),
    idle_torque=IDLE_TORQUE,
):  # fmt: skip
    """The brake or its belt drags in runs that count as idle, and no sensor measures it.

    Set to a torque, the brake's control takes its drag into account; at zero it cannot. Idle runs then
    carry a small load; only they deviate.
    """
    return drag * brake_coupled * np.exp(-((indicated_output_torque / idle_torque) ** 2))
