"""P11: teeth part and strike when the load is small."""

import numpy as np

from specan.models import Parameter, effect


@effect(
    "backlash",
    adds_to="ring_error",
    neutral={"bounce": 0.0},
    separate_by="a torque above which it is gone; jumps when the speed goes up and down",
    reference="Kahraman and Blankenship, J. Appl. Mech. 64 (1997) 217: subharmonic motion with clearance",
)
def backlash(
    carrier_turn,
    nominal_phase,
    ring_teeth,
    mean_load,
    *,
    bounce=Parameter(1.0, "um", min=0.1, max=20.0, lower=-200.0, upper=200.0, doc="at vanishing load"),
    load=Parameter(100.0, "N", min=5.0, max=500.0, doc="of a mesh, beyond which teeth stay together"),
):
    """Teeth that separate return at every second mesh:

    lines at half the order of the mesh. It occurs at small torque only. The form is that of a subharmonic
    motion; its size is free.
    """
    at = np.pi * (ring_teeth * carrier_turn[None, :] + nominal_phase[1][:, None])
    return bounce * np.exp(-np.mean(mean_load) / load) * np.cos(at)
