"""Oil that thins where it is sheared fast."""

from specan.models import Parameter, effect


@effect(
    "shear-thinning",
    scales="kinematic_viscosity",
    neutral={"exponent": 0.0},
    aliases=("oil-heating", "churning"),
    separate_by="an oil without polymers of the same viscosity, or a rheometer",
    reference="Carreau 1972, Trans. Soc. Rheol. 16: eta = eta_0 (1 + (shear rate / critical)^2)^(-m/2); "
    "the shear rate is taken proportional to the sliding speed, both constants are left free here",
)
def shear_thinning(
    sliding_speed,
    *,
    exponent=Parameter(0.2, "1", min=0.05, max=0.6, lower=0.0, upper=1.5, doc="of the fall at high shear"),
    speed=Parameter(
        1.0, "m/s", min=0.2, max=6.0, lower=0.1, upper=20.0, doc="sliding speed at which it sets in"
    ),
):
    """Long molecules line up where oil is sheared fast, and it flows more easily than the data sheet says.

    Every viscous loss grows less with speed than it should. A power of the speed that is fitted to the churning
    loss takes most of it up.
    """
    return (1.0 + (sliding_speed / speed) ** 2) ** (-0.5 * exponent)
