"""Many channels a few at a time: what an analysis holds in memory does not grow with their number."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

# Channels whose bands are found together. A channel takes up to 8 MB for its lags and transforms at every stage of
# decimation; the bands of one do not depend on the others.
AT_ONCE = 32


Found = TypeVar("Found")


def slices(count: int) -> Iterator[slice]:
    """Groups of at most `AT_ONCE` of `count` channels.

    Examples
    --------
    >>> [(few.start, few.stop) for few in slices(70)]
    [(0, 32), (32, 64), (64, 96)]
    """
    return (slice(first, first + AT_ONCE) for first in range(0, count, AT_ONCE))


def joined(parts: Sequence[Found], by_channel: Sequence[str]) -> Found:
    """One result of the results of groups; what is not `by_channel` is the same in all of them."""
    first: Any = parts[0]
    if len(parts) == 1:
        return parts[0]
    return replace(first, **{name: _stacked([getattr(p, name) for p in parts]) for name in by_channel})


def _stacked(values: Sequence[Any]) -> Any:
    first = values[0]
    if first is None:
        return None
    if isinstance(first, tuple):
        return tuple(each for value in values for each in value)
    if isinstance(first, Mapping):
        return {key: _stacked([value[key] for value in values]) for key in first}
    if isinstance(first, np.ndarray):
        return np.concatenate(values)
    return joined(values, ("level_dB", "overall_dB"))
