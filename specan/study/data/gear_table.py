"""What a table of a gear's losses must obey: two of three columns give the third, and power is conserved."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from specan.errors import InputError
from specan.study.data.table_file import TableFile
from specan.study.observation import Array

IN, OUT, ETA = "input_torque_Nm", "output_torque_Nm", "efficiency"
SPEED, TEMPERATURE = "speed_rpm", "oil_temperature_C"


def complete(table: TableFile, ratio: float) -> tuple[dict[str, Array], dict[str, Array], list[str]]:
    """Input torque, output torque and efficiency of every row, as far as two of them give the third.

    Columns that follow from the others are checked against them and used once: where the input torque
    is given, the efficiency says nothing more.

    Parameters
    ----------
    table : TableFile
    ratio : float
        Speed of the input shaft over that of the output shaft.

    Returns
    -------
    columns, steps : dict
        The three columns, nan where unknown, and the step in which each row's value was printed.
    notes : list of str
        What was assumed.

    Raises
    ------
    InputError
        Fewer than two of the three, efficiency in percent or above one, columns that contradict each
        other, speeds or temperatures that cannot be.
    """
    size = table.lines.size
    empty = np.full(size, np.nan)
    torque_in, torque_out, eta = (table.columns.get(name, empty).copy() for name in (IN, OUT, ETA))
    steps = {name: np.full(size, table.steps.get(name, 0.0)) for name in (IN, OUT, ETA)}
    _check_efficiency(table, eta)
    _check_operation(table)
    notes = []
    known = np.isfinite(np.stack([torque_in, torque_out, eta])).sum(axis=0)
    if np.any(known < 2):
        raise InputError(
            f"{table.path}, {table.rows(known < 2)}: fewer than two of {IN}, {OUT} and {ETA}",
            expected="any two of them in every row",
        )
    derived = np.isnan(torque_out)
    if np.any(derived):
        torque_out[derived] = ratio * (eta * torque_in)[derived]
        steps[OUT][derived] = (ratio * torque_in * steps[ETA])[derived]
        notes.append(f"{OUT} is worked out from {ETA} and {IN} in {derived.sum()} rows")
    idle = np.isnan(torque_in) & ~(torque_out > 0)
    if np.any(idle):
        raise InputError(
            f"{table.path}, {table.rows(idle)}: without load there is no efficiency to speak of",
            expected=f"{IN} where the output torque is zero",
        )
    _check_torques(table, torque_in, torque_out, ratio)
    both = np.isfinite(torque_in) & np.isfinite(eta) & ~derived
    _check_agreement(table, torque_in, torque_out, eta, ratio, steps, both)
    if np.any(both):
        notes.append(f"{ETA} follows from the torques in {both.sum()} rows (checked) and is used once")
    return {IN: torque_in, OUT: torque_out, ETA: eta}, steps, notes


def _check_efficiency(table: TableFile, eta: Array) -> None:
    given = eta[np.isfinite(eta)]
    if given.size and np.median(given) > 1.5 and np.all(given <= 100):
        raise InputError(
            f"{table.path}: the column {ETA!r} goes up to {given.max():g}, it seems to be in percent",
            expected="a fraction between 0 and 1",
            remedy="divide it by 100",
        )
    with np.errstate(invalid="ignore"):
        bad = (eta > 1) | (eta < 0)
    if np.any(bad):
        raise InputError(
            f"{table.path}, {table.rows(bad)}: efficiency {eta[bad][0]:g}",
            expected="a value between 0 and 1",
        )


def _check_operation(table: TableFile) -> None:
    speed = table.columns.get(SPEED)
    if speed is not None:
        bad = ~(speed > 0)
        if np.any(bad):
            raise InputError(
                f"{table.path}, {table.rows(bad)}: the speed is {speed[bad][0]:g} rpm",
                expected="a speed above zero; a standing gear has no efficiency",
                remedy="leave such rows out",
            )
    temperature = table.columns.get(TEMPERATURE)
    if temperature is not None and np.nanmedian(temperature) > 220:
        raise InputError(
            f"{table.path}: the column {TEMPERATURE!r} goes up to {np.nanmax(temperature):g}, "
            "it seems to be in kelvin",
            expected="degrees Celsius",
        )


def _check_torques(table: TableFile, torque_in: Array, torque_out: Array, ratio: float) -> None:
    with np.errstate(invalid="ignore"):
        bad = torque_in <= 0
        negative = torque_out < -0.05 * np.nanmax(np.abs(torque_out)) - 1e-12
        impossible = torque_out > 1.02 * ratio * torque_in
    if np.any(bad):
        raise InputError(
            f"{table.path}, {table.rows(bad)}: the input torque is {torque_in[bad][0]:g} Nm",
            expected="a driving torque above zero",
        )
    if np.any(negative):
        raise InputError(
            f"{table.path}, {table.rows(negative)}: the output torque is {torque_out[negative][0]:g} Nm",
            expected="the torque of the brake counted positive",
        )
    if np.any(impossible):
        exchanged = np.mean(impossible) > 0.5
        hint = "are the two torque columns exchanged, or in other units?" if exchanged else "correct the row"
        k = int(np.argmax(impossible))
        raise InputError(
            f"{table.path}, {table.rows(impossible)}: {torque_out[k]:g} Nm come out for {torque_in[k]:g} Nm at "
            f"a ratio of {ratio:g}, an efficiency of {torque_out[k] / ratio / torque_in[k]:.2f}",
            expected="an efficiency of at most 1",
            remedy=hint,
        )


def _check_agreement(
    table: TableFile,
    torque_in: Array,
    torque_out: Array,
    eta: Array,
    ratio: float,
    steps: dict[str, Array],
    rows: NDArray[np.bool_],
) -> None:
    with np.errstate(invalid="ignore", divide="ignore"):
        expected = torque_out / (ratio * torque_in)
        rounding = expected * (steps[OUT] / np.abs(torque_out) + steps[IN] / torque_in) + steps[ETA]
        bad = rows & (np.abs(eta - expected) > 0.01 * np.abs(expected) + rounding)
    if np.any(bad):
        k = int(np.argmax(bad))
        raise InputError(
            f"{table.path}, {table.rows(bad)}: the columns contradict each other (efficiency {eta[k]:g}, but the "
            f"torques give {expected[k]:.3f} at a ratio of {ratio:g})",
            expected="columns that agree",
            remedy="correct the rows, or the teeth in the rig file, or leave one of the columns out",
        )
