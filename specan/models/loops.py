"""Loops of a graph: the order of its evaluation, and the fixed point of what an effect causes and is caused by."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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
    if len(loop) == 1 and loop[0] not in reads[loop[0]]:  # nearly all of them
        return [*loop], ()
    guessed: list[str] = []

    def walk(more: Sequence[str]) -> tuple[int, list[str]]:
        """Nodes that are in circles without these, and all of them in order."""
        left = {node: [r for r in reads[node] if r in loop and r not in more] for node in loop}
        parts = components(left)
        circling = sum(len(part) for part in parts if len(part) > 1 or part[0] in left[part[0]])
        return circling, [node for part in parts for node in part]

    while walk(guessed)[0]:
        guessed.append(min(loop, key=lambda node: walk([*guessed, node])[0]))
    return walk(guessed)[1], tuple(guessed)


class FixedPoint:
    """A fixed point that is looked for by going around a loop: ``x -> around(x)``.

    Each element takes its own secant step (Aitken 1926): the change from one round to the next tells the loop's
    gain q, and 1/(1-q) of the plain step leads to where it ends. A loop that swings is damped that way, one that
    contracts slowly is sped up. A gain above one has no stable fixed point: the plain step then runs away, and
    that is what the caller is told.

    Parameters
    ----------
    guess : mapping
        Start.

    Attributes
    ----------
    guess : dict
        Where the next round is to begin.
    settled : bool
        Whether the last round led to where it began.
    goes_on : bool
        Whether another round is wanted; not where it is settled, runs away, or has taken 200 rounds.

    Examples
    --------
    >>> point = FixedPoint({"x": np.float64(1.0)})
    >>> while point.goes_on:
    ...     point.take({"x": np.cos(point.guess["x"])})
    >>> point.settled, round(float(point.guess["x"]), 12), point.rounds < 10
    (True, 0.739085133215, True)
    """

    def __init__(self, guess: Mapping[str, Any]) -> None:
        self.guess: State = {name: np.asarray(value) for name, value in guess.items()}
        self.settled, self.goes_on, self.rounds = False, True, 0
        self._before: tuple[State, State] | None = None

    def take(self, new: State) -> None:
        """Take in the values that the guess has led to."""
        x = self.guess
        gap = {name: new[name] - x[name] for name in x}
        worst = max(_relative(gap[name], new[name], x[name]) for name in x)
        self.rounds += 1
        self.settled = worst < TOLERANCE
        self.goes_on = bool(np.isfinite(worst)) and not self.settled and self.rounds < MOST_ROUNDS
        if self.goes_on:
            factor = _steps(x, gap, *self._before) if self._before else dict.fromkeys(x, 1.0)
            self._before = (x, gap)
            self.guess = {name: x[name] + factor[name] * gap[name] for name in x}


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
