"""A loudspeaker: magnitude of its impedance over frequency, voltage and temperature."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from machines.cases import Array, Machine, Table
from specan.models import Model, Parameter, effect


def impedance(coil, reactance, height, detuning, second):
    """Magnitude of the coil in series with what moves."""
    width = 1 + detuning**2
    return np.hypot(coil + height / width + second, reactance - height * detuning / width)


def coil(resistance):
    """Resistance of the coil."""
    return resistance


def reactance(frequency, inductance):
    """Reactance of the coil."""
    return 2e-3 * np.pi * frequency * inductance


def tuned(resonance):
    """Resonance of cone and suspension."""
    return resonance


def height(peak):
    """Rise of the impedance at resonance."""
    return peak


def detuning(frequency, tuned, quality):
    """Distance from resonance in half widths."""
    return quality * (frequency / tuned - tuned / frequency)


def second(frequency):
    """No other resonance."""
    return 0.0 * frequency


@effect("eddy-currents", adds_to="coil", neutral={"size": 0.0})
def eddy_currents(frequency, *, size=Parameter(1, "ohm", min=0.05, max=10, lower=0, upper=30)):
    """Iron about the coil takes power, more at high frequency."""
    return size * (frequency / 1000) ** 0.7


@effect("semi-inductance", scales="reactance", neutral={"power": 0.0})
def semi_inductance(frequency, *, power=Parameter(0.1, "1", min=0.01, max=0.6, lower=0, upper=0.9)):
    """The iron shields itself, and the inductance falls with frequency."""
    return (frequency / 1000) ** -power


@effect("coil-heating", scales="coil", neutral={"rate": 0.0})
def coil_heating(level, *, rate=Parameter(0.1, "1", min=0.01, max=1, lower=0, upper=3)):
    """Loud signals heat the coil."""
    return 1 + rate * (level / 10) ** 2


@effect("warm-room", scales="coil", neutral={"rate": 0.0})
def warm_room(temperature, *, rate=Parameter(0.05, "1", min=0.005, max=0.3, lower=0, upper=1)):
    """Copper is as warm as the room."""
    return 1 + rate * (temperature - 20) / 20


@effect("soft-surround", scales="tuned", neutral={"rate": 0.0})
def soft_surround(temperature, *, rate=Parameter(0.05, "1", min=0.005, max=0.3, lower=0, upper=0.6)):
    """The surround is softer when warm."""
    return 1 - rate * (temperature - 20) / 20


@effect("level-softening", scales="tuned", neutral={"rate": 0.0})
def level_softening(level, *, rate=Parameter(0.05, "1", min=-0.4, max=0.4)):
    """The suspension changes with how far it moves."""
    return 1 - rate * level / 10


@effect("air-loss", scales="height", neutral={"rate": 0.0})
def air_loss(level, *, rate=Parameter(0.1, "1", min=0.01, max=0.7, lower=0, upper=0.9)):
    """Air whistles through the gap when loud."""
    return 1 - rate * level / 10


@effect("creep", adds_to="detuning", neutral={"size": 0.0})
def creep(frequency, tuned, *, size=Parameter(0.3, "1", min=0.03, max=5, lower=0, upper=10)):
    """The suspension gives way to slow motion."""
    return size * np.maximum(np.log(tuned / frequency), 0) * tuned / frequency


@effect("port", adds_to="second", neutral={"size": 0.0})
def port(
    frequency, *, size=Parameter(2, "ohm", min=0.1, max=30, lower=0, upper=60),
    place=Parameter(130, "Hz", min=80, max=300),
):  # fmt: skip
    """A leak of the box makes a resonance of its own."""
    return size / (1 + (4 * (frequency / place - place / frequency)) ** 2)


@effect("break-up", adds_to="second", neutral={"size": 0.0})
def break_up(
    frequency, *, size=Parameter(1, "ohm", min=0.05, max=20, lower=0, upper=60),
    place=Parameter(1000, "Hz", min=500, max=2500),
):  # fmt: skip
    """The cone bends."""
    return size / (1 + (5 * (frequency / place - place / frequency)) ** 2)


@effect("cold-lead", adds_to="coil", neutral={"size": 0.0})
def cold_lead(level, temperature, *, size=Parameter(0.1, "ohm", min=0.01, max=2, lower=0, upper=5)):
    """A corroded clamp, worse when it is cold and the current small."""
    return size / level * (45 - temperature) / 25


EFFECTS = [
    eddy_currents, semi_inductance, coil_heating, warm_room, soft_surround, level_softening, air_loss, creep,
    port, break_up,
    cold_lead,
]  # fmt: skip


def model(uncertainty: Mapping[str, float]) -> Model:
    """Conditions as in the laboratory."""
    return Model.from_function(
        impedance, coil, reactance, tuned, height, detuning, second,
        conditions={"frequency": ("Hz", 20, 4000), "level": ("V", 0.5, 10), "temperature": ("degC", 0, 40)},
        observables={"impedance": "ohm"},
        parameters={
            "resistance": (6.0, 3, 12, "ohm"), "inductance": (0.5, 0.05, 2, "mH"),
            "resonance": (55.0, 30, 100, "Hz"),
            "peak": (30.0, 5, 100, "ohm"), "quality": (3.0, 0.5, 10),
        },
        units={
            "coil": "ohm", "reactance": "ohm", "tuned": "Hz", "height": "ohm", "detuning": "1",
            "second": "ohm",
        },
        effects=EFFECTS, uncertainty=uncertainty,
    )  # fmt: skip


def plan(rng: np.random.Generator) -> Table:
    """Steps of frequency at levels, in a cold and a warm room."""
    steps = np.unique(np.round(np.geomspace(20, 4000, rng.integers(16, 24)), 0))
    warm, level, frequency = (
        x.ravel() for x in np.meshgrid([2.0, 20.0, 38.0], [0.5, 3.0, 10.0], steps, indexing="ij")
    )
    return {"frequency": frequency, "level": level, "temperature": warm}


def forms(rng: np.random.Generator) -> dict[str, float]:
    """Shapes of the truth."""
    return {
        "resistance": rng.uniform(5, 7), "inductance": rng.uniform(0.3, 0.7),
        "resonance": rng.uniform(45, 65),
        "peak": rng.uniform(20, 40), "quality": rng.uniform(2.5, 4.0), "box": rng.uniform(-0.008, 0.008),
        "skin": rng.uniform(-0.005, 0.005), "eddy": rng.uniform(0.62, 0.78), "shield": rng.uniform(900, 1800),
        "cone": rng.uniform(0.2, 0.6), "glass": rng.uniform(0.0, 0.25), "sweep": rng.uniform(1.3, 2.0),
        "whistle": rng.uniform(0.8, 1.3), "knudsen": rng.uniform(0.9, 1.2), "port": rng.uniform(110, 200),
        "port_quality": rng.uniform(3.4, 4.6), "bend": rng.uniform(800, 1600),
        "bend_quality": rng.uniform(4.2, 5.8),
        "clamp": rng.uniform(0.85, 1.15), "dip": rng.uniform(300, 500), "rub": rng.uniform(4, 8),
        "film": rng.uniform(12, 28),
    }  # fmt: skip


def readings(table: Table, f: Mapping[str, float], s: Mapping[str, float]) -> dict[str, Array]:
    """Complex impedances in series, a coil that heats until it is in balance."""
    hertz, level, warm = table["frequency"], table["level"], table["temperature"]
    kilo = hertz / 1000
    tuned = f["resonance"] * np.exp(
        -s["soft-surround"] * (warm - 20) / 20 * (1 + f["glass"] * (warm - 20) / 20)
    )
    tuned = tuned / (1 + s["level-softening"] * (level / 10) ** (1 / f["sweep"]))
    peak = f["peak"] / (1 + s["air-loss"] * (level / 10) ** f["whistle"])
    peak = peak / (
        1 + s["coil-rub"] * level**2 / (level**2 + f["rub"] ** 2) * np.exp(-0.5 * ((hertz - 55) / 20) ** 2)
    )
    below = np.logaddexp(0, 6 * np.log(tuned / hertz)) / 6
    slow = (tuned / hertz) * np.expm1(f["knudsen"] * s["creep"] / f["quality"] * below)
    detuned = f["quality"] * (hertz / tuned - tuned / hertz + slow) * (1 + f["box"] * np.log(hertz / tuned))
    cold = f["resistance"] * (1 + s["warm-room"] * (warm - 20) / 20 / (1 + 0.02 * (warm - 20) / 20))
    # A coil that is warmer takes less current: power goes with the impedance at that place of the curve.
    power = (level / 10) ** 2 / (1 + f["cone"] * kilo / (1 + kilo))
    coil = cold * 0.5 * (1 + np.sqrt(1 + 4 * s["coil-heating"] * power))
    coil = (
        coil
        + s["eddy-currents"] * kilo ** f["eddy"]
        + s["cold-lead"] / level ** f["clamp"] * (45 - warm) / 25
    )
    coil = coil + s["oil-film"] / (1 + np.exp((warm - f["film"]) / 1.5)) * np.sqrt(kilo)
    # The semi-inductance of a coil beside a shielding one, in place of a power.
    shielding = (1 + 1e3 * kilo / f["shield"]) ** (-1.9 * s["semi-inductance"]) * 2 ** (
        1.9 * s["semi-inductance"]
    )
    reactance = 2 * np.pi * kilo * f["inductance"] * (1 + f["skin"] * np.log(kilo)) * shielding
    total = coil + 1j * reactance + peak / (1 + 1j * detuned)
    total = total + s["port"] / (1 + 1j * f["port_quality"] * (hertz / f["port"] - f["port"] / hertz))
    total = total + s["break-up"] / (1 + 1j * f["bend_quality"] * (hertz / f["bend"] - f["bend"] / hertz))
    total = total - s["edge-dip"] / (1 + 1j * 6 * (hertz / f["dip"] - f["dip"] / hertz))
    return {"impedance": np.abs(total)}


MACHINE = Machine(
    model, plan, forms, readings,
    inside={
        "eddy-currents": (0, 4), "semi-inductance": (0, 0.4), "coil-heating": (0, 0.5),
        "warm-room": (0, 0.15),
        "soft-surround": (0, 0.15), "level-softening": (-0.2, 0.2), "air-loss": (0, 0.5), "creep": (0, 2),
        "port": (0, 10),
        "break-up": (0, 6), "cold-lead": (0, 0.8),
    },
    outside={"edge-dip": (0, 4), "coil-rub": (0, 1), "oil-film": (0, 3)},
)  # fmt: skip
