"""Effects of the contact of teeth, alike in all meshes."""

import numpy as np

from specan.models import Parameter, effect

HARMONICS = 3


@effect(
    "mesh-damping",
    adds_to=("stiffness_change", "damping_scale"),
    neutral={"stiffness": 0.0, "damping": 0.0},
    separate_by="a run over speed: it moves a resonance of the gears",
    reference="ISO 6336-1:2019, clause 9 (mesh stiffness within 30 %); Kahraman and Singh 1990 (damping 0.01 to 0.1)",
)
def mesh_damping(
    *,
    stiffness=Parameter(
        0.1, "1", min=-0.3, max=0.3, lower=-0.9, upper=3.0, doc="relative change of the stiffness"
    ),
    damping=Parameter(
        1.0, "1", min=-0.9, max=4.0, lower=-0.95, upper=50.0, doc="relative change of the damping"
    ),
):
    """Lubricated teeth are stiffer and more damped, or less, than the dry contact law says.

    The ratios of the mesh harmonics change, and no new line appears.
    """
    return {"stiffness_change": stiffness * np.ones(2), "damping_scale": damping}


@effect(
    "tip-relief",
    adds_to="tip_relief",
    aliases=("mesh-damping", "tooth-friction"),
    separate_by="torque: at one torque the first harmonic of the mesh is least",
    reference="ISO 21771:2007, 7.3; linear relief over the parts of double contact (Munro 1989)",
)
def tip_relief(*, depth=Parameter(5.0, "um", min=0.0, max=40.0, lower=0.0, upper=200.0, doc="at the tip")):
    """Material taken off the tips lets pairs take their load gradually: the mesh is quietest at one torque."""
    return depth


@effect(
    "tooth-friction",
    adds_to="friction_share",
    separate_by="a sensor across the line of action",
    reference="mu F sign(sliding), which turns at the pitch point; Vaishya and Singh, J. Sound Vib. 243 (2001)",
)
def tooth_friction(
    carrier_turn,
    nominal_phase,
    ring_teeth,
    *,
    coefficient=Parameter(0.05, "1", min=0.02, max=0.1, lower=-0.5, upper=1.0, doc="coefficient of friction"),
):
    """Sliding reverses at the pitch point, and with it the friction: a square wave at the order of the mesh."""
    at = 2 * np.pi * (ring_teeth * carrier_turn[None, :] + nominal_phase[1][:, None])
    return coefficient * 4 / np.pi * sum(np.sin((2 * k - 1) * at) / (2 * k - 1) for k in range(1, HARMONICS))


@effect(
    "backlash",
    adds_to="ring_error",
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
