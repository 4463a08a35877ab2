"""The oil in the contacts is warmer than the sump, by the loss that it causes itself."""

from specan.models import Parameter, effect


@effect(
    "oil-heating",
    adds_to="contact_temperature",
    neutral={"resistance": 0.0},
    aliases=("inlet-shear-heating", "starvation", "shear-thinning"),
    separate_by="torque varied at constant speed and sump temperature, or a thermocouple in the gear",
    reference="steady thermal network of one resistance; DIN 3996 takes the wheel's temperature above the "
    "sump's from the loss in the same way; the resistance is left free here",
)
def oil_heating(
    power_loss,
    *,
    resistance=Parameter(0.02, "K/W", min=0.005, max=0.1, lower=0.0, upper=0.5, doc="contact to sump"),
):
    """The power loss heats the oil in the contacts, before it reaches the thermometer in the sump.

    Warmer oil is thinner and causes less loss; this loop is solved for its fixed point. The loss at high
    torque and speed is lower than expected from the sump temperature: a cross term of torque and speed.
    """
    return resistance * power_loss
