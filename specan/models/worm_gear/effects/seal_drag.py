"""Rubbing shaft seals."""

from specan.models import Parameter, effect


@effect(
    "seal-drag",
    adds_to="no_load_loss",
    neutral={"torque": 0.0},
    aliases=("torque-zero-error", "bearing-preload"),
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

    The power is proportional to the speed, T^0 n^1 nu^0. A zero error of the input torque sensor looks exactly
    the same,
    and a fitted no-load loss can reproduce much of it.
    """
    return torque * worm_speed
