"""A refrigeration compressor: mass flow over evaporating and condensing temperature and speed."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from machines.cases import Array, Machine, Table
from specan.models import Model, Parameter, effect


def mass_flow(density, turning, volumetric, leak, swept):
    """What the compressor delivers."""
    return density * swept * turning / 60 * volumetric - leak


def turning(speed):
    """Speed of the shaft."""
    return speed


def suction(evaporating):
    """Saturated vapour in the inlet, bar: the refrigerant 134a by Antoine."""
    return np.exp(10.78 - 2705 / (evaporating + 273.15))


def discharge(condensing):
    """Pressure after the compressor, bar."""
    return np.exp(10.78 - 2705 / (condensing + 273.15))


def density(suction, evaporating):
    """Of the vapour, g/l, with 10 K of superheat."""
    return 100 * suction / (0.0815 * (evaporating + 283.15)) / (1 - 0.018 * suction)


def volumetric(suction, discharge, clearance):
    """What is left in the clearance expands, by Clausius."""
    return 1 - clearance * ((discharge / suction) ** (1 / 1.1) - 1)


def leak(suction):
    """None in the drawing."""
    return 0.0 * suction


@effect("piston-leakage", adds_to="leak", neutral={"size": 0.0})
def piston_leakage(suction, discharge, *, size=Parameter(0.1, "g/s/bar", min=0.01, max=2, lower=0, upper=5)):
    """Gas goes past the rings."""
    return size * (discharge - suction)


@effect("valve-leakage", adds_to="leak", neutral={"size": 0.0})
def valve_leakage(discharge, *, size=Parameter(0.1, "g/s/bar", min=0.01, max=2, lower=0, upper=5)):
    """A discharge valve does not close; the jet is as fast as sound."""
    return size * discharge


@effect("suction-heating", scales="density", neutral={"rate": 0.0})
def suction_heating(
    evaporating, condensing, *, rate=Parameter(0.1, "1", min=0.01, max=0.5, lower=0, upper=0.9)
):
    """Walls of the hot side warm what comes in."""
    return 1 - rate * (condensing - evaporating) / 100


@effect("valve-throttling", scales="volumetric", neutral={"rate": 0.0})
def valve_throttling(turning, *, rate=Parameter(0.05, "1", min=0.005, max=0.3, lower=0, upper=0.9)):
    """Fast gas loses pressure in the suction valve."""
    return 1 - rate * (turning / 2000) ** 2


@effect("late-valve", scales="volumetric", neutral={"size": 0.0})
def late_valve(
    turning, *, size=Parameter(0.1, "1", min=0.01, max=1, lower=0, upper=2),
    onset=Parameter(2000, "1/min", min=1200, max=2800),
):  # fmt: skip
    """Above some speed the valve closes too late."""
    return 1 - size * np.maximum(turning - onset, 0) / 1000


@effect("motor-slip", scales="turning", neutral={"rate": 0.0})
def motor_slip(
    suction, discharge, *, rate=Parameter(0.005, "1/bar", min=0.0005, max=0.03, lower=0, upper=0.05)
):
    """The motor turns more slowly under load."""
    return 1 - rate * (discharge - suction)


@effect("ram-charging", scales="volumetric", neutral={"size": 0.0})
def ram_charging(
    turning, *, size=Parameter(0.03, "1", min=0.003, max=0.3, lower=0, upper=1),
    place=Parameter(1900, "1/min", min=1200, max=2600),
):  # fmt: skip
    """The suction pipe is in tune with the strokes."""
    return 1 + size * np.exp(-0.5 * ((turning - place) / 250) ** 2)


@effect("flood-back", scales="density", neutral={"size": 0.0})
def flood_back(
    evaporating, *, size=Parameter(0.05, "1", min=0.005, max=0.5, lower=0, upper=1),
    onset=Parameter(-5, "degC", min=-15, max=5),
):  # fmt: skip
    """Drops come along when the evaporator is warm."""
    return 1 + size * np.maximum(evaporating - onset, 0) / 10


@effect("oil-foam", scales="density", neutral={"rate": 0.0})
def oil_foam(turning, suction, *, rate=Parameter(0.05, "1", min=0.005, max=0.4, lower=0, upper=0.9)):
    """Oil takes room in the inlet, the more the faster it is stirred and the thinner the gas."""
    return 1 - rate * turning / 2000 / suction


@effect("suction-zero", adds_to="suction", neutral={"offset": 0.0})
def suction_zero(*, offset=Parameter(0.02, "bar", min=-0.2, max=0.2)):
    """The gauge of the suction side has a zero of its own."""
    return offset


@effect("wall-expansion", scales="volumetric", neutral={"rate": 0.0})
def wall_expansion(turning, *, rate=Parameter(0.05, "1", min=0.005, max=0.3, lower=0, upper=0.9)):
    """Slow gas takes heat of the cylinder."""
    return 1 - rate * np.sqrt(1000 / turning)


EFFECTS = [
    piston_leakage, valve_leakage, suction_heating, valve_throttling, late_valve, motor_slip, ram_charging,
    flood_back,
    oil_foam, suction_zero, wall_expansion,
]  # fmt: skip


def model(uncertainty: Mapping[str, float]) -> Model:
    """Conditions as in the calorimeter."""
    return Model.from_function(
        mass_flow, turning, suction, discharge, density, volumetric, leak,
        conditions={"evaporating": ("degC", -25, 10), "condensing": ("degC", 25, 55), "speed": ("1/min", 900, 3000)},
        observables={"mass_flow": "g/s"},
        parameters={"swept": (0.06, 0.02, 0.2, "l"), "clearance": (0.03, 0.005, 0.1)},
        units={
            "turning": "1/min", "suction": "bar", "discharge": "bar", "density": "g/l", "volumetric": "1",
            "leak": "g/s",
        },
        effects=EFFECTS, uncertainty=uncertainty,
    )  # fmt: skip


def plan(rng: np.random.Generator) -> Table:
    """A speed at a time, the condenser warmer and warmer."""
    speeds = np.round(np.linspace(900, 3000, rng.integers(5, 8)), -1)
    speed, condensing, evaporating = (
        x.ravel()
        for x in np.meshgrid(speeds, [25.0, 35.0, 45.0, 55.0], [-25.0, -13.0, -2.0, 10.0], indexing="ij")
    )
    return {"evaporating": evaporating, "condensing": condensing, "speed": speed}


def forms(rng: np.random.Generator) -> dict[str, float]:
    """The refrigerant and the shapes of the truth."""
    return {
        "swept": rng.uniform(0.045, 0.08), "clearance": rng.uniform(0.02, 0.04),
        "exponent": rng.uniform(1.04, 1.16),
        "real": rng.uniform(-0.006, 0.006), "jet": rng.uniform(0.0, 0.15), "choke": rng.uniform(0.5, 0.6),
        "film": rng.uniform(0.0, 0.2), "valve": rng.uniform(1.8, 2.2), "gas": rng.uniform(0.0, 0.15),
        "late": rng.uniform(1500, 2400), "late_width": rng.uniform(60, 180), "slip": rng.uniform(0.9, 1.15),
        "pipe": rng.uniform(1500, 2300), "pipe_width": rng.uniform(180, 260), "drops": rng.uniform(-11, 1),
        "drops_width": rng.uniform(0.7, 2), "stir": rng.uniform(0.85, 1.2), "cylinder": rng.uniform(0.4, 0.6),
        "stick": rng.uniform(32, 48), "frost": rng.uniform(-16, -4), "hunting": rng.uniform(5, 8),
    }  # fmt: skip


def readings(table: Table, f: Mapping[str, float], s: Mapping[str, float]) -> dict[str, Array]:
    """Another exponent of expansion, a gas that is a little more real, jets by their equation."""
    cold, hot, n = table["evaporating"], table["condensing"], table["speed"]
    inlet, outlet = (
        np.exp(10.78 - 2705 / (t + 273.15)) * (1 + f["real"] * (t - 10) / 30) for t in (cold, hot)
    )
    inlet = inlet + s["suction-zero"] * (1 + 0.002 * cold)
    density = 100 * inlet / (0.0815 * (cold + 283.15)) / (1 - 0.018 * inlet - 0.0004 * inlet**2)
    turned = n * (1 - s["motor-slip"] * (outlet - inlet) ** f["slip"] * 8 ** (1 - f["slip"]))
    warmed = s["suction-heating"] * (hot - cold) / 100 * (1500 / n) ** f["film"]
    density = density / (1 + warmed)
    wet = f["drops_width"] * np.logaddexp(0, (cold - f["drops"]) / f["drops_width"]) / 10
    density = density * (1 + s["flood-back"] * wet)
    density = density * (1 - s["frost"] * np.exp(-0.5 * ((cold - f["frost"]) / 3) ** 2))
    density = density / (1 + s["oil-foam"] * (n / 2000) ** f["stir"] / inlet)
    left = f["clearance"] * ((outlet / inlet) ** (1 / f["exponent"]) - 1)
    throttled = 1 - s["valve-throttling"] * (n / 2000) ** f["valve"] * (inlet / 2) ** f["gas"]
    closed = 1 - s["late-valve"] * f["late_width"] * np.logaddexp(0, (n - f["late"]) / f["late_width"]) / 1000
    tuned = 1 + s["ram-charging"] / (1 + ((n - f["pipe"]) / f["pipe_width"]) ** 2 * 0.7)
    walls = 1 - s["wall-expansion"] * (1000 / n) ** f["cylinder"]
    stuck = 1 - s["stuck-unloader"] / (1 + np.exp(-(hot - f["stick"]) / 1.5)) * (n < 2200)
    volumetric = (1 - left) * throttled * closed * tuned * walls * stuck
    # Saint-Venant and Wantzel below the speed of sound, over what a linear law gives at 8 bar.
    part = np.clip(inlet / outlet, f["choke"], 1)
    leak = s["piston-leakage"] * np.sqrt(outlet**2 - inlet**2) * (1 - f["jet"] * inlet / outlet)
    leak = leak + s["valve-leakage"] * outlet * np.sqrt(1 - ((part - f["choke"]) / (1 - f["choke"])) ** 2)
    return {
        "mass_flow": density * f["swept"] * turned / 60 * volumetric
        - leak
        + s["hunting"] * np.sin(hot / f["hunting"])
    }


MACHINE = Machine(
    model, plan, forms, readings,
    inside={
        "piston-leakage": (0, 0.4), "valve-leakage": (0, 0.3), "suction-heating": (0, 0.35),
        "valve-throttling": (0, 0.15),
        "late-valve": (0, 0.3), "motor-slip": (0, 0.012), "ram-charging": (0, 0.15), "flood-back": (0, 0.2),
        "oil-foam": (0, 0.2), "suction-zero": (-0.1, 0.1), "wall-expansion": (0, 0.2),
    },
    outside={"stuck-unloader": (0, 0.2), "frost": (0, 0.2), "hunting": (0, 1)},
    setting={"speed": 0.3},
)  # fmt: skip
