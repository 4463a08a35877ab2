"""What sentences and axes call a variable over which a residual is looked at."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Variable:
    """Words and printed unit of a variable.

    Attributes
    ----------
    words : str
        Its name in a sentence.
    unit : str
        As printed; empty for a name or a plain number.
    before : bool
        Whether the words stand before the level, and the level needs no other words.

    Examples
    --------
    >>> Variable("output force", "kN").spoken(2.5), Variable("measurement").spoken("table_7.csv")
    ('2.5 kN (output force)', 'table_7.csv (measurement)')
    >>> Variable("receivers near", before=True).spoken("y1")
    'receivers near y1'
    """

    words: str
    unit: str = ""
    before: bool = False

    def short(self, level: Any) -> str:
        """A level without the variable's name: ``2.5 kN``."""
        value = level if isinstance(level, str) else f"{level:g} {self.unit}".rstrip()
        return f"{self.words} {value}" if self.before else value

    def spoken(self, level: Any) -> str:
        """A level in words: ``2.5 kN (output force)``."""
        return self.short(level) if self.before else f"{self.short(level)} ({self.words})"

    @property
    def axis(self) -> str:
        """Label of an axis: ``output force / kN``."""
        return f"{self.words} / {self.unit}" if self.unit else self.words


def variable_named(name: str, variables: Mapping[str, Variable]) -> Variable:
    """The variable of a name; without words of its own, its name serves."""
    return variables.get(name) or Variable(name.replace("_", " "))
