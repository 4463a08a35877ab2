"""Sine recordings of one set-up, joined to a transfer function with one line a recording."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from specan.data.frequency_response import FrequencyResponse
from specan.data.tone import ToneTable
from specan.dsp.transfer_function import u_phase_deg
from specan.errors import InputError

_SAME_FREQUENCY = 1e-4  # relative: repeats of one step
# A distorted drive is not a step of a transfer function: the reference of a loudspeaker at work has a few percent.
_DISTORTED_PERCENT = 10.0
# The mains and twice its frequency, within the 1 % of EN 50160; hum stands 10 dB and more below what drives.
_MAINS_HZ, _MAINS_WITHIN, _MAINS_BELOW = (50.0, 60.0, 100.0, 120.0), 0.01, 0.316


def not_steps(tables: Sequence[ToneTable]) -> dict[str, str]:
    """Recordings that were taken for a sine by their signal alone, and that are no step of their directory.

    Parameters
    ----------
    tables : sequence of ToneTable
        The sine recordings of one directory.

    Returns
    -------
    dict
        Label to the reason: a distorted tone (a square wave), hum. What is stated to be a sine is never among them.
    """
    found = {}
    for table in tables:
        if table.stated:
            continue
        driving = table.reference if table.reference in table.channels else table.leader
        thd = float(table.thd_percent[table.channels.index(driving)]) if driving in table.channels else 0.0
        others = [t.reference_rms for t in tables if t is not table and np.isfinite(t.reference_rms)]
        generated = any(
            role == "generator" and table.tone_rms[row] > table.noise_rms[row]
            for row, role in enumerate(table.roles)
        )
        at_mains = any(abs(table.frequency_hz - f) <= _MAINS_WITHIN * f for f in _MAINS_HZ)
        if thd > _DISTORTED_PERCENT:
            found[table.label] = f"{driving} is distorted by {thd:.0f} %, more than {_DISTORTED_PERCENT:g} %"
        elif (
            at_mains
            and not generated
            and others
            and table.reference_rms < _MAINS_BELOW * float(np.median(others))
        ):
            found[table.label] = f"a weak tone at {table.frequency_hz:.4g} Hz may be hum of the mains"
    return found


def _over_one_reference(tables: Sequence[ToneTable], label: str) -> list[ToneTable]:
    """Tables with phases; all over the same reference."""
    usable = [t for t in tables if t.reference is not None and np.isfinite(t.phase_deg).any()]
    if not usable:
        raise InputError(f"{label or 'the sine recordings'}: none has phases over a reference")
    references = sorted({str(t.reference) for t in usable})
    if len(references) > 1:
        raise InputError(
            f"{label or 'the sine recordings'} are over different references: {', '.join(references)}",
            expected="one reference",
        )
    return usable


def join_stepped_sine(tables: Sequence[ToneTable], label: str = "") -> FrequencyResponse:
    """Join the tone tables of several recordings to one frequency response.

    Lines are sorted by frequency. Recordings of the same frequency (to 1e-4) are averaged as complex numbers;
    their uncertainty is that of the mean, from their own uncertainties or from their scatter,
    whichever is larger. A channel that a recording does not have is NaN there.

    Parameters
    ----------
    tables : sequence of ToneTable
        All over the same reference. Tables without a usable reference are left out, with a note.
    label : str
        Of the result, usually the directory.

    Raises
    ------
    InputError
        No table has a reference, or the references or units differ.
    """
    usable = _over_one_reference(tables, label)
    units = _units(usable)
    steps = _steps(usable)
    shape = (len(units), len(steps))
    response = np.full(shape, np.nan + 0j)
    random, gain, phase = np.full(shape, np.nan), np.full(shape, np.nan), np.full(shape, np.nan)
    freedom = np.zeros(shape)
    flags: dict[str, set[str]] = {name: set() for name in units}
    for column, step in enumerate(steps):
        for row, name in enumerate(units):
            found = [(t, t.channels.index(name)) for t in step if name in t.channels]
            if not found:
                continue
            values = np.array([t.magnitude[i] * np.exp(1j * np.radians(t.phase_deg[i])) for t, i in found])
            response[row, column] = np.mean(values)
            random[row, column] = _random(values, np.array([t.u_random_percent[i] for t, i in found]))
            freedom[row, column] = sum(t.degrees_of_freedom for t, _ in found)
            gain[row, column] = np.mean([t.u_common_percent[i] for t, i in found])
            phase[row, column] = np.mean([t.u_common_phase_deg[i] for t, i in found])
            for table, i in found:
                flags[name].update(table.flags[i])
    left_out = [t.label for t in tables if t not in usable]
    return FrequencyResponse(
        label=label,
        frequency_hz=np.array([np.mean([t.frequency_hz for t in step]) for step in steps]),
        channels=tuple(units),
        units=tuple(units.values()),
        reference=str(usable[0].reference),
        response=response,
        coherence=np.full(shape, np.nan),
        u_magnitude_percent=random,
        u_phase_deg=u_phase_deg(random / 100),
        u_leakage_percent=np.zeros(shape),
        degrees_of_freedom=freedom,
        u_common_percent=gain,
        u_common_phase_deg=phase,
        estimator="stepped sine",
        n_blocks=min(t.n_blocks for t in usable),
        n_effective=float(min(t.n_blocks for t in usable)),
        line_correlation=0.0,
        delay_s=np.zeros(len(units)),
        reference_rms=float(np.sqrt(np.mean([t.reference_rms**2 for t in usable]))),
        reference_unit=usable[0].units[usable[0].channels.index(str(usable[0].reference))],
        flags=tuple(tuple(sorted(flags[name])) for name in units),
        notes=tuple(f"{name} is left out: it has no phases over a reference" for name in left_out),
        settings=usable[0].settings,
    )


def _units(tables: Sequence[ToneTable]) -> dict[str, str]:
    """Of every response over the reference, the same in all recordings."""
    units: dict[str, str] = {}
    for table in tables:
        for name, unit in zip(table.channels, table.magnitude_units):
            if name != table.reference and units.setdefault(name, unit) != unit:
                raise InputError(f"{table.label}: {name} is in {unit}, in other recordings in {units[name]}")
    return units


def _steps(tables: Sequence[ToneTable]) -> list[list[ToneTable]]:
    """Tables by frequency; those that repeat one are together."""
    steps: list[list[ToneTable]] = []
    for table in sorted(tables, key=lambda t: (t.frequency_hz, t.label)):
        if steps and table.frequency_hz - steps[-1][0].frequency_hz <= _SAME_FREQUENCY * table.frequency_hz:
            steps[-1].append(table)
        else:
            steps.append([table])
    return steps


def _random(values: np.ndarray, u_percent: np.ndarray) -> float:
    """Relative standard uncertainty of a mean of complex values, per real component, in percent."""
    stated = float(np.sqrt(np.mean(u_percent**2) / len(values)))
    if len(values) == 1:
        return stated
    scatter = np.sum(np.abs(values - np.mean(values)) ** 2) / (2 * (len(values) - 1) * len(values))
    return max(stated, float(100 * np.sqrt(scatter) / np.abs(np.mean(values))))
