"""What the instruments make of the sound field: gains, delays, the vibrometer."""

from __future__ import annotations

import numpy as np

from specan.models.quantity import quantity


@quantity(unit="s", axes=("microphone",))
def receiver_delay(card_delay, card_of_microphone):
    """Delay of each microphone channel: that of its card."""
    return card_delay[card_of_microphone]


@quantity(unit="Pa*s/m", axes=("place",))
def indicated_frf(
    frequency, field, receiver_gain, receiver_delay, vibrometer_delay, vibrometer_gain, microphone_at_place
):
    """Transfer function as the instruments indicate it, array (places of microphones, lines)."""
    # the microphones of a card are late together
    delay, own = np.unique(receiver_delay[microphone_at_place] - vibrometer_delay, return_inverse=True)
    turned = np.exp(-2j * np.pi * np.outer(delay, frequency)) / vibrometer_gain
    return field * (receiver_gain[microphone_at_place, None] * turned[own])
