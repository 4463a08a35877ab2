"""What a model brings for each kind of measurement that it can be held against.

Of tables the rules that their rows obey: columns that follow from others, values that cannot be.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from specan.arrays import Flags, Real

Columns = Mapping[str, Real]


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

    def __init__(self, found: str, rows: Flags | None = None, expected: str = "", remedy: str = "") -> None:
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
    doubts : tuple of str
        What looks wrong, to be said beside every verdict.
    """

    columns: Columns
    steps: Columns
    notes: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()


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
