"""Loops of a graph: the order of its evaluation, and the fixed point of what an effect causes and is caused by."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from graphlib import CycleError, TopologicalSorter
from typing import Any

import numpy as np

TOLERANCE = 1e-13  # relative change in going once around

State = dict[str, Any]


def ordered(reads: Mapping[str, Sequence[str]]) -> tuple[list[str], tuple[str, ...]]:
    """Nodes of a graph, those that are read first coming first; and those whose values must be guessed for it.

    Of every circle the node is guessed through which the most ways lead.

    Examples
    --------
    >>> ordered({"a": ["b"], "b": ["c"], "c": []})
    (['c', 'b', 'a'], ())
    >>> ordered({"a": ["c"], "b": ["a"], "c": ["b"], "d": ["b"]})
    (['c', 'd', 'a', 'b'], ('b',))
    """
    guessed: list[str] = []
    while True:
        left = {node: [r for r in names if r not in guessed] for node, names in reads.items()}
        try:
            return list(TopologicalSorter(left).static_order()), tuple(guessed)
        except CycleError as fault:
            read_by = {node: sum(node in names for names in left.values()) for node in fault.args[1]}
            guessed.append(max(read_by, key=lambda node: (read_by[node] * len(left[node]), node)))


def reached(start: Iterable[str], edges: Mapping[str, Sequence[str]]) -> set[str]:
    """Nodes that can be reached along the edges, those at the start included.

    Examples
    --------
    >>> sorted(reached(["a"], {"a": ["b"], "b": ["a"], "c": ["a"]}))
    ['a', 'b']
    """
    found: set[str] = set()
    left = list(start)
    while left:
        node = left.pop()
        if node not in found:
            found.add(node)
            left.extend(edges.get(node, ()))
    return found


def fixed_point(around: Callable[[State], State], guess: Mapping[str, Any]) -> bool:
    """Go around a loop, ``x -> around(x)``, until it leads to where it began; whether it did within 200 rounds.

    Each element takes its own secant step (Aitken 1926): the change from one round to the next tells the loop's
    gain q, and 1/(1-q) of the plain step leads to where it ends. A loop that swings is damped that way, one that
    contracts slowly is sped up. A gain above one has no stable fixed point: the plain step then runs away.

    Examples
    --------
    >>> import numpy as np
    >>> last = {}
    >>> fixed_point(lambda x: last.update(x=np.cos(x["x"])) or dict(last), {"x": np.float64(1.0)})
    True
    >>> round(float(last["x"]), 12)
    0.739085133215
    """
    x: State = {name: np.asarray(value) for name, value in guess.items()}
    before: tuple[State, State] | None = None
    # one that runs away is told once; an element that has arrived does not move
    with np.errstate(all="ignore"):
        for _ in range(200):
            new = around(x)
            gap = {name: new[name] - x[name] for name in x}
            sizes = {name: np.abs(new[name]) + np.abs(x[name]) + 1e-300 for name in x}
            worst = max(float(np.max(np.abs(gap[name]) / sizes[name])) for name in x)
            if worst < TOLERANCE or not np.isfinite(worst):
                return worst < TOLERANCE
            factor = _steps(x, gap, *before) if before else dict.fromkeys(x, 1.0)
            before, x = (x, gap), {name: x[name] + factor[name] * gap[name] for name in x}
    return False


def _steps(x: State, gap: State, x_before: State, gap_before: State) -> State:
    """Factor of the plain step for each element, from the slope of the gap between two rounds."""
    factors = {}
    for name in x:
        factor = (x_before[name] - x[name]) / (gap[name] - gap_before[name])
        size = np.abs(factor)
        limited = factor * np.clip(size, 0.05, 10.0) / size  # of the plain iteration's step
        factors[name] = np.where(np.isfinite(size) & (np.real(factor) > 0), limited, 1.0)
    return factors
