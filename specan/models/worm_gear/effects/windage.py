"""Drag of what turns fast, in air, mist or oil."""

from specan.models import Parameter, effect
from specan.models.worm_gear.effects.churning import REFERENCE_SPEED


@effect(
    "windage",
    adds_to="no_load_loss",
    neutral={"power": 0.0},
    aliases=("mesh-pocketing",),
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

    T^0 n^3 nu^0. It is negligible at low speed and large at high speed. The drag of bearings in an oil
    bath has the same law and cannot be distinguished from it.
    """
    return power * (worm_speed / REFERENCE_SPEED) ** exponent
