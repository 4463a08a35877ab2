"""Which readings were meant to be at the same setting, whether a column was set or read, which rows are repeats."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from specan.models import Condition, Model, SettingError
from specan.result import counted
from specan.study.observation import Array
from specan.units import convert

MOST_LEVELS = 20  # more values than this are cut into groups of neighbours
ENOUGH = 8  # degrees of freedom above which repeats are believed
TIME = "elapsed_time"  # orders the readings; never a setting


def grouping_of(model: Model, condition: Condition) -> SettingError:
    """Uncertainty of setting by which levels are distinguished: the rig's, or what is usual for the condition."""
    return model.rig.setting.get(condition.name, condition.setting)


def operating(model: Model, names: Iterable[str]) -> list[str]:
    """Those of some names that are operating variables of a model: numbers that vary, and not the time of a reading."""
    known = {n: c for n, c in model.conditions.items() if c.varies and not c.group and n != TIME}
    return [name for name in names if name in known]


def slope_by(x: Array, predict: Callable[[float], Array]) -> Array:
    """Derivative of a prediction by a condition with values `x`; `predict` moves these by so much."""
    step = 1e-3 * max(float(np.ptp(x)), 0.1 * float(np.abs(x).max()), 1e-9)
    slope = (predict(step) - predict(-step)) / (2 * step)
    return np.where(np.isfinite(slope), slope, 0.0)


def levels(values: Array, setting: SettingError, printed: Array | None = None) -> tuple[Array, bool]:
    """The level that each value was meant to be at, and whether the column holds set values.

    Values on a round grid that is coarser than the scatter of setting are set values and levels as they
    stand. Otherwise neighbours within the scatter form a level; where the values of a level hardly ever
    differ they were set, else read.

    Parameters
    ----------
    values : array
        One value for each different operating point (repeats count once).
    setting : SettingError
        Scatter of setting this variable.
    printed : array, optional
        The same in the table's unit, in which set values are round.

    Returns
    -------
    level : array
        Mean of the values that were meant to be equal.
    is_set : bool

    Examples
    --------
    >>> import numpy as np
    >>> levels(np.array([5.0, 20.0, 5.0, 20.0]), SettingError(0.05))
    (array([ 5., 20.,  5., 20.]), True)
    >>> levels(np.array([5.1, 20.4, 4.9, 19.6]), SettingError(0.05))
    (array([ 5., 20.,  5., 20.]), False)
    """
    distinct, shown = np.unique(values), np.unique(values if printed is None else printed)
    span = float(distinct[-1] - distinct[0])
    if span == 0:
        return values.copy(), True
    step = round_step(shown) * span / float(shown[-1] - shown[0])
    scatter = float(setting.at(np.median(np.abs(values))))
    if step >= scatter and distinct.size >= 0.3 * (span / step + 1):
        return values.copy(), True
    order = np.argsort(values, kind="stable")
    out = np.empty_like(values)
    kinds = []
    for part in _parts(values[order], setting):
        where = order[part]
        out[where] = np.mean(values[where])
        if where.size > 1:
            kinds.append(np.unique(values[where]).size)
    is_set = bool(kinds) and float(np.mean(kinds)) <= 1.3
    return (values.copy() if is_set else out), is_set


def round_step(distinct: Array) -> float:
    """Largest of 1, 2, 2.5, 5 times a power of ten that divides all values.

    Examples
    --------
    >>> import numpy as np
    >>> round_step(np.array([5.0, 20.0, 35.0]))
    5.0
    """
    top = float(np.max(np.abs(distinct)))
    if top == 0:
        return 1.0
    for power in range(int(np.ceil(np.log10(top))), -10, -1):
        for factor in (5.0, 2.5, 2.0, 1.0):
            step = factor * 10.0**power
            if np.allclose(distinct / step, np.round(distinct / step), rtol=0, atol=1e-6):
                return step
    return 1e-10


def _parts(ordered: Array, setting: SettingError) -> list[slice]:
    """Part sorted values at their widest gap while a part is wider than six standard deviations of the
    setting, has a gap of more than two and a half of them, or one that the values themselves show to be a step."""
    least = _break(ordered, setting)
    done, rest = [], [slice(0, ordered.size)]
    while rest:
        part = rest.pop()
        inside = ordered[part]
        gaps = np.diff(inside)
        width = float(setting.at(np.mean(np.abs(inside))))
        wide = gaps.size and (gaps.max() > min(2.5 * width, least * width))
        if gaps.size and gaps.max() > 0 and (inside[-1] - inside[0] > 6 * width or wide):
            cut = part.start + int(np.argmax(gaps)) + 1
            rest += [slice(part.start, cut), slice(cut, part.stop)]
        else:
            done.append(part)
    return done


def _break(ordered: Array, setting: SettingError) -> float:
    """Gap, in standard deviations of the setting, from which neighbours are different settings; infinite if none is.

    Settings that a brake holds better than the rig file says leave gaps of two kinds: those between readings of one
    setting and those between settings. Of k gaps below a value, uniform ones would all lie below a share q of it with
    probability q^k (that of k independent uniform variables): where that is below `CHANCE` the gaps are of two kinds.
    """
    gaps = np.diff(ordered)
    middle = 0.5 * (ordered[1:] + ordered[:-1])
    size = np.sort(gaps[gaps > 0] / np.maximum(setting.at(middle[gaps > 0]), 1e-300))
    if size.size < 3:
        return np.inf
    below = np.arange(1, size.size)
    chance = (size[:-1] / size[1:]) ** below
    # 1e-3: probability below which gaps of two sizes are no accident
    usable = (chance < 1e-3) & (size[1:] > 3 * size[:-1]) & (below >= size.size / 3)
    if not np.any(usable):
        return np.inf
    k = int(np.flatnonzero(usable)[np.argmax(size[1:][usable] / size[:-1][usable])])
    return float(np.sqrt(size[k] * size[k + 1]))


def apart_in_rounds(values: Array, level: Array, rounds: NDArray[np.intp], scatter: Array) -> Array:
    """Levels of a column that was read, parted where one round of a plan holds several rows of a level.

    A round of a plan sets each condition once. Neighbouring set values that scatter into each other look like one
    level; their order in each round distinguishes them.

    Parameters
    ----------
    values, level : array
        Of one condition, every row.
    rounds : array of int
        Rows that share all other levels and the number of the round share a number.
    scatter : array
        Standard deviation of setting, every row: rows closer than half of it are readings of one setting.

    Examples
    --------
    >>> import numpy as np
    >>> read = np.array([66.2, 75.9, 69.1, 79.8])
    >>> apart_in_rounds(read, np.full(4, 72.75), np.array([0, 0, 1, 1]), 0.05 * read).round(2)
    array([67.65, 77.85, 67.65, 77.85])
    """
    out = level.copy()
    for value in np.unique(level):
        rows = np.flatnonzero(level == value)
        order = rows[np.lexsort((values[rows], rounds[rows]))]
        _, first, counts = np.unique(rounds[order], return_index=True, return_counts=True)
        several = int(np.median(counts))
        full = counts == several
        # 0.8: of the rounds that have to hold the same number of rows of a level
        if several < 2 or np.mean(full) < 0.8:
            continue
        rank = np.arange(order.size) - np.repeat(first, counts)
        gaps = np.diff(values[order])[rank[1:] > 0] / scatter[order][1:][rank[1:] > 0]
        if np.median(gaps) < 0.5:
            continue
        whole = np.repeat(full, counts)
        centres = np.array([values[order][whole & (rank == k)].mean() for k in range(several)])
        nearest = np.argmin(np.abs(values[order][:, None] - centres), axis=1)
        out[order] = centres[np.where(whole, rank, nearest)]
    return out


def grouped(values: Array) -> Array:
    """Levels as they are where they are few, means of groups of neighbours where they are many."""
    distinct, index = np.unique(values, return_inverse=True)
    if distinct.size <= MOST_LEVELS:
        return values
    group = index * 8 // distinct.size
    return np.array([values[group == g].mean() for g in range(8)])[group]


def cells(*columns: NDArray[np.generic]) -> NDArray[np.intp]:
    """Number of the combination of levels that each row belongs to.

    Examples
    --------
    >>> import numpy as np
    >>> cells(np.array([1.0, 1.0, 2.0]), np.array([5.0, 6.0, 5.0]))
    array([0, 1, 2])
    """
    frame = pd.DataFrame(dict(enumerate(columns)))
    return np.asarray(frame.groupby([*frame], dropna=False).ngroup())


class SetPoints:
    """What each row of all tables was meant to be set to, which rows are repeats, and which share a set-up.

    Parameters
    ----------
    conditions : mapping
        What was read or set, SI, every row; names of groups by number.
    model : Model
    recording : array of int
        File of every row.
    marks : mapping
        Columns ``repeat`` and ``setup`` where all tables have them.
    units : mapping
        Units of the tables' columns where that is not the condition's `column_unit`.

    Attributes
    ----------
    levels, is_set : mapping
        What each value was meant to be, and whether a column holds set values.
    replicate_group, setup : array of int
        Rows at the same condition, and rows at the same setting of it, share a number.
    setups_from : str
        What told the set-ups: ``setup``, ``repeat`` or ``order``.
    """

    def __init__(
        self,
        conditions: Mapping[str, Array],
        model: Model,
        recording: NDArray[np.intp],
        marks: Mapping[str, Array],
        units: Mapping[str, str],
    ) -> None:
        self.conditions, self._recording, self._marks = conditions, recording, marks
        self._settings = {n: grouping_of(model, model.conditions[n]) for n in conditions}
        self.levels: dict[str, Array] = {}
        self.is_set: dict[str, bool] = {}
        self._find_levels(model, units)
        self._set = [n for n in conditions if n != TIME]
        self._moved = [n for n in self._set if not np.array_equal(conditions[n], self.levels[n])]
        # Rows are alike only where these values are equal: nobody has said how well they are set.
        assumed = [
            n for n in self._moved if not model.conditions[n].usual_setting and n not in model.rig.setting
        ]
        self._exact = [] if marks else assumed
        columns = [conditions[n] if n in self._exact else self.levels[n] for n in self._set]
        self._alike = cells(np.zeros(recording.size), *columns)
        # Repeats are looked for inside each file, where there are enough of them: what differs between files (another
        # day, another specimen) is no scatter. Files that hold one round of a plan each are repeats of each other.
        apart = cells(recording, self._alike)
        enough = apart.size - np.unique(apart).size >= ENOUGH
        self.replicate_group = apart if enough else self._alike
        self.setup, self.setups_from = self._set_ups()

    def _find_levels(self, model: Model, units: Mapping[str, str]) -> None:
        distinct: Any = (
            np.unique(np.stack([*self.conditions.values()], axis=1), axis=0) if self.conditions else []
        )
        for k, (name, values) in enumerate(self.conditions.items()):
            condition = model.conditions[name]
            if condition.group:
                self.levels[name], self.is_set[name] = values, True
                continue
            shown = np.asarray(
                convert(distinct[:, k], condition.unit, units.get(name, condition.column_unit))
            )
            points, self.is_set[name] = levels(distinct[:, k], self._settings[name], shown)
            back = dict(zip(distinct[:, k].tolist(), points.tolist(), strict=True))
            self.levels[name] = np.array([back[x] for x in values.tolist()])
        if "repeat" not in self._marks or "setup" in self._marks:
            return
        rounds = cells(self._recording, self._marks["repeat"])
        for name, values in self.conditions.items():
            if name != TIME and not self.is_set[name]:
                others = [c for other, c in self.levels.items() if other not in (name, TIME)]
                scatter = np.asarray(self._settings[name].at(values), dtype=float) + 1e-300
                self.levels[name] = apart_in_rounds(
                    values, self.levels[name], cells(rounds, *others), scatter
                )

    def _set_ups(self) -> tuple[NDArray[np.intp], str]:
        if "setup" in self._marks:
            return cells(self._recording, self.replicate_group, self._marks["setup"]), "setup"
        if "repeat" in self._marks:
            # One round sets a condition once: rows of it at other values are other settings, not second readings.
            marked = cells(self._recording, self.replicate_group, self._marks["repeat"])
            order = np.argsort(marked, kind="stable")
            number = np.empty(order.size, dtype=np.intp)
            number[order] = np.cumsum((np.diff(marked[order], prepend=-1) != 0) | self._set_anew(order))
            return number, "repeat"
        # Without a mark: the next row at the same condition, at values that were not set anew, is a second
        # reading; a condition that comes back later was set again.
        changed = np.diff(cells(self._recording, self.replicate_group), prepend=-1) != 0
        return np.cumsum(changed | self._set_anew(np.arange(changed.size))), "order"

    def _set_anew(self, order: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Whether a row lies further from the one before it, in an order, than readings of one setting do.

        Half the scatter of setting where the one row follows the other in the table, a tenth where other rows lie
        between.
        """
        changed = np.zeros(order.size, dtype=bool)
        share = np.where(np.diff(order, prepend=-1) == 1, 0.5, 0.1)
        for name in self._set:
            ordered = self.conditions[name][order]
            apart = np.abs(np.diff(ordered, prepend=ordered[0]))
            changed |= apart > share * self._settings[name].at(ordered) + 1e-12
        return changed

    def said(self, place: Callable[[NDArray[np.intp]], str]) -> list[str]:
        """Which rows that are near each other are taken for repeats, or are not, and why; `place` names rows."""
        near = cells(np.zeros(self._recording.size), *(self.levels[n] for n in self._set))
        groups = [np.flatnonzero(near == k) for k in np.unique(near)]
        taken = [
            g
            for g in groups
            if np.unique(self._alike[g]).size < g.size
            and any(np.ptp(self.conditions[n][g]) > 0 for n in self._moved)
        ]
        left = [g for g in groups if np.unique(self._alike[g]).size > 1]

        def some(found: list[NDArray[np.intp]]) -> str:
            more = f", and {counted(len(found) - 3, 'more group')}" if len(found) > 3 else ""
            return "; ".join(place(g[:4]) for g in found[:3]) + more

        if left:
            return [
                f"{some(left)}: near each other in {' and '.join(self._exact)}, and not treated as repeats: how well "
                f"it is set is not stated (declare {self._exact[0]}_setting_percent, or give a column 'repeat')"
            ]
        if taken and not self._marks:
            return [
                f"{some(taken)}: treated as repeats: they differ in {' and '.join(self._moved)} by no more than "
                "the scatter of setting"
            ]
        return []
