"""Friction that depends on how thick the oil is."""

from specan.models import Parameter, effect
from specan.models.worm_gear.effects.churning import REFERENCE_VISCOSITY
from specan.models.worm_gear.mesh import power_step


@effect(
    "viscosity-dependent-friction",
    adds_to="friction_coefficient",
    neutral={"change": 0.0},
    valid={"friction_coefficient": (0.0, 1.0, "1")},
    separate_by="cold and warm oil at high torque, and again at low torque",
    reference="ISO/TR 14179-2:2001 and Schlenk: mu ~ eta^-0.05 for cylindrical gears; worm gears with their "
    "pure sliding show more (Predki 1982); the size is left free here",
)
def viscosity_dependent_friction(
    kinematic_viscosity,
    *,
    change=Parameter(
        0.003, "1", min=0.0005, max=0.015, lower=-0.1, upper=0.1, doc="of mu, from 100 to 50 mm^2/s"
    ),
    exponent=Parameter(
        0.15, "1", min=0.0, max=1.0, lower=-1.0, upper=2.0, doc="of the viscosity's power", fixed=True
    ),
):
    """Thick oil keeps the flanks further apart: friction rises as the oil thins, mu ~ nu^-s.

    The residual is proportional to the torque and changes its sign at some temperature in the middle: with
    warm oil the
    gear loses more under load than the model says, with cold oil less.
    """
    return change * power_step(REFERENCE_VISCOSITY / kinematic_viscosity, exponent)
