"""Microphones with swapped wires among those of a phase group."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

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


def _wrap(degrees: float) -> float:
    return (degrees + 180.0) % 360.0 - 180.0
