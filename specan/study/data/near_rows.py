"""Rows that are near each other: whether they are repeats, and what is said about it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from specan.models import Model, SettingError
from specan.study.data.setpoints import apart_in_rounds, cells
from specan.study.data.table_reader import Measurement
from specan.study.observation import Array

TIME = "elapsed_time"  # orders the readings; never a setting


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
