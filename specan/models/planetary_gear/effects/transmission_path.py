"""P1: how sharply a sensor hears the planet that is near."""

import numpy as np

from specan.models import Parameter, effect


@effect(
    "transmission-path",
    scales="transfer_path",
    neutral={"sharpness": 0.0},
    aliases=("ring-flexibility",),
    separate_by="a second sensor 60 degrees away",
    reference="Inalpolat and Kahraman, J. Sound Vib. 323 (2009) 677: a Hann window; its power is free here",
)
def transmission_path(
    carrier_turn,
    planet_angle,
    sensor_angle,
    *,
    sharpness=Parameter(1.0, "1", min=-2.5, max=3.0, lower=-2.9, upper=8.0, doc="added power of the window"),
):
    """A planet is heard over a narrower or wider part of the turn than assumed.

    Only the sidebands that the set has anyway change: in phase, orders 66h +- 3k of the article's gear.
    """
    place = (
        2 * np.pi * carrier_turn[None, None, :] + planet_angle[None, :, None] - sensor_angle[:, None, None]
    )
    return np.maximum(0.5 + 0.5 * np.cos(place), 1e-9) ** sharpness
