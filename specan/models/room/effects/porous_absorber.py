"""R2: a porous layer on a wall."""

import numpy as np

from specan.models import Parameter, effect


@effect(
    "porous-absorber",
    adds_to="wall_admittance",
    at="wall",
    neutral={"coverage": 0.0},
    aliases=("wall-impedance",),
    separate_by="a wide band: the layer takes more with frequency",
    reference="Miki 1990, J. Acoust. Soc. Jpn. (E) 11, 19-24; valid for 0.01 < f / flow resistivity < 1",
)
def porous_absorber(
    frequency,
    density,
    sound_speed,
    *,
    coverage=Parameter(0.5, "1", min=0.02, max=1.0, lower=0.0, upper=1.0, doc="covered part of the wall"),
    flow_resistivity=Parameter(15e3, "Pa*s/m^2", min=3e3, max=60e3, doc="of the material"),
    thickness=Parameter(0.03, "m", min=0.005, max=0.1, doc="of the layer on its rigid backing"),
):
    """Foam or mineral wool on a wall absorbs sound, more at higher frequencies.

    The layer's impedance is that of Miki's material before a rigid backing, Z = -j Zc cot(k d). At low
    frequencies it acts as a soft spring and lowers the modes a little.
    """
    ratio = frequency / flow_resistivity
    impedance = 1 + 0.0699 * ratio**-0.632 - 0.107j * ratio**-0.632
    wavenumber = 2 * np.pi * frequency / sound_speed * (1 + 0.109 * ratio**-0.618 - 0.160j * ratio**-0.618)
    return coverage * 1j * np.tan(wavenumber * thickness) / impedance
