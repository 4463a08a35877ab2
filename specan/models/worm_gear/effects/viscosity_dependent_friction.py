"""Friction that depends on how thick the oil is."""

from specan.models import Parameter, effect
from specan.models.worm_gear.effects.churning import REFERENCE_VISCOSITY


@effect(
    "viscosity-dependent-friction",
    scales="friction_coefficient",
    neutral={"exponent": 0.0},
    separate_by="cold and warm oil at high torque, and again at low torque",
    reference="ISO/TR 14179-2:2001 and Schlenk: mu ~ eta^-0.05 for cylindrical gears; worm gears with their "
    "pure sliding show more (Predki 1982); the exponent is left free here",
)
def viscosity_dependent_friction(
    kinematic_viscosity,
    *,
    exponent=Parameter(0.1, "1", min=0.02, max=0.3, lower=-0.5, upper=1.0, doc="mu ~ nu^-exponent"),
):
    """Thick oil keeps the flanks further apart: friction falls with the viscosity, mu ~ nu^-s.

    The residual goes with the torque and changes its sign at some temperature in the middle: with warm oil the
    gear loses more under load than the model says, with cold oil less.
    """
    return (kinematic_viscosity / REFERENCE_VISCOSITY) ** -exponent
