"""Effects of a wall over its whole area."""

import numpy as np

from specan.models import Parameter, effect


@effect(
    "wall-impedance",
    adds_to="wall_admittance",
    at="wall",
    aliases=("panel-resonance", "air-absorption", "wall-data"),
    separate_by="a wide band: a porous layer absorbs more with frequency, a panel around its resonance only; "
    "microphones near the wall",
    reference="Kuttruff, Room Acoustics, ch. 2 (locally reacting walls); surfaces in parallel add. A matched lining "
    "has a resistance of rho c to 2 rho c, a conductance of 0.5 to 1 (ibid., absorption near one)",
)
def wall_impedance(
    frequency,
    density,
    sound_speed,
    third_octave_hz,
    *,
    conductance=Parameter(0.05, "1", min=0.001, max=1.2, lower=0.0, upper=3.0, doc="rho c over resistance"),
    mass=Parameter(0.0, "kg/m^2", min=0.0, max=500.0, lower=0.0, doc="surface mass"),
    stiffness=Parameter(0.0, "Pa/m", min=0.0, max=2e9, lower=0.0, doc="stiffness per unit area"),
):
    """One wall absorbs energy (resistance) and shifts the modes that reach it (mass, stiffness).

    Its surface impedance is Z = R + j (w m - s / w); each point of the wall responds to the pressure at that
    point only. Modes that move along the wall's normal broaden most. With parameters that a study
    makes free in every third octave (per = "third_octave"), they are joined by straight lines over the
    logarithm of frequency; a mass that may be negative then represents any reactance.
    """
    omega = 2 * np.pi * frequency
    g, m, s = (_at(frequency, third_octave_hz, value) for value in (conductance, mass, stiffness))
    reactance = (omega * m - s / omega) / (density * sound_speed)
    return g / (1 + 1j * g * reactance)


def _at(frequency, mid_hz, value):
    """A number as it is; one a band, line by line."""
    if np.ndim(value) == 0 or np.shape(value) != np.shape(mid_hz):
        return value
    return np.interp(np.log(frequency), np.log(mid_hz), value)


@effect(
    "porous-absorber",
    adds_to="wall_admittance",
    at="wall",
    aliases=("wall-impedance", "wall-data"),
    separate_by="a wide band: the layer absorbs more with frequency",
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


@effect(
    "panel-resonance",
    adds_to="wall_admittance",
    at="wall",
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


ERROR = Parameter(
    1.0, "1", min=-3.0, max=3.0, lower=-30.0, upper=30.0, per="octave", doc="in standard uncertainties"
)


@effect(
    "wall-data",
    adds_to="wall_data_error",
    at="known_wall",
    neutral={"conductance": 0.0, "susceptance": 0.0},
    separate_by="measuring the wall's impedance again",
    reference="errors of the stated admittance, straight between octaves over the logarithm of frequency",
)
def wall_data(frequency, octave_hz, *, conductance=ERROR, susceptance=ERROR):
    """A wall is not as the rig file states, by so many standard uncertainties in each octave."""
    real, imaginary = (_at(frequency, octave_hz, part) for part in (conductance, susceptance))
    return real + 1j * imaginary


@effect(
    "leaning-wall",
    adds_to="wall_lean",
    at="lean",
    separate_by="a spirit level or a plumb line; the room's edge measured at both ends of the wall",
    reference="Morse & Feshbach, Methods of Theoretical Physics, ch. 9.2 (perturbed boundary). Built walls are within "
    "8 mm over 1 to 3 m (DIN 18202:2019, table 2); walls of studios are splayed by some degrees",
)
def leaning_wall(
    *, angle=Parameter(0.5, "deg", min=-3.0, max=3.0, lower=-6.0, upper=6.0, doc="about the wall's middle")
):
    """A wall is not parallel to the one opposite: modes mix with others that differ by one node along it.

    The room is larger at the far end of that edge where the angle is positive.
    """
    return np.tan(angle)
