"""R3: a panel that resonates before an air gap."""

import numpy as np

from specan.models import Parameter, effect


@effect(
    "panel-resonance",
    adds_to="wall_admittance",
    at="wall",
    neutral={"coverage": 0.0},
    aliases=("wall-impedance", "helmholtz-resonator"),
    separate_by="bandwidth, and a scan of the panel with an accelerometer",
    reference="Kuttruff, Room Acoustics, ch. 2 (panel absorber); Wulbusch et al. 2023, arXiv 2308.01788",
)
def panel_resonance(
    frequency,
    density,
    sound_speed,
    *,
    coverage=Parameter(
        0.5, "1", min=0.01, max=5.0, lower=0.0, doc="vibrating part of the wall, at that mass"
    ),
    mass=Parameter(5.0, "kg/m^2", min=1.0, max=20.0, fixed=True, doc="surface mass, as known"),
    resonance=Parameter(150.0, "Hz", min=20.0, max=800.0, doc="resonance frequency"),
    loss_factor=Parameter(0.1, "1", min=0.01, max=0.5, doc="loss factor of the panel"),
):
    """A panel on the air behind it is a mass on a spring: it takes sound around its resonance only.

    Below the resonance it is a spring (modes fall), above it a mass (modes rise), at it an absorber.
    A sound field shows the ratio of coverage and mass only: the mass keeps its default, and a coverage
    above one means that the panel is lighter than declared.
    """
    omega, omega0 = 2 * np.pi * frequency, 2 * np.pi * resonance
    impedance = mass * (loss_factor * omega0 + 1j * (omega - omega0**2 / omega))
    return coverage * density * sound_speed / impedance
