"""What a model brings for each kind of measurement that it can be held against.

Of tables the rules that their rows obey: columns that follow from others, values that cannot be. Of transfer functions
the receivers: their places and their errors.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Columns = Mapping[str, Array]


class TableFault(Exception):
    """What is wrong with a table; whoever reads the file says which file and lines.

    Parameters
    ----------
    found : str
        What was found.
    rows : array of bool, optional
        The rows that it is true of; the whole table by default.
    expected, remedy : str
        See `specan.errors.SpecanError`.
    """

    def __init__(
        self, found: str, rows: NDArray[np.bool_] | None = None, expected: str = "", remedy: str = ""
    ) -> None:
        super().__init__(found)
        self.found, self.rows, self.expected, self.remedy = found, rows, expected, remedy


@dataclass(frozen=True)
class Completed:
    """Columns that replace those of the table, the step in which each row's value was printed, and notes.

    Attributes
    ----------
    columns, steps : mapping
        ``{header: array (rows,)}``; NaN where a value is unknown or of no use.
    notes : tuple of str
        What was worked out or left out, for a person.
    """

    columns: Columns
    steps: Columns
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class TableRules:
    """What a model does with the columns of a table before they are compared with it.

    Attributes
    ----------
    complete : callable
        ``complete(columns, steps) -> Completed`` from the columns that a table has (in the units of their
        headers) and the steps in which they are printed. Raises `TableFault`.
    derivable : mapping
        ``{header: headers that it follows from}`` of conditions that a table need not hold.
    """

    complete: Callable[[Columns, Mapping[str, float]], Completed]
    derivable: Mapping[str, frozenset[str]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class PlacedEffects:
    """Effects that act at one place, and how the receivers hear what is emitted there.

    Whatever such an effect is, it changes the response by one factor a line times the response to a source at
    its place: a place can be looked for before anything else of the effect is known (matched-field processing:
    Baggeroer, Kuperman & Mikhalevsky 1993, IEEE J. Oceanic Eng. 18:401).

    Attributes
    ----------
    shapes : mapping
        Effect to the names of the two parameters that are its place, in parts of an element's edges.
    reads : tuple of str
        Quantities of the model that `patterns` needs.
    patterns : callable
        ``patterns(quantities, element, places) -> complex array (places, receivers, lines)``: response to a source
        at each of `places` (n, 2), to any scale.
    """

    shapes: Mapping[str, tuple[str, str]]
    reads: tuple[str, ...]
    patterns: Callable[[Mapping[str, Any], str, Array], NDArray[np.complex128]]


@dataclass(frozen=True, eq=False)
class NamedModes:
    """Modes of a field by name, so that a failure near one can be told by it.

    Attributes
    ----------
    reads : tuple of str
        Quantities of the model that `names` needs.
    names : callable
        ``names(quantities, f_max_hz) -> [(natural frequency, name), ...]``, the lowest first.
    """

    reads: tuple[str, ...]
    names: Callable[[Mapping[str, Any], float], list[tuple[float, str]]]


@dataclass(frozen=True, eq=False)
class ModeShifts:
    """Shifts of single modes, of which only a standard uncertainty is known: a fit finds them beside everything else.

    They are parameters of the model that no one names, in standard uncertainties.

    Attributes
    ----------
    parameters : tuple of str
        Full names of the two parameters, vectors over the modes: natural frequency, damping.
    size : int
        Number of modes.
    reads : tuple of str
        Quantities of the model that `columns` needs.
    columns : callable
        ``columns(quantities) -> iterator`` over the modes of (derivative by the mode's pole, array (receivers,
        frequencies); what one standard uncertainty of either parameter moves the pole).
    """

    parameters: tuple[str, str]
    size: int
    reads: tuple[str, ...]
    columns: Callable[[Mapping[str, Any]], Iterator[tuple[NDArray[np.complex128], tuple[complex, complex]]]]

    def of(self, values: Mapping[str, Any]) -> Array:
        """Shifts out of the values of parameters, array (2 modes,)."""
        return np.concatenate(
            [np.broadcast_to(np.asarray(values.get(n, 0.0), float), (self.size,)) for n in self.parameters]
        )

    def named(self, shifts: Array) -> dict[str, Array]:
        """The parameters, from shifts (2 modes,)."""
        return {self.parameters[0]: shifts[: self.size], self.parameters[1]: shifts[self.size :]}


@dataclass(frozen=True, eq=False)
class Receivers:
    """Channels at places, as far as where a model of their responses fails is told by them.

    Attributes
    ----------
    plural : str
        What they are called in sentences.
    groups : callable
        ``groups(channels) -> {name: numbers of some channels}`` at which a failure is looked for together.
    group_label, group_words : str
        Key of a group in results, and the words that stand before its name.
    placed : PlacedEffects, optional
        Effects at one place, if the model can tell how a place is heard.
    modes : NamedModes, optional
        Names of the field's modes, if the model knows any.
    shifts : ModeShifts, optional
        Shifts of single modes, if any are declared.
    """

    plural: str
    groups: Callable[[Sequence[str]], Mapping[str, list[int]]]
    group_label: str = "group"
    group_words: str = "receivers near"
    placed: PlacedEffects | None = None
    modes: NamedModes | None = None
    shifts: ModeShifts | None = None
