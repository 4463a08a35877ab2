"""P7: pitch errors of the sun that add up around it."""

import numpy as np

from specan.models import Parameter, effect

HARMONICS = 8


@effect(
    "pitch-errors",
    adds_to="sun_error",
    neutral={"cumulative": 0.0},
    aliases=("sun-runout", "tooth-crack"),
    separate_by="the whole comb of the sun's turn: runout has its first line only, a crack grows with load",
    reference="ISO 1328-1:2013 (cumulative pitch deviation); a spectrum that falls with 1/k^2 is an assumption",
)
def pitch_errors(
    carrier_turn,
    planet_angle,
    sun_order,
    *,
    cumulative=Parameter(
        5.0, "um", min=-10.0, max=10.0, lower=-200.0, upper=200.0, doc="amplitude of the second line"
    ),
    phase=Parameter(0.5, "rad", min=0.0, max=6.3, lower=-20.0, upper=20.0, doc="place on the sun"),
):
    """The pitch of the sun's teeth varies: lines at multiples of the turn of the sun, from the second on.

    To a sensor on the ring, multiples of the shaft's turn beside the mesh: 66h +- 7.5 and +- 4.5 of the
    article's
    gear. The first multiple belongs to runout.
    """
    at = 2 * np.pi * sun_order * carrier_turn[None, :] - planet_angle[:, None]
    return cumulative * sum(4.0 / k**2 * np.cos(k * (at - phase)) for k in range(2, HARMONICS + 1))
