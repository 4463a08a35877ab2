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
