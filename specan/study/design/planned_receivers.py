"""Transfer functions that are still to be measured: receivers at other places of the same field."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from specan.study.observation import Array
from specan.study.observation.frf import LINE_CORRELATION, FrfObservation
from specan.study.observation.window_leakage import Folding

EVERY_HZ = 3.0  # lines that a planned receiver is looked at


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
    """Readings of further receivers, as noisy as those that were made; nothing is measured yet."""
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


def by_receiver(observation: FrfObservation, rows: Array) -> Array:
    """Rows of an observation (rows, columns) as (receivers in use, values of each, columns)."""
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
