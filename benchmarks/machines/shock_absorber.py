"""Shock absorbers of a lot, three of them: force over the rod's speed, its place, and temperature."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from machines.cases import Array, Machine, Table
from specan.models import Model, Parameter, effect


def force(hydraulic, friction, gas):
    """Force at the rod, pulling positive."""
    return hydraulic + friction - gas


def hydraulic(velocity, slope, knee, ratio):
    """Oil through the piston: linear when slow, less than that when the valves open."""
    return slope * velocity / (1 + np.abs(velocity) / knee) * np.where(velocity > 0, 1.0, ratio)


def friction(velocity):
    """None in the drawing."""
    return 0.0 * velocity


def gas(position, preload, stiffness):
    """The gas pushes the rod out."""
    return preload - stiffness * position


@effect("seal-friction", adds_to="friction", neutral={"size": 0.0})
def seal_friction(velocity, *, size=Parameter(20, "N", min=2, max=200, lower=0, upper=500)):
    """The rod's seal rubs."""
    return size * np.tanh(velocity / 0.03)


@effect("side-load", adds_to="friction", neutral={"size": 0.0})
def side_load(velocity, position, *, size=Parameter(20, "N", min=2, max=200, lower=0, upper=500)):
    """Off its middle the rod leans on its guide."""
    return size * np.abs(position) / 40 * np.tanh(velocity / 0.03)


@effect("thin-oil", scales="hydraulic", neutral={"rate": 0.0})
def thin_oil(temperature, *, rate=Parameter(0.1, "1", min=0.01, max=0.6, lower=0, upper=0.9)):
    """Warm oil flows more easily."""
    return 1 - rate * (temperature - 20) / 50


@effect("worn-piston", scales="hydraulic", neutral={"share": 0.0})
def worn_piston(
    velocity, *, share=Parameter(0.2, "1", min=0.02, max=0.8, lower=0, upper=1),
    scale=Parameter(0.15, "m/s", min=0.04, max=0.5),
):  # fmt: skip
    """A gap about the piston, which only slow motion notices."""
    return 1 - share * np.exp(-np.abs(velocity) / scale)


@effect("foaming", scales="hydraulic", neutral={"rate": 0.0})
def foaming(velocity, temperature, *, rate=Parameter(0.1, "1", min=0.01, max=0.6, lower=0, upper=0.9)):
    """Hot oil that is pumped fast takes up gas."""
    return 1 - rate * np.abs(velocity) * np.maximum(temperature - 40, 0) / 40


@effect("cavitation", adds_to="hydraulic", neutral={"size": 0.0})
def cavitation(
    velocity, *, size=Parameter(300, "N*s/m", min=20, max=3000, lower=0, upper=5000),
    onset=Parameter(0.6, "m/s", min=0.3, max=1),
):  # fmt: skip
    """Pushed in fast, the oil tears off the piston."""
    return size * np.maximum(-velocity - onset, 0)


@effect("blow-off", adds_to="hydraulic", neutral={"size": 0.0})
def blow_off(
    velocity, *, size=Parameter(300, "N*s/m", min=20, max=3000, lower=0, upper=5000),
    onset=Parameter(0.6, "m/s", min=0.2, max=1),
):  # fmt: skip
    """A valve opens when the rod is pulled fast."""
    return -size * np.maximum(velocity - onset, 0)


@effect("bypass-groove", scales="hydraulic", neutral={"depth": 0.0})
def bypass_groove(position, *, depth=Parameter(0.1, "1", min=0.01, max=0.6, lower=0, upper=0.9)):
    """A groove in the tube lets oil pass in the middle of the stroke."""
    return 1 - depth * (1 - (position / 40) ** 2)


@effect("gas-compression", adds_to="gas", neutral={"size": 0.0})
def gas_compression(position, *, size=Parameter(20, "N", min=2, max=300, lower=0, upper=1000)):
    """The gas is stiffer the more it is pressed."""
    return size * (position / 40) ** 2


@effect("warm-gas", scales="gas", neutral={"rate": 0.0})
def warm_gas(temperature, *, rate=Parameter(0.1, "1", min=0.02, max=1, lower=0, upper=2)):
    """The gas is warm, and the oil takes some of its room."""
    return 1 + rate * (temperature - 20) / 50


EFFECTS = [
    seal_friction, side_load, thin_oil, worn_piston, foaming, cavitation, blow_off, bypass_groove,
    gas_compression, warm_gas,
]  # fmt: skip
BY_SPECIMEN = ("slope", "preload", "ratio")  # parameters that the truth can give each specimen anew


def model(uncertainty: Mapping[str, float]) -> Model:
    """Conditions as on the bench; of each parameter specan asks whether it differs between specimens."""
    return Model.from_function(
        force, hydraulic, friction, gas,
        conditions={"velocity": ("m/s", -1.2, 1.2), "position": ("mm", -40, 40), "temperature": ("degC", -10, 80)},
        observables={"force": "N"},
        parameters={
            "slope": (3000.0, 800, 8000, "N*s/m"), "knee": (0.5, 0.1, 3, "m/s"), "ratio": (0.5, 0.1, 1.5),
            "preload": (150.0, 20, 500, "N"), "stiffness": (1.0, 0, 8, "N/mm"),
        },
        units={"hydraulic": "N", "friction": "N", "gas": "N"},
        effects=EFFECTS, uncertainty=uncertainty, groups=("specimen",),
    )  # fmt: skip


def plan(rng: np.random.Generator) -> Table:
    """Speeds both ways, one specimen after the other, warmer from one to the next sweep."""
    speeds = np.geomspace(0.03, 1.2, rng.integers(6, 9))
    both = [*-speeds[::-1], *speeds]
    rows = [
        (velocity, position, warm + rng.normal(0, 1), name)
        for name in "ABC"
        for warm in (0.0, 35.0, 70.0)
        for velocity, position in zip(both, rng.choice([-40, -20, 0, 20, 40], len(both)), strict=True)
    ]  # fmt: skip
    velocity, position, warm, name = zip(*rows, strict=True)
    return {
        "velocity": np.round(velocity, 3), "position": np.array(position, dtype=float),
        "temperature": np.round(warm, 1),
        "specimen": np.array(name),
    }  # fmt: skip


def forms(rng: np.random.Generator) -> dict[str, float]:
    """Shapes of valves, oil and gas of the truth."""
    return {
        "slope": rng.uniform(2500, 4000), "knee": rng.uniform(0.4, 0.8), "ratio": rng.uniform(0.35, 0.6),
        "bend": rng.uniform(0.98, 1.02), "preload": rng.uniform(120, 220), "stiffness": rng.uniform(0.5, 1.5),
        "second": rng.uniform(0.3, 1.2), "stribeck": rng.uniform(0.0, 0.25), "oil": rng.uniform(0.4, 0.9),
        "gap": rng.uniform(0.1, 0.3), "foam": rng.uniform(1.0, 1.5), "tear": rng.uniform(0.45, 0.8),
        "valve": rng.uniform(0.4, 0.8), "round": rng.uniform(0.02, 0.07), "adiabatic": rng.uniform(1.2, 1.4),
        "flutter": rng.uniform(0.25, 0.7), "stop": rng.uniform(25, 32), "wax": rng.uniform(8, 20),
    }  # fmt: skip


def readings(table: Table, f: Mapping[str, float], s: Mapping[str, float]) -> dict[str, Array]:
    """Valves that open gradually, oil by an exponential, gas that is compressed adiabatically."""
    v, x, warm, name = table["velocity"], table["position"], table["temperature"], table["specimen"]
    lot = 1.0 * (name == "B") - f["second"] * (name == "C")
    off = {n: 1 + s[f"{n}-differs-between-specimens"] * lot for n in BY_SPECIMEN}
    speed = np.abs(v)
    opened = (1 + (speed / f["knee"]) ** f["bend"]) ** (-1 / f["bend"])
    oil = np.exp(-s["thin-oil"] * (warm - 20) / 50 - 0.1 * f["oil"] * s["thin-oil"] * ((warm - 20) / 50) ** 2)
    oil = oil * (1 - s["worn-piston"] / (1 + (speed / f["gap"]) ** 2))
    hot = 5 * np.logaddexp(0, (warm - 40) / 5) / 40
    oil = oil / (1 + s["foaming"] * speed ** f["foam"] * hot)
    oil = oil * (1 - s["bypass-groove"] * np.cos(np.pi * x / 80) ** 1.5)
    oil = oil * (1 + s["wax"] / (1 + np.exp((warm - f["wax"]) / 2)) * np.exp(-speed / 0.3))
    flow = f["slope"] * off["slope"] * v * opened * np.where(v > 0, 1, f["ratio"] * off["ratio"]) * oil
    flow = flow + s["cavitation"] * f["round"] * np.logaddexp(0, (-v - f["tear"]) / f["round"])
    flow = flow - s["blow-off"] * f["round"] * np.logaddexp(0, (v - f["valve"]) / f["round"])
    flow = flow + s["valve-flutter"] * np.sign(v) * np.exp(-0.5 * ((speed - f["flutter"]) / 0.08) ** 2)
    rubbing = v / np.sqrt(v**2 + 0.02**2) * (1 + f["stribeck"] * np.exp(-speed / 0.1))
    friction = rubbing * (s["seal-friction"] + s["side-load"] * np.abs(x) / 40 * (1 + 0.2 * np.abs(x) / 40))
    pressed = (1 - x / 200) ** -f["adiabatic"] - 1 - f["adiabatic"] * x / 200
    curve = s["gas-compression"] * pressed / (0.5 * f["adiabatic"] * (1 + f["adiabatic"]) * 0.04)
    warmer = 1 + s["warm-gas"] * (warm - 20) / 50 * (1 + 0.001 * warm)
    gas = (f["preload"] * off["preload"] - f["stiffness"] * x + curve) * warmer
    stop = s["rubber-stop"] * np.logaddexp(0, (np.abs(x) - f["stop"]) / 2) * np.sign(x)
    return {"force": flow + friction - gas + stop}


MACHINE = Machine(
    model, plan, forms, readings,
    inside={
        "seal-friction": (0, 120), "side-load": (0, 150), "thin-oil": (0, 0.4), "worn-piston": (0, 0.6),
        "foaming": (0, 0.5),
        "cavitation": (0, 1200), "blow-off": (0, 1200), "bypass-groove": (0, 0.4),
        "gas-compression": (0, 200),
        "warm-gas": (0, 0.6), **{f"{n}-differs-between-specimens": (-0.3, 0.3) for n in BY_SPECIMEN},
    },
    outside={"valve-flutter": (0, 400), "rubber-stop": (0, 100), "wax": (0, 1)},
    setting={"velocity": 0.5},
)  # fmt: skip
