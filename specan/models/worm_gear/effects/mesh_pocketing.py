"""Oil squeezed out of the mesh."""

from specan.models import Parameter, effect
from specan.models.worm_gear.effects.churning import REFERENCE_SPEED


@effect(
    "mesh-pocketing",
    adds_to="no_load_loss",
    neutral={"power": 0.0},
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

    The power is proportional to the square of the speed and to the density of the oil and does not depend
    on its viscosity: T^0 n^2
    nu^0. A churning law with a free exponent can reproduce most of it.
    """
    return power * (worm_speed / REFERENCE_SPEED) ** 2
