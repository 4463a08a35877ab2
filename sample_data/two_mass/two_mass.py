"""Two masses in a row on a spring, driven by a shaker at the first: displacement over force."""

import numpy as np

from specan.models import Frf, Model, Parameter, effect


def at_1(frequency, mass_1, stiffness_1, damping_1):
    """Force a metre that the first mass and its foot take."""
    s = 2j * np.pi * frequency
    return mass_1 * s**2 + damping_1 * s + stiffness_1


def at_2(frequency, mass_2):
    """Force a metre that the second mass takes."""
    return mass_2 * (2j * np.pi * frequency) ** 2


def link(frequency, stiffness_2, damping_2):
    """Force a metre of the spring between them."""
    return stiffness_2 + 2j * np.pi * frequency * damping_2


def x1(at_1, at_2, link):
    """Displacement of the driven mass, um for each N."""
    return 1e6 * (at_2 + link) / ((at_1 + link) * (at_2 + link) - link**2)


def x2(at_1, at_2, link):
    """Displacement of the second mass, um for each N."""
    return 1e6 * link / ((at_1 + link) * (at_2 + link) - link**2)


def sprung(frequency, mass, tuned, loss):
    """Force a metre of a mass on a spring of its own."""
    ratio = frequency / tuned
    spring = 1 + 2j * loss * ratio
    return -mass * (2 * np.pi * frequency) ** 2 * spring / (spring - ratio**2)


MASS = Parameter(0.05, "kg", min=0.005, max=0.5, lower=0, upper=2)
TUNED = Parameter(30, "Hz", min=10, max=60)
LOSS = Parameter(0.02, min=0.003, max=0.2)


@effect("sprung-mass-on-1", adds_to="at_1", neutral={"mass": 0})
def sprung_mass_on_1(frequency, *, mass=MASS, tuned=TUNED, loss=LOSS):
    """Something swings on a spring of its own at the first mass."""
    return sprung(frequency, mass, tuned, loss)


@effect("sprung-mass-on-2", adds_to="at_2", neutral={"mass": 0})
def sprung_mass_on_2(frequency, *, mass=MASS, tuned=TUNED, loss=LOSS):
    """Something swings on a spring of its own at the second mass."""
    return sprung(frequency, mass, tuned, loss)


@effect("second-foot", adds_to="at_2", neutral={"stiffness": 0})
def second_foot(*, stiffness=Parameter(1e3, "N/m", min=100, max=1e5, lower=0, upper=1e6)):
    """The second mass touches the ground as well."""
    return stiffness


@effect("structural-loss", adds_to="link", neutral={"loss": 0})
def structural_loss(*, loss=Parameter(300, "N/m", min=10, max=5e3, lower=0, upper=1e5)):
    """The spring between them loses the same energy a cycle at every frequency."""
    return 1j * loss


@effect("late-sensors", scales=("x1", "x2"), neutral={"delay": 0})
def late_sensors(frequency, *, delay=Parameter(0.2, "ms", min=-2, max=2, lower=-5, upper=5)):
    """The displacement sensors answer late."""
    late = np.exp(-2j * np.pi * frequency * 1e-3 * delay)
    return {"x1": late, "x2": late}


model = Model.from_function(
    *(x1, x2, at_1, at_2, link),
    conditions={"frequency": ("Hz", 8, 80)},
    observables={
        "x1": Frf("um/N", response="x1", reference="force"),
        "x2": Frf("um/N", response="x2", reference="force"),
    },
    parameters={
        "mass_1": (2, 1.7, 2.3, "kg"),
        "mass_2": (1, 0.85, 1.15, "kg"),
        "stiffness_1": (4e4, 2e4, 8e4, "N/m"),
        "stiffness_2": (5e4, 2e4, 9e4, "N/m"),
        "damping_1": (8, 1, 30, "N*s/m"),
        "damping_2": (4, 0.5, 30, "N*s/m"),
    },
    units={"at_1": "N/m", "at_2": "N/m", "link": "N/m"},
    effects=[sprung_mass_on_1, sprung_mass_on_2, second_foot, structural_loss, late_sensors],
)
