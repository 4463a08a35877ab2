"""Rows of a table compared with the rig file and against each other, before anything is fitted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from specan.errors import InputError
from specan.models import Condition, Model, SettingError
from specan.study.observation import Array
from specan.units import convert, often_mistaken_for

THOUSAND = 1000.0  # a point that parts thousands, read as a decimal point
SCATTER = 3.0  # standard deviations of setting by which a limit may be passed
OF_RANGE = 0.05  # and the share of the limits' range
IDLE = 0.05  # share of the upper limit below which a condition that `idles` does so
MOST_NAMED = 5  # lines in one message


def check_limits(
    conditions: Mapping[str, Array],
    places: Sequence[str],
    model: Model,
    settings: Mapping[str, SettingError],
) -> list[str]:
    """Refuse values that the bench cannot run; a likely unit is named.

    What lies outside by less than the whole range, and in no other unit inside, is only remarked on: a bench may run a
    little further than its file says.

    Parameters
    ----------
    conditions : mapping
        SI values by the model's names.
    places : sequence of str
        File and line of every row.
    model : Model
        Its rig holds the ``[limits]``.
    settings : mapping
        Scatter of setting each condition.

    Returns
    -------
    list of str
        Remarks.

    Raises
    ------
    InputError
        Values far outside the limits, or in another unit.
    """
    remarks = []
    for name, (low, high) in model.rig.limits.items():
        if name not in conditions:
            continue
        values, condition = conditions[name], model.conditions[name]
        bad = _outside(values, low, high, condition, settings.get(name, SettingError()))
        if not np.any(bad):
            continue
        shown = _shown(values[bad], condition)
        ends = _shown(np.array([low, high]), condition)
        unit = _likely_unit(values, low, high, condition, settings.get(name, SettingError()))
        span = f"{shown.min():.4g} to {shown.max():.4g}" if np.ptp(shown) > 0 else f"{shown[0]:.4g}"
        said = f"{_named(places, bad)}: {condition.column} is {span} {condition.column_unit}"
        if not unit and values.min() > low - (high - low) and values.max() < high + (high - low):
            remarks.append(f"{said}, outside the [limits] of the rig file ({ends[0]:.4g} to {ends[1]:.4g})")
            continue
        raise InputError(
            said,
            expected=f"{ends[0]:.4g} to {ends[1]:.4g}, the [limits] of the rig file",
            remedy=f"{unit}; convert the column"
            if unit
            else "correct the rows, or the limits in the rig file",
        )
    return remarks


def duplicates(columns: Sequence[Array], places: Sequence[str]) -> str:
    """A sentence on rows that equal another one in every number; empty where there are none.

    Readings that are printed coarsely agree by chance now and then: only where a reading has four digits or more, or a
    tenth of all rows equal another, is that worth a word.
    """
    table = np.stack(list(columns), axis=1)
    _, first, index = np.unique(table, axis=0, return_index=True, return_inverse=True)
    again = np.flatnonzero(first[np.ravel(index)] != np.arange(table.shape[0]))
    if not again.size or again.size < 0.1 * table.shape[0]:
        return ""
    row = int(again[0])
    more = f" (and {again.size - 1} more rows like that)" if again.size > 1 else ""
    return (
        f"{places[row]} equals {places[int(first[np.ravel(index)[row]])]} to the last digit{more}: a copied row is no "
        "repeat, and makes the scatter look smaller than it is"
    )


def _outside(
    values: Array, low: float, high: float, condition: Condition, setting: SettingError
) -> NDArray[np.bool_]:
    reach = SCATTER * np.asarray(setting.at(values)) + OF_RANGE * (high - low)
    bad = (values < low - reach) | (values > high + reach)
    if condition.idles:
        bad &= ~(np.abs(values) <= IDLE * high)
    return np.asarray(bad)


def _likely_unit(values: Array, low: float, high: float, condition: Condition, setting: SettingError) -> str:
    """``rev/s?``: a unit in which all values lie within the limits; empty where none does."""
    shown = _shown(values, condition)
    for unit in often_mistaken_for(condition.column_unit):
        meant = np.asarray(convert(_in(shown, unit), "rad/s" if unit == "Hz" else unit, condition.unit))
        if not np.any(_outside(meant, low, high, condition, setting)):
            return f"they are likely in {'rev/s' if unit == 'Hz' else unit}"
    meant = np.asarray(convert(THOUSAND * shown, condition.column_unit, condition.unit))
    if not np.any(_outside(meant, low, high, condition, setting)):
        return "a point that parts thousands was likely read as a decimal point (1.200 for 1200)"
    return ""


def _in(shown: Array, unit: str) -> Array:
    """Revolutions a second as radians a second, which every unit system knows."""
    return 2 * np.pi * shown if unit == "Hz" else shown


def _shown(values: Array, condition: Condition) -> Array:
    return np.asarray(convert(values, condition.unit, condition.column_unit), dtype=float)


def _named(places: Sequence[str], rows: NDArray[np.bool_]) -> str:
    found = [places[int(k)] for k in np.flatnonzero(rows)]
    more = f" and {len(found) - MOST_NAMED} more rows" if len(found) > MOST_NAMED else ""
    first = found[0]
    lines = [place.rpartition("line ")[2] for place in found[1:MOST_NAMED]]
    return first + "".join(f", {line}" for line in lines) + more
