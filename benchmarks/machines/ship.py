"""A ship's model in a towing tank: its resistance over speed, draught and temperature of the water."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from machines.cases import Array, Machine, Table
from specan.models import Model, Parameter, effect

LENGTH, DEPTH, SURFACE = 3.2, 1.8, 2.6  # m, m, m2 at a draught of 0.16 m


def resistance(viscous, wave):
    """What the carriage has to pull with."""
    return viscous + wave


def reynolds(speed, temperature):
    """Of the length; viscosity of fresh water."""
    return (
        speed
        * LENGTH
        / (1e-6 * (1.79 - 0.0575 * temperature + 0.00094 * temperature**2 - 6.0e-6 * temperature**3))
    )


def pressure(speed, draught):
    """Dynamic pressure on the wetted surface."""
    return 500 * speed**2 * SURFACE * (1 + 0.6 * (draught / 0.16 - 1))


def friction(reynolds):
    """Coefficient by the line of 1957."""
    return 0.075 / (np.log10(reynolds) - 2) ** 2


def viscous(pressure, friction, form):
    """Friction with a form factor."""
    return pressure * friction * (1 + form)


def wave(pressure, speed, size, power):
    """A power of Froude's number."""
    return pressure * 1e-3 * size * (speed / np.sqrt(9.81 * LENGTH) / 0.3) ** power


@effect("air-drag", adds_to="viscous", neutral={"area": 0.0})
def air_drag(speed, *, area=Parameter(0.5, "m^2", min=0.05, max=5, lower=0, upper=20)):
    """Wind of the carriage on the part above water."""
    return 0.6 * area * speed**2


@effect("roughness", adds_to="friction", neutral={"height": 0.0})
def roughness(reynolds, *, height=Parameter(50, "um", min=5, max=1000, lower=0, upper=5000)):
    """Fouling or paint, by Townsin."""
    rise = 0.044 * (np.cbrt(1e-6 * np.maximum(height, 1e-9) / LENGTH) - 10 * np.cbrt(1 / reynolds)) + 0.000125
    return np.maximum(rise, 0)


@effect("transom", adds_to="wave", neutral={"size": 0.0})
def transom(
    pressure, speed, *, size=Parameter(0.3, "1", min=0.02, max=5, lower=0, upper=20),
    clear=Parameter(1.6, "m/s", min=1, max=2.4),
):  # fmt: skip
    """The stern drags water until the flow leaves it."""
    return 1e-3 * size * pressure * np.maximum(1 - speed / clear, 0)


@effect("shallow-water", scales="wave", neutral={"rate": 0.0})
def shallow_water(speed, *, rate=Parameter(1, "1", min=0.1, max=20, lower=0, upper=50)):
    """Waves grow on the bottom of the tank."""
    return 1 + rate * (speed / np.sqrt(9.81 * DEPTH)) ** 4


@effect("spray", adds_to="wave", neutral={"size": 0.0})
def spray(
    speed, *, size=Parameter(2, "N*s^2/m^2", min=0.1, max=40, lower=0, upper=100),
    onset=Parameter(1.5, "m/s", min=0.8, max=2.2),
):  # fmt: skip
    """Above some speed the bow throws water."""
    return size * np.maximum(speed - onset, 0) ** 2


@effect("squat", scales="pressure", neutral={"rate": 0.0})
def squat(speed, *, rate=Parameter(0.1, "s^2/m^2", min=0.001, max=0.3, lower=0, upper=1)):
    """At speed the hull sinks and wets more."""
    return 1 + rate * (speed / 2) ** 2


@effect("laminar-bow", adds_to="friction", neutral={"size": 0.0})
def laminar_bow(reynolds, *, size=Parameter(1000, "1", min=100, max=4000, lower=0, upper=5000)):
    """The flow at the bow stays laminar, by Prandtl."""
    return -size / reynolds


@effect("immersed-bow", scales="wave", neutral={"rate": 0.0})
def immersed_bow(draught, *, rate=Parameter(0.3, "1", min=-2, max=2)):
    """A deeper bow makes other waves."""
    return 1 + rate * (draught / 0.16 - 1)


@effect("wave-breaking", adds_to="wave", neutral={"size": 0.0})
def wave_breaking(
    pressure, speed, draught, *, size=Parameter(0.5, "1", min=0.02, max=10, lower=0, upper=30),
    onset=Parameter(1.2, "m/s", min=0.8, max=2),
):  # fmt: skip
    """A blunt bow at small draught breaks its wave."""
    return 1e-3 * size * pressure * 0.16 / draught * np.maximum(speed / onset - 1, 0)


@effect("carriage-zero", adds_to="viscous", neutral={"offset": 0.0})
def carriage_zero(*, offset=Parameter(0.2, "N", min=-3, max=3)):
    """The balance does not read zero at rest."""
    return offset


@effect("bilge-vortices", adds_to="viscous", neutral={"size": 0.0})
def bilge_vortices(pressure, draught, *, size=Parameter(0.2, "1", min=0.02, max=3, lower=0, upper=10)):
    """Eddies behind keels; more at a deep draught."""
    return 1e-3 * size * pressure * (draught / 0.16) ** 2


EFFECTS = [
    air_drag, roughness, transom, shallow_water, spray, squat, laminar_bow, immersed_bow, wave_breaking,
    carriage_zero,
    bilge_vortices,
]  # fmt: skip


def model(uncertainty: Mapping[str, float]) -> Model:
    """Conditions as in the tank."""
    return Model.from_function(
        resistance, reynolds, pressure, friction, viscous, wave,
        conditions={"speed": ("m/s", 0.5, 2.4), "draught": ("m", 0.11, 0.21), "temperature": ("degC", 8, 24)},
        observables={"resistance": "N"},
        parameters={"form": (0.2, 0.0, 0.8), "size": (1.0, 0.1, 5), "power": (4.0, 2.5, 7)},
        units={"reynolds": "1", "pressure": "N", "friction": "1", "viscous": "N", "wave": "N"},
        effects=EFFECTS, uncertainty=uncertainty,
    )  # fmt: skip


def plan(rng: np.random.Generator) -> Table:
    """Runs at rising speed, a draught and a day's water at a time."""
    speeds = np.round(np.linspace(0.5, 2.4, rng.integers(9, 16)), 3)
    table: dict[str, list[float]] = {"speed": [], "draught": [], "temperature": []}
    for draught in (0.12, 0.16, 0.20):
        for warm in (9.0, 15.0, 22.0):
            table["speed"] += speeds.tolist()
            table["draught"] += [draught] * speeds.size
            table["temperature"] += np.round(warm + rng.normal(0, 0.4, speeds.size), 1).tolist()
    return {n: np.array(x) for n, x in table.items()}


def forms(rng: np.random.Generator) -> dict[str, float]:
    """Lines of friction, powers and onsets of the truth."""
    return {
        "line": float(rng.integers(2)), "form": rng.uniform(0.1, 0.3), "wave": rng.uniform(0.7, 1.8),
        "power": rng.uniform(3.6, 4.8), "hump": rng.uniform(0.002, 0.01), "wetted": rng.uniform(0.8, 1.2),
        "wind": rng.uniform(0.0, 0.15), "sand": rng.uniform(0.7, 1.2), "clear": rng.uniform(1.3, 2.2),
        "clear_width": rng.uniform(0.05, 0.15), "shallow": rng.uniform(1.7, 2.3),
        "spray": rng.uniform(1.1, 1.9),
        "spray_power": rng.uniform(1.6, 2.2), "spray_width": rng.uniform(0.03, 0.12),
        "trip": rng.uniform(2.5e6, 4e6),
        "bow": rng.uniform(0.5, 1.5), "break": rng.uniform(0.9, 1.5), "keel": rng.uniform(1.5, 2.5),
        "hollow": rng.uniform(1.1, 2.0), "hollow_width": rng.uniform(0.08, 0.16),
        "strut": rng.uniform(0.5, 0.9),
        "stick": rng.uniform(14, 18),
    }  # fmt: skip


def readings(table: Table, f: Mapping[str, float], s: Mapping[str, float]) -> dict[str, Array]:
    """Friction by Grigson or by Hughes, waves with a hump, kinks that are round."""
    v, draught, warm = table["speed"], table["draught"], table["temperature"]
    viscosity = 2.414e-5 * 10 ** (247.8 / (warm + 273.15 - 140)) / 1000  # Vogel
    re = v * LENGTH / viscosity
    froude = v / np.sqrt(9.81 * LENGTH)
    decade = np.log10(re)
    if f["line"]:  # Katsui and others, 2005
        friction = 0.0066577 / (decade - 4.3762) ** (0.042612 * decade + 0.56725)
    else:  # Hughes, 1954
        friction = 0.0670 / (decade - 2) ** 2 * 1.12
    sand = s["roughness"] * f["sand"] * 1e-6 / LENGTH
    rough = (1.89 - 1.62 * np.log10(np.maximum(sand, 1e-9))) ** -2.5  # Prandtl and Schlichting
    friction = np.where(sand > 0, (friction**4 + rough**4) ** 0.25, friction)
    friction -= s["laminar-bow"] / re * (1 - 0.5 * (re / f["trip"]) / (1 + re / f["trip"]))
    pressure = 500 * v**2 * SURFACE * (1 + 0.6 / f["wetted"] * ((draught / 0.16) ** f["wetted"] - 1))
    viscous = pressure * friction * (1 + f["form"]) + 0.6 * s["air-drag"] * (v + f["wind"]) ** 2
    viscous += (
        s["carriage-zero"] * (1 + 0.03 * v)
        + 1e-3 * s["bilge-vortices"] * pressure * (draught / 0.16) ** f["keel"]
    )
    viscous += s["warm-bearing"] / (1 + np.exp((warm - f["stick"]) / 0.5))
    shape = (froude / 0.3) ** f["power"] * (1 + f["hump"] * np.cos(0.5 / froude**2))
    shape = shape * (draught / 0.16) ** (f["bow"] * s["immersed-bow"])
    shallow = v**2 / (9.81 * DEPTH)
    wave = f["wave"] * shape * (1 + s["shallow-water"] * shallow ** f["shallow"] / (1 + 0.5 * shallow))
    ventilated = f["clear_width"] * np.logaddexp(0, (1 - v / f["clear"]) / f["clear_width"])
    breaking = 0.08 * np.logaddexp(0, (v / f["break"] - 1) / 0.08)
    wave = wave + s["transom"] * ventilated + s["wave-breaking"] * breaking * 0.16 / draught
    wave = wave - s["interference"] * np.exp(-0.5 * ((v - f["hollow"]) / f["hollow_width"]) ** 2)
    thrown = f["spray_width"] * np.logaddexp(0, (v - f["spray"]) / f["spray_width"])
    strut = s["strut"] * np.sin(2 * np.pi * v / f["strut"]) * v
    return {"resistance": viscous + 1e-3 * pressure * wave + s["spray"] * thrown ** f["spray_power"] + strut}


MACHINE = Machine(
    model, plan, forms, readings,
    inside={
        "air-drag": (0, 3), "roughness": (0, 600), "transom": (0, 3), "shallow-water": (0, 20),
        "spray": (0, 25),
        "laminar-bow": (0, 3000), "immersed-bow": (-1, 1), "wave-breaking": (0, 5),
        "carriage-zero": (-1.5, 1.5), "bilge-vortices": (0, 2),
    },
    outside={"interference": (0, 2), "warm-bearing": (0, 2), "strut": (0, 1.5)},
)  # fmt: skip
