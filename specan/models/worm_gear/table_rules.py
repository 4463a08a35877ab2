"""What a table of a gear's losses must obey: two of three columns give the third, and power is conserved."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np
from numpy.typing import NDArray

from specan.models.measurement_kinds import Completed, TableFault, TableRules

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

IDLE = 0.05  # share of the largest output torque that the brake may read without load

IN, OUT, ETA = "input_torque_Nm", "output_torque_Nm", "efficiency"
SPEED, TEMPERATURE = "speed_rpm", "oil_temperature_C"


def table_rules(ratio: float) -> TableRules:
    """Rules for the tables of a gear.

    Parameters
    ----------
    ratio : float
        Speed of the input shaft over that of the output shaft.
    """
    return TableRules(partial(complete, ratio=ratio), {OUT: frozenset({IN, ETA})})


def complete(columns: Columns, steps: Mapping[str, float], ratio: float) -> Completed:
    """Input torque, output torque and efficiency of every row, as far as two of them give the third.

    Columns that follow from the others are checked against them and used once: where the input torque
    is given, the efficiency says nothing more.

    Parameters
    ----------
    columns : mapping
        ``{header: array (rows,)}`` of the table.
    steps : mapping
        ``{header: step in which it is printed}``.
    ratio : float
        Speed of the input shaft over that of the output shaft.

    Raises
    ------
    TableFault
        Fewer than two of the three, efficiency in percent or above one, columns that contradict each
        other, speeds or temperatures that cannot be.
    """
    size = next(iter(columns.values())).size
    empty = np.full(size, np.nan)
    torque_in, torque_out, eta = (columns.get(name, empty).copy() for name in (IN, OUT, ETA))
    printed = {name: np.full(size, steps.get(name, 0.0)) for name in (IN, OUT, ETA)}
    _check_efficiency(eta)
    _check_operation(columns)
    notes = []
    known = np.isfinite(np.stack([torque_in, torque_out, eta])).sum(axis=0)
    if np.any(known < 2):
        raise TableFault(
            f"fewer than two of {IN}, {OUT} and {ETA}",
            rows=known < 2,
            expected="any two of them in every row",
        )
    derived = np.isnan(torque_out)
    if np.any(derived):
        torque_out[derived] = ratio * (eta * torque_in)[derived]
        printed[OUT][derived] = (ratio * torque_in * printed[ETA])[derived]
        notes.append(f"{OUT} is worked out from {ETA} and {IN} in {derived.sum()} rows")
    idle = np.isnan(torque_in) & ~(torque_out > 0)
    if np.any(idle):
        raise TableFault(
            "without load there is no efficiency to speak of",
            rows=idle,
            expected=f"{IN} where the output torque is zero",
        )
    _check_torques(torque_in, torque_out, ratio)
    both = np.isfinite(torque_in) & np.isfinite(eta) & ~derived
    _check_agreement(torque_in, torque_out, eta, ratio, printed, both)
    if np.any(both):
        notes.append(f"{ETA} follows from the torques in {both.sum()} rows (checked) and is used once")
    with np.errstate(invalid="ignore"):
        eta = np.where(eta > 0, eta, np.nan)  # an efficiency of zero measures nothing
    return Completed({IN: torque_in, OUT: torque_out, ETA: eta}, printed, tuple(notes))


def _check_efficiency(eta: Array) -> None:
    given = eta[np.isfinite(eta)]
    if given.size and np.median(given) > 1.5 and np.all(given <= 100):
        raise TableFault(
            f"the column {ETA!r} goes up to {given.max():g}, it seems to be in percent",
            expected="a fraction between 0 and 1",
            remedy="divide it by 100",
        )
    with np.errstate(invalid="ignore"):
        bad = (eta > 1) | (eta < 0)
    if np.any(bad):
        raise TableFault(
            f"efficiency {eta[bad][0]:g}",
            rows=bad,
            expected="a value between 0 and 1",
        )


def _check_operation(columns: Columns) -> None:
    speed = columns.get(SPEED)
    if speed is not None:
        bad = ~(speed > 0)
        if np.any(bad):
            raise TableFault(
                f"the speed is {speed[bad][0]:g} rpm",
                rows=bad,
                expected="a speed above zero; a standing gear has no efficiency",
                remedy="leave such rows out",
            )
    temperature = columns.get(TEMPERATURE)
    if temperature is not None and np.nanmedian(temperature) > 220:
        raise TableFault(
            f"the column {TEMPERATURE!r} goes up to {np.nanmax(temperature):g}, it seems to be in kelvin",
            expected="degrees Celsius",
        )


def _check_torques(torque_in: Array, torque_out: Array, ratio: float) -> None:
    with np.errstate(invalid="ignore"):
        bad = torque_in <= 0
        negative = torque_out < -_idle_reading(torque_out)
        impossible = torque_out > 1.02 * ratio * torque_in
    if np.any(bad):
        raise TableFault(
            f"the input torque is {torque_in[bad][0]:g} Nm",
            rows=bad,
            expected="a driving torque above zero",
        )
    if np.any(negative):
        raise TableFault(
            f"the output torque is {torque_out[negative][0]:g} Nm",
            rows=negative,
            expected="the torque of the brake counted positive",
        )
    if np.any(impossible):
        exchanged = np.mean(impossible) > 0.5
        hint = "are the two torque columns exchanged, or in other units?" if exchanged else "correct the row"
        k = int(np.argmax(impossible))
        raise TableFault(
            f"{torque_out[k]:g} Nm come out for {torque_in[k]:g} Nm at "
            f"a ratio of {ratio:g}, an efficiency of {torque_out[k] / ratio / torque_in[k]:.2f}",
            rows=impossible,
            expected="an efficiency of at most 1",
            remedy=hint,
        )


def _idle_reading(torque_out: Array) -> float:
    """Largest output torque, of either sign, that may be read without load."""
    return IDLE * float(np.nanmax(np.abs(torque_out))) + 1e-12


def _check_agreement(
    torque_in: Array,
    torque_out: Array,
    eta: Array,
    ratio: float,
    steps: Columns,
    rows: NDArray[np.bool_],
) -> None:
    with np.errstate(invalid="ignore", divide="ignore"):
        expected = torque_out / (ratio * torque_in)
        rounding = steps[OUT] / (ratio * torque_in) + np.abs(expected) * steps[IN] / torque_in + steps[ETA]
        # The torque of an idle brake reads a little off zero, to either side; the efficiency is written as zero then.
        idle = (eta == 0) & (np.abs(torque_out) <= _idle_reading(torque_out))
        bad = rows & ~idle & (np.abs(eta - expected) > 0.01 * np.abs(expected) + rounding)
    if np.any(bad):
        k = int(np.argmax(bad))
        raise TableFault(
            f"the columns contradict each other (efficiency {eta[k]:g}, but the "
            f"torques give {expected[k]:.3f} at a ratio of {ratio:g})",
            rows=bad,
            expected="columns that agree",
            remedy="correct the rows, or the teeth in the rig file, or leave one of the columns out",
        )
