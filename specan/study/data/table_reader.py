"""From a table file, whatever it calls its columns, to the columns that a model has, in its units."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from specan.errors import InputError, RequestError, nearest, require_known
from specan.models import Condition, Model, Observable, TableFault
from specan.study.data.table_file import Table, read_table
from specan.study.observation import DataFile
from specan.units import convert, is_compatible, scale_to

# readings of one round share the first, those of one set-up of a condition the second
MARKS = ("repeat", "setup")

# "n [1/min]", "n (1/min)", "n / (1/min)", "n / rpm"
_WITH_UNIT = re.compile(r"^(?P<name>.*?)\s*(?:\[(?P<a>[^]]*)\]|\((?P<b>[^)]*)\)|\s/\s*(?P<c>.+))\s*$")
_PER_SECOND = ("1/s", "/s", "s^-1", "s-1", "s**-1", "s⁻¹", "hz")  # turns or radians: a factor of 2 pi


def read_measurement(file: DataFile, model: Model) -> Table:
    """Read a table as a measurement of what a model predicts: its columns, checked, in the units of the model's.

    Parameters
    ----------
    file : DataFile
        Where it names `columns`, headers that are nothing known are ignored.
    model : Model
        Says which columns there may be.

    Raises
    ------
    InputError
        Columns that are missing, unknown or contradict each other; values that cannot be.
    """
    path, names = file.path, ColumnNames(file.path, model, file.columns)
    table = read_table(path, names.choose, model.groups, file.sheet)
    table.name = file.name
    names.convert(table)
    known = {c.column: c for c in model.conditions.values() if c.column}
    measurable = [o.header for o in model.observables.values() if o.kind == "table"]
    for column, condition in known.items():
        if condition.default is not None and column in table.frame and table.frame[column].isna().all():
            table.frame = table.frame.drop(columns=column)
    _check_columns(table, model, known, measurable, file.conditions)
    _add_constants(table, file.conditions, known)
    if model.table_rules is not None:
        try:
            numbers = {n: table.frame[n].to_numpy() for n in table.frame if n not in model.groups}
            found = model.table_rules.complete(numbers, table.steps)
        except TableFault as fault:
            where = f"{path}" if fault.rows is None else f"{path}, {table.rows(fault.rows)}"
            raise InputError(
                f"{where}: {fault.found}", expected=fault.expected, remedy=fault.remedy
            ) from None
        table.frame = table.frame.assign(**found.columns)
        table.steps |= found.steps
        table.notes += found.notes + found.doubts
        table.doubts += found.doubts
    _check_filled(table, model, [*known], measurable)
    return table


def _check_filled(table: Table, model: Model, known: list[str], measurable: list[str]) -> None:
    """Refuse rows without a condition, a mark or a measured value."""
    remedies = {**dict.fromkeys(known, "fill it or leave the rows out"),
                **dict.fromkeys(MARKS, "number every row, or leave the column out")}  # fmt: skip
    for column, remedy in remedies.items():
        if column in table.frame:
            values = table.frame[column]
            lacking, what = (values == "", "name") if column in model.groups else (values.isna(), "value")
            table.refuse(lacking, f"no {what} in the column {column!r}", remedy=remedy)
    read = table.frame[[column for column in measurable if column in table.frame]]
    table.refuse(
        ~np.isfinite(read).any(axis=1), "no measured value", expected="one of " + ", ".join(measurable)
    )


def _check_columns(
    table: Table,
    model: Model,
    known: Mapping[str, Condition],
    measurable: list[str],
    constants: Mapping[str, Any],
) -> None:
    missing, rules = [], model.table_rules
    there = {*table.frame, *constants}
    for column, condition in known.items():
        sources = rules.derivable.get(column) if rules else None
        derivable = sources is not None and sources <= there
        if column not in there and condition.default is None and not derivable:
            missing.append(column)
    if missing:
        names, several = ", ".join(map(repr, missing)), len(missing) > 1
        groups = [axis for axis in missing if axis in model.groups]
        why = "".join(f", and {axis!r} says to which {axis} each row belongs" for axis in groups)
        raise InputError(
            f"{table.path}: the column{'s' if several else ''} {names} {'are' if several else 'is'} missing{why} "
            f"(found: {', '.join(table.frame)})",
            remedy=f'add it, or name its header: --column "{missing[0]}=HEADER"',
        )
    if there.isdisjoint(measurable):
        raise InputError(
            f"{table.path} has no column that the model predicts",
            expected="a column " + " or ".join(measurable),
        )


def _add_constants(table: Table, constants: Mapping[str, Any], known: Mapping[str, Condition]) -> None:
    for column, value in constants.items():
        require_known(column, known, f"{table.path}: unknown condition {column!r}", kind=InputError)
        if column in table.frame:
            raise InputError(
                f"{table.path} holds the column {column!r}, and the study gives it as a constant too",
                remedy="leave one of them out",
            )
        if isinstance(value, str) and not known[column].group:
            raise InputError(f"{table.path}: the condition {column!r} is {value!r}", expected="a number")
        table.frame[column] = str(value) if known[column].group else value
        table.steps[column] = 0.0


@dataclass(eq=False)
class ColumnNames:
    """Names and units of a table's columns for a model.

    Attributes
    ----------
    chosen : mapping
        ``{column of the model: header of the table}`` that a user gave; with one given, headers that are nothing
        known are ignored.
    lenient : bool
        Pass such headers over in any case.
    """

    path: Path
    model: Model
    chosen: Mapping[str, str] = field(default_factory=dict)
    lenient: bool = False
    units: dict[str, str] = field(default_factory=dict)
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
        for header in headers:
            column, unit = wanted.get(header) or self._recognised(header)
            if not column:
                self.passed_over.append(header)
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
        if self.passed_over and not self.chosen and not self.lenient:
            raise self._unknown(self.passed_over, found)
        return found

    def convert(self, table: Table) -> None:
        """Turn columns with a unit of their own into the model's units, in place.

        Raises
        ------
        InputError
            A unit that does not fit.
        """
        table.units |= self.units
        for name, header in self.chosen.items():
            column = self._column_called(name)
            if column not in table.units and column in self._targets and column not in self.model.groups:
                unit = _unit_of(self._targets[column])
                table.notes.append(
                    f'{header!r} states no unit: assumed to be in {unit} (else: --column "{name}={header} [UNIT]")'
                )
        if self.passed_over:
            table.notes.append(f"columns ignored: {', '.join(self.passed_over)}")
        for name, unit in table.units.items():
            if (
                name not in self._targets
                or name in self.model.groups
                or unit == _unit_of(self._targets[name])
            ):
                continue
            wanted = _unit_of(self._targets[name])
            if unit.lower() in _PER_SECOND and is_compatible("rpm", wanted):
                raise InputError(
                    f"{self.path}: the column {name!r} is in {unit!r}, which may be turns or radians a second",
                    remedy="write rps or rad/s",
                )
            try:
                table.frame[name] = convert(table.frame[name].to_numpy(), unit, wanted)
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
            title, unit = name_and_unit(header)
            if header not in headers:
                # The user says the unit that the table does not, or leaves it to the table.
                alike = [h for h in headers if h == title or name_and_unit(h)[0] == header]
                header = alike[0] if len(alike) == 1 else header
                unit = unit or name_and_unit(header)[1]
            lacking = f"{self.path} has no column {header!r}, for the column {name!r}"
            require_known(header, headers, lacking, kind=InputError)
            found[header] = (column, unit)
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
        columns = [*self._targets, *MARKS]
        title, unit = name_and_unit(header)
        close = [c for c in columns if c == header] or [c for c in columns if _plain(c) == _plain(header)]
        if not close and unit:
            close = [c for c, t in self._targets.items() if _plain(title) in _aliases(c, t)]
            close = [c for c in close if title in (c, self._targets[c].name)] or close  # t and T
        else:
            unit = ""
        return (close[0], unit) if len(close) == 1 else ("", "")

    def _unknown(self, unknown: list[str], known: Mapping[str, str]) -> InputError:
        allowed = [*self._targets, *MARKS]
        hints = []
        for header in unknown:
            stem = name_and_unit(header)[0]
            same = [c for c in allowed if c.rsplit("_", 1)[0] == stem.rsplit("_", 1)[0]]
            hint = f"the unit belongs to the name: give {same[0]!r}" if same else nearest(stem, allowed)
            hints.append(hint.rstrip("?"))
        names = ", ".join(map(repr, unknown))
        each = [f"{header!r}: {hint}" for header, hint in zip(unknown, hints, strict=True)]
        missing = [
            column
            for column, target in self._targets.items()
            if column not in known.values() and getattr(target, "default", None) is None
        ]
        if missing:
            way = f"assign columns with {self._assignment(missing, unknown)}"
        else:
            header, column = next(iter(known.items()))
            way = f'no column is missing; to ignore the others, give --column "{column}={header}"'
        return InputError(
            f"{self.path}: unknown column{'s' if len(unknown) > 1 else ''} {names}",
            remedy=f"{'; '.join(each) if len(set(hints)) > 1 else hints[0]}; {way}; a column whose name begins with "
            "'note' is ignored",
        )

    def _assignment(self, missing: Sequence[str], unknown: Sequence[str]) -> str:
        """Options that give missing columns the unknown headers whose units fit; the first two where none does."""
        left, pairs = list(unknown), []
        for column in missing:
            unit = _unit_of(self._targets[column])
            fits = [h for h in left if (own := name_and_unit(h)[1]) and is_compatible(own, unit)]
            if fits:
                left.remove(fits[0])
                pairs.append(f'--column "{column}={fits[0]}"')
        return " ".join(pairs) or f'--column "{missing[0]}={unknown[0]}"'


def _unit_of(target: Condition | Observable) -> str:
    return target.column_unit or target.unit


def name_and_unit(header: str) -> tuple[str, str]:
    """A header's name and unit."""
    said = _WITH_UNIT.match(header)
    if said is None:
        return header, ""
    return said["name"], (said["a"] or said["b"] or (said["c"] or "").strip("()")).strip()


def _plain(name: str) -> str:
    return re.sub(r"[\s_]+", " ", name.strip()).lower()


def _aliases(column: str, target: Condition | Observable) -> set[str]:
    """Names under which a header may have a column, without its unit."""
    stem, _, suffix = column.rpartition("_")
    names = {column, target.name, *([stem] if stem and suffix else [])}
    if isinstance(target, Condition):
        names.add(target.words)
    return {_plain(name) for name in names}
