"""What can be hidden in the air and the geometry: temperature, humidity, drift, edges, objects."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from specan.errors import RequestError, nearest
from truth.room.layout import as_point, at_temperature
from truth.room.obstacle import Block
from truth.room.truth import Details, Truth

_NOMINAL_PERCENT = 50.0
ABOVE_FLOOR_M = 0.02


def temperature(truth: Truth, strength: float, at: str, rng: np.random.Generator) -> tuple[Truth, Details]:
    """The air is warmer."""
    warmer = truth.temperature_C + strength
    return replace(truth, temperature_C=warmer, room=at_temperature(truth.room, warmer)), {}


def humidity(truth: Truth, strength: float, at: str, rng: np.random.Generator) -> tuple[Truth, Details]:
    """The air is damper by `strength` percent: its molecules relax at other frequencies.

    Only what is lost changes; that damp air is lighter and sound in it faster belongs to the temperature.
    """
    percent = float(np.clip(_NOMINAL_PERCENT + strength, 5.0, 95.0))
    return replace(truth, room=replace(truth.room, humidity_percent=percent)), {"humidity_percent": percent}


def drift(truth: Truth, strength: float, at: str, rng: np.random.Generator) -> tuple[Truth, Details]:
    """The air grows warmer while the recording runs."""
    return replace(truth, drift_K=strength), {}


def dimension(truth: Truth, strength: float, at: str, rng: np.random.Generator) -> tuple[Truth, Details]:
    """An edge is longer."""
    drawn = "xyz"[rng.integers(3)]
    edge = at or drawn
    if edge not in ("x", "y", "z"):
        raise RequestError(f"there is no edge {at!r}", remedy=nearest(at, "xyz"))
    dims = np.array(truth.room.dims_m)
    dims["xyz".index(edge)] *= 1.0 + strength
    return replace(truth, room=replace(truth.room, dims_m=as_point(dims))), {"edge": edge}


def scatterer(truth: Truth, strength: float, at: str, rng: np.random.Generator) -> tuple[Truth, Details]:
    """A rigid block of `strength` cubic metres, longer than it is wide, stands somewhere; ``@floor``: 2 cm above z0."""
    stretch = np.exp(rng.uniform(-0.35, 0.35, 3))
    edges = stretch * (strength / np.prod(stretch)) ** (1.0 / 3.0)
    dims = np.array(truth.room.dims_m)
    centre = rng.uniform(edges / 2 + 0.02, dims - edges / 2 - 0.02)
    if at == "floor":
        centre[2] = edges[2] / 2 + ABOVE_FLOOR_M
    block = Block(as_point(centre), as_point(edges))
    room = replace(truth.room, block=block)
    return replace(truth, room=room), {"place_m": str(block.centre_m), "edges_m": str(block.edges_m)}
