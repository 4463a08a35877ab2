"""Phases of several insertions of a calibrator, chained through the microphones that they share."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from specan.analysis.insertion import Insertion


@dataclass(frozen=True)
class ChainedPhase:
    """Phase relative to `reference`, the first channel of all that chains of shared microphones lead to."""

    phase_deg: float
    u_phase_deg: float
    reference: str


def chain_phases(insertions: Sequence[Insertion]) -> dict[str, ChainedPhase]:
    r"""Phase of every channel at one tone, from insertions that may share microphones.

    Each insertion j gives :math:`\varphi_{cj} = \theta_c - o_j` with an unknown common phase
    :math:`o_j`. Where insertions share microphones the :math:`\theta_c` follow by least squares from all
    of them together, however long the chain; insertions that share none form separate groups. Residuals,
    where there are more observations than unknowns, tell how well an insertion repeats, which enters the
    uncertainty.

    Parameters
    ----------
    insertions : sequence of Insertion
        All at one tone.

    Returns
    -------
    dict
        Channel name to its phase; the reference itself has 0 +- 0.
    """
    found: dict[str, ChainedPhase] = {}
    for group in _connected(insertions):
        found |= _adjust(group)
    return found


def _connected(insertions: Sequence[Insertion]) -> list[list[Insertion]]:
    """Insertions in groups that hang together by shared channels, in the order given."""
    groups: list[tuple[set[str], list[Insertion]]] = []
    for insertion in insertions:
        names = {h.channel for h in insertion.heard}
        if not names:
            continue
        touching = [g for g in groups if g[0] & names]
        members = [i for g in touching for i in g[1]]
        groups = [g for g in groups if not g[0] & names]
        groups.append((names.union(*(g[0] for g in touching)), [*members, insertion]))
    return [members for _, members in groups]


def _adjust(insertions: Sequence[Insertion]) -> dict[str, ChainedPhase]:
    """Least squares over one connected group; the reference is its first channel as people count."""
    reference = min((h.channel for insertion in insertions for h in insertion.heard), key=natural)
    rough = _rough(insertions, reference)
    unknown = [name for name in rough if name != reference]
    columns = {name: i for i, name in enumerate(unknown)}
    seen = [(j, h) for j, insertion in enumerate(insertions) for h in insertion.heard]
    design = np.zeros((len(seen), len(unknown) + len(insertions)))
    observed = np.zeros(len(seen))
    offsets = [rough[i.heard[0].channel] - i.heard[0].phase_deg for i in insertions]
    for row, (j, h) in enumerate(seen):
        if h.channel != reference:
            design[row, columns[h.channel]] = 1.0
        design[row, len(unknown) + j] = -1.0
        # Small differences from the rough values, so that no angle wraps.
        observed[row] = _wrap(h.phase_deg - rough[h.channel] + offsets[j])
    correction, *_ = np.linalg.lstsq(design, observed, rcond=None)
    surplus = len(seen) - design.shape[1]
    # The first channel of an insertion is its own reference and carries no scatter of its own.
    within = float(np.mean([h.u_phase_deg**2 for i in insertions for h in i.heard[1:]] or [0.0]))
    residual = observed - design @ correction
    variance = max(within, float(residual @ residual) / surplus) if surplus > 0 else within
    spread = np.linalg.pinv(design.T @ design) * variance
    found = {reference: ChainedPhase(0.0, 0.0, reference)}
    for name, i in columns.items():
        phase = float(_wrap(rough[name] + correction[i]))
        found[name] = ChainedPhase(phase, float(np.sqrt(spread[i, i])), reference)
    return found


def _rough(insertions: Sequence[Insertion], reference: str) -> dict[str, float]:
    """Phases along one path from the reference to each channel."""
    rough = {reference: 0.0}
    waiting = list(insertions)
    while waiting:
        insertion = next(i for i in waiting if any(h.channel in rough for h in i.heard))
        waiting.remove(insertion)
        tie = next(h for h in insertion.heard if h.channel in rough)
        for h in insertion.heard:
            rough.setdefault(h.channel, rough[tie.channel] + h.phase_deg - tie.phase_deg)
    return rough


def natural(name: str) -> list[tuple[int, int | str]]:
    """Sorting key under which "Mic 2" stands before "Mic 10"."""
    return [(0, int(part)) if part.isdigit() else (1, part) for part in re.split(r"(\d+)", name) if part]


def _wrap(degrees: float) -> float:
    return float((degrees + 180.0) % 360.0 - 180.0)
