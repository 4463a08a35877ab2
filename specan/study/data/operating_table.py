"""The rows of all tables of a study, with what belongs together: recordings, conditions, set-ups."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.errors import InputError
from specan.models import Condition, Model, SettingError
from specan.study.data.plausible_rows import check_limits, duplicates
from specan.study.data.setpoints import apart_in_rounds, cells, grouped, levels
from specan.study.data.table_reader import Measurement
from specan.study.observation import Array, Variable
from specan.units import convert, printed_unit

NEXT, LATER = 0.5, 0.1  # standard deviations of setting within which two rows are readings of one setting
ENOUGH = 8  # degrees of freedom above which repeats are believed

TIME = "elapsed_time"  # orders the readings; never a setting


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of one or several tables.

    Attributes
    ----------
    conditions : dict
        SI values by the model's names.
    levels : dict
        Of each condition, the value that a row was meant to be at.
    is_set : dict
        Whether a condition's column holds set values rather than readings.
    steps : dict
        Printed step of each condition, and under ``""`` that of the observable; SI.
    replicate_group : array of int
        Rows that were meant to be alike share a number.
    setup : array of int
        Rows that were read without setting anything in between share a number.
    setups_from : str
        How set-ups were distinguished: ``setup``, ``repeat`` or ``order``.
    groups : mapping
        Names of each group; the rows' conditions hold their numbers.
    """

    recordings: tuple[str, ...]
    recording: NDArray[np.intp]
    lines: NDArray[np.int_]
    observable: NDArray[np.str_]
    measured: Array
    conditions: dict[str, Array]
    levels: dict[str, Array]
    is_set: dict[str, bool]
    steps: dict[str, Array]
    replicate_group: NDArray[np.intp]
    setup: NDArray[np.intp]
    setups_from: str
    notes: tuple[str, ...] = ()
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def n(self) -> int:
        """Number of rows."""
        return int(self.measured.size)

    def take(self, mask: NDArray[np.bool_]) -> Rows:
        """Keep some of the rows."""
        return replace(
            self,
            recording=self.recording[mask],
            lines=self.lines[mask],
            observable=self.observable[mask],
            measured=self.measured[mask],
            conditions={name: values[mask] for name, values in self.conditions.items()},
            levels={name: values[mask] for name, values in self.levels.items()},
            steps={name: values[mask] for name, values in self.steps.items()},
            replicate_group=self.replicate_group[mask],
            setup=self.setup[mask],
        )

    def names_of_first(self, mask: NDArray[np.bool_]) -> Rows:
        """The same with groups that hold the names of some rows only; other names have numbers behind them."""
        conditions, levels, groups = dict(self.conditions), dict(self.levels), dict(self.groups)
        for axis, names in self.groups.items():
            codes = self.conditions[axis].astype(int)
            used = [k for k in range(len(names)) if k in set(codes[mask].tolist())]
            order = [*used, *(k for k in range(len(names)) if k not in used)]
            conditions[axis] = levels[axis] = np.argsort(order)[codes].astype(float)
            groups[axis] = tuple(names[k] for k in used)
        return replace(self, conditions=conditions, levels=levels, groups=groups)

    def place(self, row: int) -> str:
        """File and line of a row, for messages."""
        return f"{self.recordings[self.recording[row]]}, line {self.lines[row]}"

    def variables(self, model: Model) -> dict[str, Variable]:
        """Words and unit of each label."""
        known = {c.column: Variable(c.words, printed_unit(c.column_unit)) for c in model.conditions.values()}
        return {name: known.get(name, Variable(name)) for name in self.labels(model)}

    def labels(self, model: Model) -> dict[str, NDArray[Any]]:
        """Levels of the operating variables that vary, in the units of their columns; where from."""
        found: dict[str, NDArray[Any]] = {}
        for name, level in self.levels.items():
            condition = model.conditions[name]
            if condition.group:
                if np.unique(level).size > 1:
                    names = (*self.groups[name], "another")
                    found[name] = np.array(names)[np.minimum(level.astype(int), len(names) - 1)]
                continue
            if condition.varies and np.unique(level).size > 1:
                shown = np.asarray(convert(grouped(level), condition.unit, condition.column_unit))
                digits = 6 if self.is_set[name] else 3
                found[condition.column] = np.array([float(f"{value:.{digits}g}") for value in shown])
        if len(self.recordings) > 1:
            found["measurement"] = np.array(self.recordings)[self.recording]
        return found


def grouping_of(model: Model, condition: Condition) -> SettingError:
    """Uncertainty of setting by which levels are distinguished: the rig's, or what is usual for the condition."""
    return model.rig.setting.get(condition.name, condition.usual_setting)


def join(measurements: Sequence[Measurement], model: Model) -> Rows:
    """Put the rows of several tables under each other.

    A condition that some tables lack takes its default there; without a default it is left out of all.
    """
    sizes = [m.n for m in measurements]
    recording = np.repeat(np.arange(len(sizes)), sizes)
    conditions, steps, notes = _conditions(measurements, model)
    groups = {
        axis: tuple(dict.fromkeys(n for m in measurements for n in m.groups[axis])) for axis in model.groups
    }
    for axis, names in groups.items():
        conditions[axis] = np.array([float(names.index(n)) for m in measurements for n in m.groups[axis]])
        steps[axis] = np.zeros(recording.size)
    settings = {n: grouping_of(model, model.conditions[n]) for n in conditions}
    lines = np.concatenate([m.lines for m in measurements])
    places = [f"{measurements[int(k)].name}, line {line}" for k, line in zip(recording, lines, strict=True)]
    outside = check_limits(conditions, places, model, settings)
    measured = np.concatenate([m.measured for m in measurements])
    copied = duplicates([*conditions.values(), measured], places) if conditions else ""
    distinct = np.unique(np.stack([*conditions.values()], axis=1), axis=0) if conditions else np.empty((0, 0))
    level, is_set = {}, {}
    for k, (name, values) in enumerate(conditions.items()):
        if name in groups:
            level[name], is_set[name] = values, True
            continue
        points, is_set[name] = levels(distinct[:, k], settings[name])
        back = dict(zip(distinct[:, k].tolist(), points.tolist(), strict=True))
        level[name] = np.array([back[x] for x in values.tolist()])
    level = parted(level, is_set, measurements, recording, conditions, settings)
    exact = not_repeats(measurements, conditions, level, model)
    alike = cells(*(conditions[n] if n in exact else v for n, v in level.items() if n != TIME))
    nearness = said_of_near_rows(conditions, level, exact, alike, lines, measurements, recording)
    replicate_group = _within_files(alike, recording)
    setup, how = _setups(measurements, recording, replicate_group, conditions, settings)
    return Rows(
        recordings=tuple(m.name for m in measurements),
        recording=recording,
        lines=lines,
        observable=np.concatenate([m.observable for m in measurements]),
        measured=measured,
        conditions=conditions,
        levels=level,
        is_set=is_set,
        steps=steps,
        replicate_group=replicate_group,
        setup=setup,
        setups_from=how,
        notes=(
            *(f"{m.name}: {note}" for m in measurements for note in m.notes),
            *notes,
            *outside,
            *nearness,
            *([copied] if copied else []),
        ),
        groups=groups,
    )


def _conditions(
    measurements: Sequence[Measurement], model: Model
) -> tuple[dict[str, Array], dict[str, Array], list[str]]:
    conditions: dict[str, Array] = {}
    steps = {"": np.concatenate([m.steps[""] for m in measurements])}
    notes = []
    for name, condition in model.conditions.items():
        have = [name in m.conditions for m in measurements]
        if not any(have):
            continue
        default = np.nan if condition.default is None else condition.default
        if not all(have) and np.isnan(default):
            lacking = ", ".join(m.name for m, h in zip(measurements, have, strict=True) if not h)
            notes.append(f"{condition.column} is left out: {lacking} has no such column")
            continue
        fill = float(convert(default, condition.column_unit, condition.unit))
        conditions[name] = np.concatenate([m.conditions.get(name, np.full(m.n, fill)) for m in measurements])
        steps[name] = np.concatenate([m.steps.get(name, np.zeros(m.n)) for m in measurements])
        if not all(have):
            notes.append(f"{condition.column} is taken as {default:g} where a table has no such column")
    return conditions, steps, notes


def _within_files(alike: NDArray[np.intp], recording: NDArray[np.intp]) -> NDArray[np.intp]:
    """Repeats are looked for inside each file, where there are enough of them.

    What differs between files (another day, another specimen) is common to all rows of a file and no
    scatter. Files that hold one round of the same plan each are repeats of each other.
    """
    apart = cells(recording, alike)
    repeats = alike.size - np.unique(apart).size
    return apart if repeats >= ENOUGH else alike


def _setups(
    measurements: Sequence[Measurement],
    recording: NDArray[np.intp],
    replicate_group: NDArray[np.intp],
    conditions: Mapping[str, Array],
    settings: Mapping[str, SettingError],
) -> tuple[NDArray[np.intp], str]:
    for how in ("setup", "repeat"):
        marks = [getattr(m, how) for m in measurements]
        if all(mark is not None for mark in marks):
            marked = cells(recording, replicate_group, np.concatenate(marks))
            if how == "setup":
                return marked, how
            # One round sets a condition once: rows of it at other values are other settings, not second readings.
            order = np.argsort(marked, kind="stable")
            new = (np.diff(marked[order], prepend=-1) != 0) | _set_anew(conditions, settings, order)
            number = np.empty(order.size, dtype=np.intp)
            number[order] = np.cumsum(new)
            return number, how
    # Without a mark: the next row at the same condition, at values that were not set anew, is a second
    # reading; a condition that comes back later was set again.
    everything = np.arange(recording.size)
    changed = (np.diff(recording, prepend=-1) != 0) | (np.diff(replicate_group, prepend=-1) != 0)
    return np.cumsum(changed | _set_anew(conditions, settings, everything)), "order"


def _set_anew(
    conditions: Mapping[str, Array], settings: Mapping[str, SettingError], order: NDArray[np.intp]
) -> NDArray[np.bool_]:
    """Whether a row lies further from the one before it, in an order, than readings of one setting do.

    Half the scatter of setting where the one row follows the other in the table, a tenth where other rows lie between.
    """
    changed = np.zeros(order.size, dtype=bool)
    share = np.where(np.diff(order, prepend=-1) == 1, NEXT, LATER)
    for name, values in conditions.items():
        if name != TIME:
            ordered = values[order]
            apart = np.abs(np.diff(ordered, prepend=ordered[0]))
            changed |= apart > share * settings[name].at(ordered) + 1e-12
    return changed


def check_varied(rows: Rows, model: Model) -> None:
    """Refuse a single condition, or rows that are all alike: no model can be tested on them."""
    if all(np.unique(values).size < 2 for name, values in rows.levels.items() if name != TIME):
        there = ", ".join(rows.recordings)
        what = "one row" if rows.n == 1 else f"{rows.n} rows, all at the same condition"
        raise InputError(
            f"{there}: {what}",
            expected="at least two different operating conditions",
            remedy=f"measure at other {model.words.vary}",
        )


def not_repeats(
    measurements: Sequence[Measurement],
    conditions: Mapping[str, Array],
    level: Mapping[str, Array],
    model: Model,
) -> tuple[str, ...]:
    """Conditions at which rows are alike only where their values are equal: nobody has said how well they are set."""
    if all(m.repeat is not None for m in measurements) or all(m.setup is not None for m in measurements):
        return ()
    return tuple(
        name
        for name in conditions
        if model.conditions[name].setting_assumed
        and name not in model.rig.setting
        and not np.array_equal(conditions[name], level[name])
    )


def said_of_near_rows(
    conditions: Mapping[str, Array],
    level: Mapping[str, Array],
    exact: Sequence[str],
    alike: NDArray[np.intp],
    lines: NDArray[np.int_],
    measurements: Sequence[Measurement],
    recording: NDArray[np.intp],
) -> list[str]:
    """Which rows that are near each other are taken for repeats, or are not, and why."""
    near = cells(*(v for n, v in level.items() if n != TIME))
    differ = [n for n, v in conditions.items() if n != TIME and not np.array_equal(v, level[n])]
    marked = all(m.repeat is not None for m in measurements) or all(m.setup is not None for m in measurements)
    groups = [np.flatnonzero(near == k) for k in np.unique(near)]
    taken = [
        g
        for g in groups
        if np.unique(alike[g]).size < g.size and any(np.ptp(conditions[n][g]) > 0 for n in differ)
    ]
    left = [g for g in groups if np.unique(alike[g]).size > 1]

    def some(found: list[NDArray[np.intp]]) -> str:
        texts = [", ".join(str(lines[k]) for k in g[:4]) for g in found[:3]]
        more = f", and {len(found) - 3} more groups" if len(found) > 3 else ""
        file = f"{measurements[int(recording[found[0][0]])].name}: " if len(measurements) > 1 else ""
        return file + "lines " + "; ".join(texts) + more

    said = []
    if left:
        said.append(
            f"{some(left)}: near each other in {' and '.join(exact)}, and not taken for repeats, since nothing "
            f"says how well it is set (declare {exact[0]}_setting_percent, or give a column 'repeat')"
        )
    if taken and not marked and not left:
        said.append(
            f"{some(taken)}: taken for repeats, since they differ in {' and '.join(differ)} by no more than the "
            "scatter of setting"
        )
    return said


def parted(
    level: dict[str, Array],
    is_set: Mapping[str, bool],
    measurements: Sequence[Measurement],
    recording: NDArray[np.intp],
    conditions: Mapping[str, Array],
    settings: Mapping[str, SettingError],
) -> dict[str, Array]:
    """Levels parted by what a round of the plan holds, where the tables number the rounds."""
    marks = [m.repeat for m in measurements if m.repeat is not None]
    if len(marks) < len(measurements) or any(m.setup is not None for m in measurements):
        return level
    rounds = cells(recording, np.concatenate(marks))
    for name, values in conditions.items():
        if name != TIME and not is_set[name]:
            others = [c for other, c in level.items() if other not in (name, TIME)]
            scatter = np.asarray(settings[name].at(values), dtype=float) + 1e-300
            level[name] = apart_in_rounds(values, level[name], cells(rounds, *others), scatter)
    return level
