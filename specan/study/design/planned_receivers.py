"""Measurements of a room that are still to be made: microphones at other places, the same walls and instruments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from specan.models import Model
from specan.models.quantity import constant
from specan.study.observation import Array
from specan.study.observation.frf import LINE_CORRELATION, FrfObservation
from specan.study.observation.window_leakage import Folding

EACH_WAY = 4  # places along each edge
FROM_WALL_M = 0.06
FROM_PISTON_M = 0.15
APART_M = 0.05
EVERY_HZ = 3.0


def free_places(model: Model) -> Array:
    """A grid of places (n, 3) in m: off the walls, off the piston, where no microphone stands yet."""
    rig = model.settings["rig"]
    dims = np.array(rig["room"]["dims_m"])
    margin = np.minimum(FROM_WALL_M, dims / 4)
    along = [np.round(np.linspace(m, edge - m, EACH_WAY), 3) for m, edge in zip(margin, dims, strict=True)]
    grid = np.stack(np.meshgrid(*along, indexing="ij"), axis=-1).reshape(-1, 3)
    taken = np.array(rig["mics"]["position_m"])
    clear = np.min(np.linalg.norm(grid[:, None] - taken[None], axis=2), axis=1) > APART_M
    clear &= np.linalg.norm(grid - np.array(rig["piston"]["centre_m"]), axis=1) > FROM_PISTON_M
    return np.asarray(grid[clear])


def with_microphones(model: Model, places: Array) -> tuple[Model, tuple[str, ...]]:
    """The model with further microphones behind its own, on the first card; and their names."""
    names = tuple(f"place {k}" for k in range(1, len(places) + 1))
    more = {"receiver_position": places, "receiver_nominal_gain": np.ones(len(places)),
            "card_of_microphone": np.zeros(len(places), dtype=int)}  # fmt: skip
    changed = {
        name: constant(name, np.concatenate([np.asarray(node()), more[name]]), node.unit, node.doc, node.axes)
        for name, node in ((name, model.quantities[name]) for name in more)
    }
    axes = {**model.axes, "microphone": (*model.axes["microphone"], *names)}
    return replace(model, quantities={**model.quantities, **changed}, axes=axes), names


def few_lines(observation: FrfObservation) -> FrfObservation:
    """About every third line, seen without windows, each worth what the lines around it are worth together."""
    every = max(1, round(EVERY_HZ / observation.line_hz))
    lines = np.flatnonzero(observation.kept.any(axis=0))[::every]
    frequency = observation.frequency_hz[lines]
    alike = 1 + 2 * sum(LINE_CORRELATION[1:every])  # neighbouring lines say in part the same
    random = observation.random[:, lines] * np.sqrt(min(1.0, alike / every))
    return replace(
        observation,
        frequency_hz=frequency,
        response=observation.response[:, lines],
        noise=random,
        random=random,
        shared=observation.shared[:, lines],
        modal=None if observation.modal is None else observation.modal[:, lines],
        kept=observation.kept[:, lines],
        folding=Folding.none(frequency),
        conditions_at_nodes={
            name: np.interp(frequency, observation.folding.nodes, value)
            for name, value in observation.conditions_at_nodes.items()
        },
    )


def planned(observation: FrfObservation, names: Sequence[str]) -> FrfObservation:
    """Readings of further microphones, as noisy as those that were made; nothing is measured yet."""
    few = few_lines(observation)
    lines, old, new = len(few.frequency_hz), len(few.channels), len(names)
    used = few.kept.any(axis=1)
    noise = np.broadcast_to(np.median(few.random[used], axis=0), (old + new, lines))
    return replace(
        few,
        name="planned",
        channels=(*few.channels, *names),
        response=np.zeros((old + new, lines), dtype=complex),
        noise=noise,
        random=noise,
        shared=np.zeros((old + new, lines, 0), dtype=complex),
        modal=None,
        kept=np.repeat(np.arange(old + new)[:, None] >= old, lines, axis=1),
    )


def by_microphone(observation: FrfObservation, rows: Array) -> Array:
    """Rows of an observation (rows, columns) as (microphones in use, values of each, columns)."""
    count = int(observation.kept.any(axis=1).sum())
    both = rows.reshape(2, count, -1, rows.shape[-1])
    return both.transpose(1, 0, 2, 3).reshape(count, -1, rows.shape[-1])


def spoken_place(place: Array | Sequence[float]) -> str:
    """A place in words.

    Examples
    --------
    >>> spoken_place([0.3, 0.45, 0.612])
    '(0.30, 0.45, 0.61) m'
    """
    return "(" + ", ".join(f"{x:.2f}" for x in place) + ") m"


def wall_areas(dims_m: Sequence[float]) -> Mapping[str, float]:
    """Area of every wall of a box, m^2.

    Examples
    --------
    >>> wall_areas([2.0, 3.0, 4.0])["y1"]
    8.0
    """
    x, y, z = (float(edge) for edge in dims_m)
    return {"x0": y * z, "x1": y * z, "y0": x * z, "y1": x * z, "z0": x * y, "z1": x * y}
