"""Loops of a graph: the order of its evaluation, and the fixed point of what an effect causes and is caused by."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

TOLERANCE = 1e-13  # relative change in going once around
MOST_ROUNDS = 200
LEAST_STEP, MOST_STEP = 0.05, 10.0  # of the plain iteration's step

State = dict[str, Any]


def components(reads: Mapping[str, Sequence[str]]) -> list[list[str]]:
    """Strongly connected parts of a graph, those that are read first coming first.

    Parameters
    ----------
    reads : mapping
        Node to the nodes that it reads; names that are no node are passed over.

    Examples
    --------
    >>> components({"a": ["b"], "b": ["c"], "c": []})
    [['c'], ['b'], ['a']]
    >>> components({"a": ["b"], "b": ["a"]})
    [['a', 'b']]
    """
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []
    for root in sorted(reads):
        path = [] if root in index else [root]  # from the root to where the search is (Tarjan 1972)
        ahead = {root: iter(reads[root])}
        while path:
            node = path[-1]
            if node not in index:
                index[node] = low[node] = len(index)
                stack.append(node)
            other = next((r for r in ahead[node] if r in reads and (r not in index or r in stack)), None)
            if other is None:
                path.pop()
                if path:
                    low[path[-1]] = min(low[path[-1]], low[node])
                if low[node] == index[node]:
                    found.append(sorted(stack[stack.index(node) :]))
                    del stack[stack.index(node) :]
            elif other in index:
                low[node] = min(low[node], index[other])
            else:
                path.append(other)
                ahead[other] = iter(reads[other])
    return found


def cut(loop: Sequence[str], reads: Mapping[str, Sequence[str]]) -> tuple[list[str], tuple[str, ...]]:
    """Order in which to go around a loop, and the nodes whose values must be guessed for it.

    Nodes are cut one after another, each time the one that leaves the fewest nodes in circles.

    Examples
    --------
    >>> cut(["a", "b", "c"], {"a": ["c"], "b": ["a"], "c": ["b"]})
    (['b', 'c', 'a'], ('a',))
    """
    guessed: list[str] = []

    def without(more: Sequence[str]) -> dict[str, list[str]]:
        return {node: [r for r in reads[node] if r in loop and r not in more] for node in loop}

    def circling(more: Sequence[str]) -> int:
        left = without(more)
        return sum(len(part) for part in components(left) if len(part) > 1 or part[0] in left[part[0]])

    while circling(guessed):
        guessed.append(min(loop, key=lambda node: circling([*guessed, node])))
    return [node for part in components(without(guessed)) for node in part], tuple(guessed)


def settle(once_around: Callable[[Mapping[str, Any]], State], guess: State) -> bool:
    """Iterate ``x -> once_around(x)`` to its fixed point; whether it settles.

    Each element takes its own secant step (Aitken 1926): the change from one round to the next tells the loop's
    gain q, and 1/(1-q) of the plain step leads to where it ends. A loop that swings is damped that way, one that
    contracts slowly is sped up. A gain above one has no stable fixed point: the plain step then runs away, and
    that is what the caller is told.

    Parameters
    ----------
    once_around : callable
        Values that the guess leads to; the last call leaves the solution behind.
    guess : dict
        Start.

    Examples
    --------
    >>> seen = []
    >>> settle(lambda x: seen.append(x) or {"x": np.cos(x["x"])}, {"x": np.float64(1.0)})
    True
    >>> round(float(seen[-1]["x"]), 12), len(seen) < 10
    (0.739085133215, True)
    """
    x = {name: np.asarray(value) for name, value in guess.items()}
    before: tuple[State, State] | None = None
    for _ in range(MOST_ROUNDS):
        new = once_around(x)
        gap = {name: new[name] - x[name] for name in x}
        worst = max(_relative(gap[name], new[name], x[name]) for name in x)
        if not np.isfinite(worst):
            return False
        if worst < TOLERANCE:
            return True
        factor = _steps(x, gap, *before) if before else dict.fromkeys(x, 1.0)
        before = (x, gap)
        x = {name: x[name] + factor[name] * gap[name] for name in x}
    return False


def _relative(gap: Any, new: Any, old: Any) -> float:
    return float(np.max(np.abs(gap) / (np.abs(new) + np.abs(old) + 1e-300)))


def _steps(x: State, gap: State, x_before: State, gap_before: State) -> State:
    """Factor of the plain step for each element, from the slope of the gap between two rounds."""
    factors = {}
    for name in x:
        with np.errstate(divide="ignore", invalid="ignore"):  # an element that has arrived does not move
            factor = (x_before[name] - x[name]) / (gap[name] - gap_before[name])
        size = np.abs(factor)
        usable = np.isfinite(size) & (np.real(factor) > 0)
        limited = np.where(usable, factor, 1.0) * (
            np.clip(size, LEAST_STEP, MOST_STEP) / np.where(usable, size, 1.0)
        )
        factors[name] = np.where(usable, limited, 1.0)
    return factors
