"""Which column of a table is which of a model's, and in which unit, whatever the table calls it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from specan.errors import InputError, RequestError, nearest
from specan.models import Condition, Model, Observable
from specan.study.data.table_file import TableFile
from specan.units import convert, is_compatible, scale_to

MARKS = ("repeat", "setup")

# "n [1/min]", "n (1/min)", "n / (1/min)", "n / rpm"
_WITH_UNIT = re.compile(r"^(?P<name>.*?)\s*(?:\[(?P<a>[^]]*)\]|\((?P<b>[^)]*)\)|\s/\s*(?P<c>.+))\s*$")


_PER_SECOND = ("1/s", "/s", "s^-1", "s-1", "s**-1", "s⁻¹", "hz")  # turns or radians: a factor of 2 pi


@dataclass(eq=False)
class ColumnNames:
    """Names and units of a table's columns for a model.

    Attributes
    ----------
    chosen : mapping
        ``{column of the model: header of the table}`` that a user gave; with one given, headers that are nothing
        known are passed over.
    lenient : bool
        Pass such headers over in any case.
    """

    path: Path
    model: Model
    chosen: Mapping[str, str] = field(default_factory=dict)
    lenient: bool = False
    units: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    passed_over: list[str] = field(default_factory=list)

    def choose(self, headers: Iterable[str]) -> dict[str, str]:
        """Header to the model's column, for the headers that are used.

        Raises
        ------
        InputError
            Headers that are nothing known, all of them; a chosen header that the table does not have.
        """
        headers = list(headers)
        wanted = self._wanted(headers)
        found: dict[str, str] = {}
        unknown: list[str] = []
        for header in headers:
            column, unit = wanted.get(header) or self._recognised(header)
            if not column:
                unknown.append(header)
                continue
            if column in found.values():
                other = next(h for h, c in found.items() if c == column)
                raise InputError(
                    f"{self.path}: {other!r} and {header!r} are both the column {column!r}",
                    remedy=f'choose with --column "{column}={header}", or leave one of them out',
                )
            found[header] = column
            if unit:
                self.units[column] = unit
        if unknown and not self.chosen and not self.lenient:
            raise self._unknown(unknown, found)
        self.passed_over = unknown
        return found

    def convert(self, table: TableFile) -> None:
        """Turn columns with a unit of their own into the model's units, in place.

        Raises
        ------
        InputError
            A unit that does not fit.
        """
        for name, cell_unit in table.cell_units.items():
            self.units.setdefault(name, cell_unit)
        for name, header in self.chosen.items():
            column = self._column_called(name)
            if column not in self.units and column in self._targets and column not in self.model.groups:
                known = self._targets[column]
                unit = known.column_unit or known.unit
                self.notes.append(
                    f'{header!r} says no unit: taken to be in {unit} (else: --column "{name}={header} [UNIT]")'
                )
        if self.passed_over:
            self.notes.append(f"columns passed over: {', '.join(self.passed_over)}")
        for name, unit in self.units.items():
            if name in self.model.groups:
                continue
            target = self._targets.get(name)
            wanted = (target.column_unit or target.unit) if target is not None else unit
            if wanted == unit:
                continue
            if unit.lower() in _PER_SECOND and is_compatible("rpm", wanted):
                raise InputError(
                    f"{self.path}: the column {name!r} is in {unit!r}, which may be turns or radians a second",
                    remedy="write rps or rad/s",
                )
            try:
                table.columns[name] = np.asarray(convert(table.columns[name], unit, wanted), dtype=float)
                table.steps[name] *= scale_to(unit, wanted)
            except RequestError:
                raise InputError(
                    f"{self.path}: the column {name!r} is in {unit!r}",
                    expected=f"a unit of {name}, which the model has in {wanted}",
                    remedy="correct the unit in the table's header, or in the model",
                ) from None

    # --- how a header is recognised ---------------------------------------------------------------

    @property
    def _targets(self) -> dict[str, Condition | Observable]:
        conditions = {c.column: c for c in self.model.conditions.values() if c.column}
        return {**conditions, **{o.header: o for o in self.model.observables.values() if o.kind == "table"}}

    def _wanted(self, headers: list[str]) -> dict[str, tuple[str, str]]:
        """What a user chose: header to column and unit."""
        found = {}
        for name, header in self.chosen.items():
            column = self._column_called(name)
            said = _WITH_UNIT.match(header)
            if header not in headers and said is not None and said["name"] in headers:
                header = said["name"]  # the user says the unit that the table does not
            if header not in headers:
                raise InputError(
                    f"{self.path} has no column {header!r}, which is to be {name!r}",
                    remedy=nearest(header, headers),
                )
            found[header] = (column, _unit(said) if said else "")
        return found

    def _column_called(self, name: str) -> str:
        if name in self._targets or name in MARKS:
            return name
        for column, target in self._targets.items():
            if target.name == name:
                return column
        raise InputError(
            f"{self.model.name} has no column {name!r}", remedy=nearest(name, [*self._targets, *MARKS])
        )

    def _recognised(self, header: str) -> tuple[str, str]:
        """Column and unit of a header that names a column as it is, or a name with its unit behind."""
        if header in self._targets or header in MARKS:
            return header, ""
        other_letters = [c for c in (*self._targets, *MARKS) if _plain(c) == _plain(header)]
        if len(other_letters) == 1:
            return other_letters[0], ""
        said = _WITH_UNIT.match(header)
        if said is None:
            return "", ""
        name = _plain(said["name"])
        close = [c for c, t in self._targets.items() if name in _aliases(c, t)]
        return (close[0], _unit(said)) if len(close) == 1 else ("", "")

    def _unknown(self, unknown: list[str], known: Mapping[str, str]) -> InputError:
        allowed = [*self._targets, *MARKS]
        hints = []
        for header in unknown:
            said = _WITH_UNIT.match(header)
            stem = said["name"] if said else header
            same = [c for c in allowed if c.rsplit("_", 1)[0] == stem.rsplit("_", 1)[0]]
            hint = f"the unit belongs to the name: give {same[0]!r}" if same else nearest(stem, allowed)
            hints.append(hint.rstrip("?"))
        names = ", ".join(map(repr, unknown))
        said_hints = "; ".join(
            f"{header!r}: {hint}" for header, hint in zip(unknown, hints, strict=True)
        ) if len(set(hints)) > 1 else hints[0]  # fmt: skip
        example = next((c for c in self._targets if c not in known.values()), "")
        way = f'say which is which with --column "{example}={unknown[0]}"'
        if not example:
            header, column = next(iter(known.items()))
            way = f'nothing is lacking; to pass over the rest, give --column "{column}={header}"'
        return InputError(
            f"{self.path}: unknown column{'s' if len(unknown) > 1 else ''} {names}",
            remedy=f"{said_hints}; {way}; a column whose name begins with 'note' is passed over",
        )


def _unit(said: re.Match[str]) -> str:
    return (said["a"] or said["b"] or (said["c"] or "").strip("()")).strip()


def _plain(name: str) -> str:
    return re.sub(r"[\s_]+", " ", name.strip()).lower()


def _aliases(column: str, target: Condition | Observable) -> set[str]:
    """Names under which a header may have a column, without its unit."""
    stem, _, suffix = column.rpartition("_")
    names = {column, target.name, *([stem] if stem and suffix else [])}
    if isinstance(target, Condition):
        names.add(target.words)
    return {_plain(name) for name in names}
