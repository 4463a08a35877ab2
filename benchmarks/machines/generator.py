"""A direct-current generator: what it loses over speed, armature current and field current."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from machines.cases import Array, Machine, Table
from specan.models import Model, Parameter, effect


def losses(friction, iron, copper):
    """All losses of the machine."""
    return friction + iron + copper


def friction(speed, drag):
    """Brushes and bearings."""
    return drag * speed / 1500


def flux(field, knee):
    """Flux over that at 1 A, by Froelich."""
    return field * (1 + knee) / (field + knee)


def iron(speed, flux, hysteresis):
    """Hysteresis of the armature, by Steinmetz."""
    return hysteresis * speed / 1500 * flux**1.6


def copper(current, resistance):
    """Resistance of the armature."""
    return resistance * current**2


@effect("windage", adds_to="friction", neutral={"size": 0.0})
def windage(speed, *, size=Parameter(20, "W", min=1, max=400, lower=0, upper=1000)):
    """The armature moves air."""
    return size * (speed / 1500) ** 3


@effect("viscous-bearing", adds_to="friction", neutral={"size": 0.0})
def viscous_bearing(speed, *, size=Parameter(20, "W", min=1, max=400, lower=0, upper=1000)):
    """Grease drags in proportion to speed."""
    return size * (speed / 1500) ** 2


@effect("eddy-currents", adds_to="iron", neutral={"size": 0.0})
def eddy_currents(speed, flux, *, size=Parameter(20, "W", min=1, max=400, lower=0, upper=1000)):
    """Currents in the laminations."""
    return size * (speed / 1500 * flux) ** 2


@effect("brush-drop", adds_to="copper", neutral={"drop": 0.0})
def brush_drop(current, *, drop=Parameter(1.5, "V", min=0.1, max=5, lower=0, upper=10)):
    """The contact of the brushes takes the same voltage at any current."""
    return drop * current


@effect("warm-winding", scales="copper", neutral={"rate": 0.0})
def warm_winding(current, *, rate=Parameter(0.1, "1", min=0.01, max=0.6, lower=0, upper=2)):
    """The winding heats, and its resistance rises."""
    return 1 + rate * (current / 50) ** 2


@effect("stray-load", adds_to="copper", neutral={"size": 0.0})
def stray_load(current, speed, *, size=Parameter(20, "W", min=1, max=300, lower=0, upper=1000)):
    """Currents that the armature's field drives in conductors and teeth."""
    return size * (current / 50) ** 2 * (speed / 1500) ** 1.5


@effect("armature-reaction", scales="iron", neutral={"rate": 0.0})
def armature_reaction(current, *, rate=Parameter(0.2, "1", min=0.01, max=2, lower=0, upper=5)):
    """Load distorts the flux, and the teeth on one side see more of it."""
    return 1 + rate * (current / 50) ** 2


@effect("sparking", adds_to="copper", neutral={"size": 0.0})
def sparking(
    current, speed, *, size=Parameter(3, "W/A", min=0.1, max=40, lower=0, upper=100),
    onset=Parameter(30, "A", min=10, max=60),
):  # fmt: skip
    """Above some product of current and speed commutation is late."""
    return size * np.maximum(current * speed / 1500 - onset, 0)


@effect("remanence", adds_to="flux", neutral={"rest": 0.0})
def remanence(*, rest=Parameter(0.05, "1", min=0.005, max=0.3, lower=0, upper=0.5)):
    """The poles keep some flux without field."""
    return rest


@effect("worn-commutator", adds_to="friction", neutral={"size": 0.0})
def worn_commutator(
    speed, *, size=Parameter(20, "W", min=1, max=300, lower=0, upper=1000),
    scale=Parameter(500, "1/min", min=150, max=1200),
):  # fmt: skip
    """Slow brushes stick more; the excess falls off with speed."""
    return size * speed / 1500 * np.exp(-speed / scale)


EFFECTS = [
    windage, viscous_bearing, eddy_currents, brush_drop, warm_winding, stray_load, armature_reaction,
    sparking,
    remanence, worn_commutator,
]  # fmt: skip


def model(uncertainty: Mapping[str, float]) -> Model:
    """Conditions as on the bench."""
    return Model.from_function(
        losses, friction, flux, iron, copper,
        conditions={"speed": ("1/min", 300, 2400), "current": ("A", 2, 60), "field": ("A", 0.2, 1.6)},
        observables={"losses": "W"},
        parameters={
            "drag": (60.0, 10, 200, "W"), "knee": (1.0, 0.3, 4, "A"), "hysteresis": (80.0, 10, 300, "W"),
            "resistance": (0.1, 0.02, 0.4, "V/A"),
        },
        units={"friction": "W", "flux": "1", "iron": "W", "copper": "W"},
        effects=EFFECTS, uncertainty=uncertainty,
    )  # fmt: skip


def plan(rng: np.random.Generator) -> Table:
    """Sweeps of speed at loads and fields."""
    speeds, currents, fields = (
        np.linspace(300, 2400, rng.integers(6, 9)),
        np.linspace(2, 60, 4),
        np.linspace(0.2, 1.6, 4),
    )
    current, field, speed = (x.ravel() for x in np.meshgrid(currents, fields, speeds, indexing="ij"))
    return {"speed": np.round(speed), "current": current, "field": np.round(field, 3)}


def forms(rng: np.random.Generator) -> dict[str, float]:
    """Exponents and scales of the truth."""
    return {
        "drag": rng.uniform(40, 90), "saturation": rng.uniform(0.9, 1.5), "froelich": rng.uniform(0.8, 1.6),
        "mixed": rng.uniform(0.08, 0.2), "steinmetz": rng.uniform(1.56, 1.64),
        "hysteresis": rng.uniform(50, 130),
        "brush": rng.uniform(0.98, 1.02), "resistance": rng.uniform(0.07, 0.15),
        "fan": rng.uniform(2.75, 3.0),
        "skin": rng.uniform(0.02, 0.12), "contact": rng.uniform(0.7, 2), "cooling": rng.uniform(0.0, 0.4),
        "stray_current": rng.uniform(1.85, 2.1), "stray_speed": rng.uniform(1.3, 1.7),
        "softness": rng.uniform(1, 4),
        "onset": rng.uniform(22, 45), "stribeck": rng.uniform(350, 700),
        "stribeck_power": rng.uniform(0.8, 1.3),
        "bump": rng.uniform(900, 1800), "bump_width": rng.uniform(80, 180), "lift": rng.uniform(1400, 2000),
        "shaft": rng.uniform(300, 500), "grease": rng.uniform(1.6, 2.0),
    }  # fmt: skip


def readings(table: Table, f: Mapping[str, float], s: Mapping[str, float]) -> dict[str, Array]:
    """Flux partly by tanh, Bertotti's losses with skin effect, a winding that cools better at speed."""
    n, i, field = table["speed"] / 1500, table["current"], table["field"]
    a, k = f["saturation"], f["froelich"]
    # Between a saturation curve of Froelich and one by tanh.
    flux = (1 - f["mixed"]) * field * (1 + k) / (field + k) + f["mixed"] * np.tanh(field / a) / np.tanh(1 / a)
    drag = (
        f["drag"]
        * n ** f["brush"]
        * (1 + s["worn-commutator"] / (1 + (1500 * n / f["stribeck"]) ** (2 * f["stribeck_power"])))
    )
    drag = drag * (1 - s["brush-lift"] / (1 + np.exp(-(1500 * n - f["lift"]) / 60)))
    drag += s["windage"] * n ** f["fan"] + s["viscous-bearing"] * n ** f["grease"]
    drag += s["resonant-shaft"] / (1 + ((1500 * n - f["bump"]) / f["bump_width"]) ** 2)
    teeth = np.sqrt(1 + 2 * s["armature-reaction"] * (i / 50) ** 2)
    iron = f["hysteresis"] * n * flux ** f["steinmetz"] * teeth
    iron += s["eddy-currents"] * (n * flux) ** 2 / (1 + f["skin"] * n**1.5)
    heat = s["warm-winding"] * (i / 50) ** 2 / (1 + f["cooling"] * n**0.6)
    copper = f["resistance"] * i**2 / (1 - np.minimum(heat, 0.8) / (1 + heat))
    copper += s["brush-drop"] * i * (1 - np.exp(-i / f["contact"]))
    copper += s["stray-load"] * (i / 50) ** f["stray_current"] * n ** f["stray_speed"]
    late = (i * n - f["onset"]) / f["softness"]
    copper += s["sparking"] * f["softness"] * np.logaddexp(0, late)
    copper += s["parallel-path"] * np.abs(np.sin(0.12 * i)) * i
    return {"losses": drag + iron + copper}


MACHINE = Machine(
    model, plan, forms, readings,
    inside={
        "windage": (0, 200), "viscous-bearing": (0, 200), "eddy-currents": (0, 200), "brush-drop": (0, 3),
        "warm-winding": (0, 0.35), "stray-load": (0, 150), "armature-reaction": (0, 0.8), "sparking": (0, 12),
        "worn-commutator": (0, 2),
    },
    outside={"brush-lift": (0, 0.6), "resonant-shaft": (0, 150), "parallel-path": (0, 3)},
    setting={"speed": 0.3},
)  # fmt: skip
