"""Order of evaluation of a graph that may hold loops."""

from __future__ import annotations

from collections.abc import Mapping, Sequence


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

    def visit(node: str) -> None:  # Tarjan 1972
        index[node] = low[node] = len(index)
        stack.append(node)
        for other in reads[node]:
            if other not in reads:
                continue
            if other not in index:
                visit(other)
                low[node] = min(low[node], low[other])
            elif other in stack:
                low[node] = min(low[node], index[other])
        if low[node] == index[node]:
            part = []
            while True:
                part.append(stack.pop())
                if part[-1] == node:
                    break
            found.append(sorted(part))

    for node in sorted(reads):
        if node not in index:
            visit(node)
    return found
