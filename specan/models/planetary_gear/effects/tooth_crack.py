"""P8: one tooth of the sun is softer than the others."""

import numpy as np

from specan.models import Parameter, effect


@effect(
    "tooth-crack",
    adds_to="sun_error",
    neutral={"softer": 0.0},
    aliases=("pitch-errors",),
    separate_by="torque: the pulses grow with the load, those of a pitch error do not",
    reference="Chaari, Fakhfakh and Haddar, Eur. J. Mech. A 28 (2009) 461: a dip of the mesh stiffness while the tooth "
    "carries",
)
def tooth_crack(
    carrier_turn,
    planet_angle,
    sun_order,
    sun_teeth,
    mesh_geometry,
    mean_load,
    load_stiffness,
    *,
    softer=Parameter(
        0.1, "1", min=0.01, max=0.3, lower=-0.5, upper=0.9, doc="part of the stiffness that is missing"
    ),
    place=Parameter(
        0.0, "1", min=0.0, max=1.0, lower=-1.0, upper=2.0, doc="of the tooth, in turns of the sun", fixed=True
    ),
):
    """A cracked tooth deflects more under load, with each planet once a turn of the sun: pulses 8.25 times a turn.

    Many lines of 2.75 orders; the pulses rise with the load.
    """
    turn = (sun_order * carrier_turn[None, :] - planet_angle[:, None] / (2 * np.pi) - place) % 1.0
    part = turn * sun_teeth / mesh_geometry[0, 1]
    dip = np.where(part < 1.0, np.sin(np.pi * np.clip(part, 0, 1)) ** 2, 0.0)
    return -softer * np.mean(mean_load / load_stiffness) * dip
