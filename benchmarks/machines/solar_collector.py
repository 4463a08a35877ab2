"""A flat solar collector: heat over irradiance, excess temperature, wind and the angle of the sun."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from machines.cases import Array, Machine, Table
from specan.models import Model, Parameter, effect


def heat(gain, loss):
    """Useful heat per area."""
    return gain - loss


def sun(irradiance):
    """What falls on the glass."""
    return irradiance


def gain(sun, optical):
    """What the absorber takes."""
    return optical * sun


def loss(excess, conductance):
    """What goes off at the mean temperature of the fluid over that of the air."""
    return conductance * excess


@effect("radiation", adds_to="loss", neutral={"size": 0.0})
def radiation(excess, *, size=Parameter(0.01, "W/m^2/K^2", min=0.001, max=0.1, lower=0, upper=0.3)):
    """The absorber radiates; the loss grows with the square."""
    return size * excess**2


@effect("wind-loss", adds_to="loss", neutral={"size": 0.0})
def wind_loss(wind, excess, *, size=Parameter(0.2, "J/m^3/K", min=0.01, max=3, lower=0, upper=10)):
    """Wind cools the glass."""
    return size * wind * excess


@effect("wind-at-zero", scales="gain", neutral={"rate": 0.0})
def wind_at_zero(wind, *, rate=Parameter(0.01, "s/m", min=0.001, max=0.1, lower=0, upper=0.15)):
    """Wind takes a part of what the absorber gains, at any temperature of the fluid."""
    return 1 - rate * wind


@effect("glass-reflection", scales="gain", neutral={"size": 0.0})
def glass_reflection(angle, *, size=Parameter(0.1, "1", min=0.01, max=0.5, lower=0, upper=0.9)):
    """Light from the side is reflected, by Souka and Safwat."""
    return 1 - size * (1 / np.cos(np.radians(angle)) - 1)


@effect("edge-shade", scales="gain", neutral={"size": 0.0})
def edge_shade(angle, *, size=Parameter(0.05, "1", min=0.005, max=0.5, lower=0, upper=0.9)):
    """The frame throws a shadow."""
    return 1 - size * np.tan(np.radians(angle))


@effect("cold-sky", adds_to="loss", neutral={"size": 0.0})
def cold_sky(*, size=Parameter(10, "W/m^2", min=1, max=100, lower=-200, upper=200)):
    """The sky takes heat whatever the fluid does."""
    return size


@effect("dry-out", adds_to="loss", neutral={"share": 0.0})
def dry_out(
    gain, *, share=Parameter(0.2, "1", min=0.02, max=1, lower=0, upper=1),
    onset=Parameter(500, "W/m^2", min=250, max=700),
):  # fmt: skip
    """A heat pipe carries no more than so much."""
    return share * np.maximum(gain - onset, 0)


@effect("convection-cells", adds_to="loss", neutral={"size": 0.0})
def convection_cells(
    excess, *, size=Parameter(1, "W/m^2/K", min=0.05, max=8, lower=0, upper=20),
    onset=Parameter(30, "K", min=10, max=55),
):  # fmt: skip
    """Above some difference the air under the glass begins to turn."""
    return size * np.maximum(excess - onset, 0)


@effect("ageing-coat", scales="gain", neutral={"rate": 0.0})
def ageing_coat(excess, *, rate=Parameter(0.03, "1", min=0.003, max=0.3, lower=0, upper=0.9)):
    """A warm coat absorbs less."""
    return 1 - rate * excess / 50


@effect("weak-light", scales="gain", neutral={"size": 0.0})
def weak_light(irradiance, *, size=Parameter(0.05, "1", min=-0.4, max=0.4)):
    """Light is more diffuse when weak, and diffuse light counts otherwise."""
    return 1 + size * (1 - irradiance / 1000)


@effect("back-draught", adds_to="loss", neutral={"size": 0.0})
def back_draught(wind, *, size=Parameter(1, "J/m^3", min=0.1, max=20, lower=0, upper=60)):
    """Wind goes through the box behind the absorber."""
    return size * wind**2


EFFECTS = [
    radiation, wind_loss, wind_at_zero, glass_reflection, edge_shade, cold_sky, dry_out, convection_cells,
    ageing_coat,
    weak_light, back_draught,
]  # fmt: skip


def model(uncertainty: Mapping[str, float]) -> Model:
    """Conditions as on the roof."""
    return Model.from_function(
        heat, sun, gain, loss,
        conditions={
            "irradiance": ("W/m^2", 250, 1050), "excess": ("K", -5, 65), "wind": ("m/s", 0, 6),
            "angle": ("degree", 0, 60),
        },
        observables={"heat": "W/m^2"},
        parameters={"optical": (0.75, 0.4, 0.95), "conductance": (3.5, 0.5, 10, "W/m^2/K")},
        units={"sun": "W/m^2", "gain": "W/m^2", "loss": "W/m^2"},
        effects=EFFECTS, uncertainty=uncertainty,
    )  # fmt: skip


def plan(rng: np.random.Generator) -> Table:
    """Days on the roof: the sun moves, clouds pass, the wind comes and goes."""
    days = rng.integers(5, 9)
    table: dict[str, list[float]] = {"irradiance": [], "excess": [], "wind": [], "angle": []}
    for day in range(days):
        hours = np.linspace(-4, 4, 20)
        angle = np.abs(14 * hours)
        sky = rng.uniform(0.6, 1.0) * rng.choice([1, 1, 1, 0.6], hours.size)
        table["irradiance"] += np.round(250 + 800 * sky * np.cos(np.radians(angle)) ** 1.3).tolist()
        table["excess"] += np.round(
            -5 + 70 * day / (days - 1) * 0.85 + rng.uniform(0, 8, hours.size), 1
        ).tolist()
        table["wind"] += np.round(
            np.clip(rng.uniform(0.5, 4) + rng.normal(0, 1, hours.size), 0, 6), 1
        ).tolist()
        table["angle"] += np.round(angle, 1).tolist()
    return {n: np.array(x) for n, x in table.items()}


def forms(rng: np.random.Generator) -> dict[str, float]:
    """Shapes of the truth."""
    return {
        "optical": rng.uniform(0.68, 0.82), "conductance": rng.uniform(3.2, 4.2),
        "bend": rng.uniform(0.02, 0.08),
        "air": rng.uniform(15, 30), "blow": rng.uniform(0.7, 1.0), "zero": rng.uniform(0.75, 1.0),
        "ambrosetti": rng.uniform(2.6, 3.6), "frame": rng.uniform(0.9, 1.15), "sky": rng.uniform(0.0, 0.03),
        "pipe": rng.uniform(380, 580), "pipe_width": rng.uniform(10, 40), "cells": rng.uniform(20, 42),
        "coat": rng.uniform(0.85, 1.2), "diffuse": rng.uniform(0.8, 1.3), "draught": rng.uniform(1.7, 2.2),
        "glint": rng.uniform(20, 40), "steam": rng.uniform(25, 50), "flap": rng.uniform(2.0, 3.5),
    }  # fmt: skip


def readings(table: Table, f: Mapping[str, float], s: Mapping[str, float]) -> dict[str, Array]:
    """Radiation by Stefan and Boltzmann, cells by Hollands, angles by Ambrosetti."""
    light, warm, wind, angle = table["irradiance"], table["excess"], table["wind"], table["angle"]
    air = f["air"] + 273.15
    slant = np.tan(np.radians(angle) / 2) ** f["ambrosetti"]
    gain = f["optical"] * light * (1 - 1.6 * s["glass-reflection"] * slant * (1 + slant))
    gain = gain * (1 - s["edge-shade"] * np.sin(np.radians(angle)) ** f["frame"] / np.cos(np.radians(angle)))
    gain = gain * np.exp(-s["wind-at-zero"] * 3 * (wind / 3) ** f["zero"])
    gain = gain * (1 - s["ageing-coat"] * np.sign(warm) * np.abs(warm / 50) ** f["coat"])
    gain = gain * (1 + s["weak-light"] * (1 - (light / 1000) ** f["diffuse"]) / f["diffuse"])
    gain = gain * (1 - s["glint"] * np.exp(-0.5 * ((angle - f["glint"]) / 6) ** 2))
    loss = f["conductance"] * warm * (1 + f["bend"] * np.tanh(warm / 40))
    # What a fourth power adds to a straight line, in units of a square at 300 K.
    loss = loss + s["radiation"] * ((air + warm) ** 4 - air**4 - 4 * air**3 * warm) / (6 * air**2)
    loss = (
        loss
        + s["wind-loss"] * 3 * (wind / 3) ** f["blow"] * warm
        + s["cold-sky"] * (1 + f["sky"] * (wind - 3))
    )
    width = f["pipe_width"]
    loss = loss + s["dry-out"] * width * np.logaddexp(0, (gain - f["pipe"]) / width)
    begun = np.maximum(warm, 1) / f["cells"]
    loss = loss + s["convection-cells"] * warm * np.where(
        begun > 1, 1 - begun**-1.0 + 0.15 * (begun ** (1 / 3) - 1), 0
    )
    loss = loss + s["back-draught"] * 9 * (wind / 3) ** f["draught"]
    loss = loss + s["steam"] * np.exp(-0.5 * ((warm - f["steam"]) / 5) ** 2)
    loss = loss + s["loose-flap"] / (1 + np.exp(-(wind - f["flap"]) / 0.15)) * (angle < 40)
    return {"heat": gain - loss}


MACHINE = Machine(
    model, plan, forms, readings,
    inside={
        "radiation": (0, 0.04), "wind-loss": (0, 1), "wind-at-zero": (0, 0.03), "glass-reflection": (0, 0.25),
        "edge-shade": (0, 0.15), "cold-sky": (0, 60), "dry-out": (0, 0.6), "convection-cells": (0, 3),
        "ageing-coat": (0, 0.15),
        "weak-light": (-0.2, 0.2), "back-draught": (0, 5),
    },
    outside={"glint": (0, 0.2), "steam": (0, 100), "loose-flap": (0, 100)},
)  # fmt: skip
