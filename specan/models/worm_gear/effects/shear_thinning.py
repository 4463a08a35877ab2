"""Oil that thins where it is sheared hard."""

from specan.models import Parameter, effect
from specan.models.worm_gear.effects.churning import REFERENCE_VISCOSITY


@effect(
    "shear-thinning",
    scales="kinematic_viscosity",
    neutral={"exponent": 0.0},
    aliases=("oil-heating", "churning", "starvation", "inlet-shear-heating", "torque-zero-error"),
    separate_by="an oil without polymers of the same viscosity, or a rheometer",
    reference="Carreau 1972, Trans. Soc. Rheol. 16: eta = eta_0 (1 + (lambda x shear rate)^2)^(-m/2) with the "
    "relaxation time lambda proportional to the viscosity, so that it sets in at a shear stress (Eyring: m = 1); "
    "the shear rate is taken proportional to the sliding speed, both constants are left free here",
)
def shear_thinning(
    sliding_speed,
    kinematic_viscosity,
    *,
    exponent=Parameter(0.2, "1", min=0.05, max=1.0, lower=0.0, upper=1.0, doc="of the fall at high stress"),
    speed=Parameter(
        3.0,
        "m/s",
        min=0.2,
        max=30.0,
        lower=0.05,
        upper=100.0,
        doc="sliding speed at which it sets in, for oil of 100 mm^2/s",
    ),
):
    """Long molecules align in strongly sheared oil, and its viscosity falls below that of the data sheet.

    The shear stress, viscosity times speed, decides: cold oil thins at a lower speed than warm oil. Viscous
    losses grow less with speed and with the viscosity than they should.
    """
    stress = sliding_speed * kinematic_viscosity / REFERENCE_VISCOSITY
    return (1.0 + (stress / speed) ** 2) ** (-0.5 * exponent)
