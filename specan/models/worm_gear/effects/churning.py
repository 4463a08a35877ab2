"""Loss of the worm and the wheel in the oil bath."""

from specan.models import Parameter, effect

REFERENCE_SPEED = 157.07963267948966  # rad/s: 1500 rpm
REFERENCE_VISCOSITY = 1e-4  # m^2/s


@effect(
    "churning",
    adds_to="viscous_loss",
    neutral={"power": 0.0, "constant": 0.0},
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
    level_exponent=Parameter(
        0.5,
        "1",
        min=0.0,
        max=2.0,
        lower=-1.0,
        upper=5.0,
        doc="power of the oil level over the standard one",
        needs=("oil_level",),
    ),
):
    """Rotating parts displace and shear the oil: a loss without load, which falls with warm oil.

    The article's empirical law nu(T) (alpha omega^beta + C). With a free power of the viscosity it also
    describes the viscous losses of bearings and mesh without load. It falls with the oil level.
    """
    speed = worm_speed / REFERENCE_SPEED
    viscosity = kinematic_viscosity / REFERENCE_VISCOSITY
    return oil_level**level_exponent * viscosity**viscosity_exponent * (power * speed**exponent + constant)
