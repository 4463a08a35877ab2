"""Phases of several insertions of a calibrator, chained through the microphones that they share."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from specan.analysis.insertion import Insertion


@dataclass(frozen=True)
class ChainedPhase:
    """Phase relative to `reference`, the first channel of all that chains of shared microphones lead to.

    `u_phase_deg` has two parts: how well insertions repeat, with its degrees of freedom (None where it was
    declared), and the noise of the windows.
    """

    phase_deg: float
    u_insertion_deg: float
    u_windows_deg: float
    dof: int | None
    reference: str

    @property
    def u_phase_deg(self) -> float:
        """Standard uncertainty of the phase."""
        return float(np.hypot(self.u_insertion_deg, self.u_windows_deg))


def chain_phases(insertions: Sequence[Insertion], declared_deg: float = 0.0) -> dict[str, ChainedPhase]:
    r"""Phase of every channel at one tone, from insertions that may share microphones.

    Each insertion j gives :math:`\varphi_{cj} = \theta_c - o_j` with an unknown common phase
    :math:`o_j`. Where insertions share microphones the :math:`\theta_c` follow by least squares from all
    of them together, however long the chain; insertions that share none form separate groups. How well an
    insertion repeats follows from the residuals where there are enough of them, see `repeatability`, else it
    is `declared_deg`; both enter the uncertainty with the noise of the windows.

    Parameters
    ----------
    insertions : sequence of Insertion
        All at one tone.
    declared_deg : float
        Standard uncertainty by which the phase between two microphones changes from one insertion to the
        next; each of the two has half of the variance.

    Returns
    -------
    dict
        Channel name to its phase; the reference itself has 0 +- 0.
    """
    found: dict[str, ChainedPhase] = {}
    for group in _connected(insertions):
        found |= _adjust(group, declared_deg)
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


def _adjust(insertions: Sequence[Insertion], declared_deg: float) -> dict[str, ChainedPhase]:
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
    solve = np.linalg.pinv(design)
    correction = solve @ observed
    residual = observed - design @ correction
    windows = np.array([h.u_phase_deg**2 for _, h in seen])
    u, dof = repeatability(
        float(residual @ residual),
        len(seen) - design.shape[1],
        float(windows.mean()),
        declared_deg / np.sqrt(2),
    )
    found = {reference: ChainedPhase(0.0, 0.0, 0.0, dof, reference)}
    for name, i in columns.items():
        weights = solve[i] ** 2
        phase = float(_wrap(rough[name] + correction[i]))
        inserted, noise = u * np.sqrt(weights.sum()), np.sqrt(weights @ windows)
        found[name] = ChainedPhase(phase, float(inserted), float(noise), dof, reference)
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


# Channels of one make differ by some degrees at 1 kHz; one that is turned differs by 180 degrees.
TOLERANCE_DEG = 30.0


def turned_over(phases: Mapping[str, Sequence[float]]) -> tuple[set[str], set[str]]:
    """Channels of inverted polarity, and those whose phase is neither that of a matched nor of a turned one.

    Phases at all tones must be within 30 degrees of 180: a delay would turn with frequency. The larger part
    of the group is taken for right; between equal parts the one that holds the reference.

    Parameters
    ----------
    phases : mapping of str to sequence of float
        Phases in degrees at one or more tones, of all channels of one group, relative to its first channel.

    Examples
    --------
    >>> turned_over({"Mic 1": [0.0], "Mic 2": [-174.5], "Mic 3": [2.0]})
    ({'Mic 2'}, set())
    >>> turned_over({"Mic 1": [0.0], "Mic 2": [-174.5], "Mic 3": [177.0]})
    ({'Mic 1'}, set())
    """
    like, opposite = set[str](), set[str]()
    for name, degrees in phases.items():
        if all(abs(_wrap(d)) <= TOLERANCE_DEG for d in degrees):
            like.add(name)
        elif all(abs(_wrap(d)) >= 180.0 - TOLERANCE_DEG for d in degrees):
            opposite.add(name)
    return (like if len(opposite) > len(like) else opposite), set(phases) - like - opposite


ENOUGH = 3  # degrees of freedom from which an estimate replaces what was declared


def repeatability(squares: float, dof: int, windows: float, declared: float) -> tuple[float, int | None]:
    r"""Standard uncertainty of one observation by its insertion, and its degrees of freedom.

    The residuals of observations that were made more than once have the variance
    :math:`s^2 = \sum r^2 / \nu`, of which the noise within the insertions is a part. With three degrees of
    freedom or more the rest is the estimate (GUM type A), times :math:`t_{0.975}(\nu) / 1.96`: then
    +-1.96 u holds 95 % although s is itself uncertain (GUM, annex G). With fewer, the declared value counts
    (type B), or the estimate where that is larger.

    Parameters
    ----------
    squares : float
        Sum of squared residuals.
    dof : int
        Observations minus unknowns.
    windows : float
        Mean variance of an observation by the noise of its windows.
    declared : float
        Standard uncertainty that is stated for one observation.

    Returns
    -------
    tuple
        The uncertainty in the unit of the residuals; degrees of freedom, None for type B.

    Examples
    --------
    >>> found, freedom = repeatability(0.04, 4, 0.0, 0.5)
    >>> round(found, 4), freedom
    (0.1417, 4)
    >>> repeatability(0.0, 0, 0.0, 0.5)
    (0.5, None)
    """
    from scipy.special import stdtrit

    found = math.sqrt(max(squares / dof - windows, 0.0)) if dof > 0 else 0.0
    if dof < ENOUGH:
        return max(found, declared), None
    return found * float(stdtrit(dof, 0.975) / stdtrit(math.inf, 0.975)), dof
