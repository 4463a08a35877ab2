"""P17: the sun's shaft twists."""

import numpy as np

from specan.models import Parameter, effect


@effect(
    "shaft-flexibility",
    adds_to="shaft_receptance",
    neutral={"compliance": 0.0},
    aliases=("housing-resonance",),
    separate_by="a run over speed, and the torque of the sun's shaft",
    reference="one torsional mode: c / (1 - (f/f0)^2 + 2 j z f/f0)",
)
def shaft_flexibility(
    *,
    compliance=Parameter(2e-5, "rad/(N*m)", min=1e-6, max=1e-3, lower=0.0, upper=0.1, doc="static twist"),
    resonance=Parameter(900.0, "Hz", min=50.0, max=5000.0, lower=10.0, upper=20000.0, doc="of sun on shaft"),
    damping=Parameter(0.03, "1", min=0.005, max=0.2, lower=0.001, upper=0.5, doc="damping ratio"),
):
    """The sun follows the forces of its meshes on a shaft that twists: sidebands near a fixed frequency change."""
    return Twist(compliance, resonance, damping)


class Twist:
    """Receptance against angular frequency that adds to another one."""

    def __init__(self, compliance: float, resonance: float, damping: float) -> None:
        self.parts = ((compliance, resonance, damping),)

    def __call__(self, omega):
        """Twist over torque, rad/(N m)."""
        found = np.zeros(np.shape(omega), complex)
        for compliance, resonance, damping in self.parts:
            ratio = np.asarray(omega) / (2 * np.pi * resonance)
            found += compliance / (1 - ratio**2 + 2j * damping * ratio)
        return found

    def __radd__(self, other):
        return lambda omega: other(omega) + self(omega)
