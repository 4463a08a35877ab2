"""The result tables of a batch: lines of each file, and the tables put together from them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from specan import __version__
from specan.analysis.accumulator import feed
from specan.analysis.batch.result import FileResult
from specan.analysis.batch.settings import BatchSettings
from specan.analysis.batch.store import Kept
from specan.analysis.orders import Orders
from specan.analysis.quality import QualityAccumulator
from specan.analysis.tone import join_stepped_sine, not_steps
from specan.data.band_levels import BandLevels
from specan.data.channel import Channel
from specan.data.frequency_response import FrequencyResponse
from specan.data.levels import rms_level
from specan.data.orders import OrderSpectrum
from specan.data.recording import Recording
from specan.data.tone import ToneTable
from specan.errors import InputError, SpecanError, reason_of
from specan.io import results_text as text
from specan.units import LEVEL_REFERENCES

MEAN = "energy-mean"
JOINED = "stepped-sine"


def tone_lines(table: ToneTable) -> str:
    """One line a channel, and the energy mean of the microphones if there are several."""
    others = np.array([name != table.reference for name in table.channels])
    columns, phases = table.columns(), ("phase_deg", "u_phase_deg", "magnitude_re_reference")
    columns |= {name: list(map(text.word, columns[name])) for name in ("channel", "unit")}
    columns |= {name: np.where(others, columns[name], np.nan) for name in phases}
    columns |= {"u_phase_deg": text.significant(columns["u_phase_deg"], 2), "flags": table.flags}
    return _lines(table, **columns) + _energy_mean(table)


def _energy_mean(table: ToneTable) -> str:
    """Root of the mean square over the microphones that have a signal."""
    rows = [
        i
        for i, (role, unit) in enumerate(zip(table.roles, table.units, strict=True))
        if role == "microphone" and unit == "Pa" and np.isfinite(table.rms[i]) and table.rms[i] > 0
    ]
    if len(rows) < 2:
        return ""
    rms, tone = (float(np.sqrt(np.mean(values[rows] ** 2))) for values in (table.rms, table.tone_rms))
    return _lines(
        table,
        channel=MEAN,
        role="microphone",
        unit="Pa",
        rms=rms,
        level_dB=rms_level([rms], ["Pa"]),
        tone_rms=tone,
        magnitude_re_reference=tone / table.reference_rms if table.reference_rms > 0 else np.nan,
        flags=[tuple(dict.fromkeys(word for i in rows for word in table.flags[i]))],
    )


def _lines(table: ToneTable, **columns: Any) -> str:
    common = {"frequency_hz": table.frequency_hz, "reference": table.reference or ""}
    return _blocks("sine.txt", table.label, [{**common, "reference_rms": table.reference_rms, **columns}])


def _blocks(name: str, label: str, blocks: Iterable[Mapping[str, Any]]) -> str:
    """Lines of a table from the columns of each block."""
    return "".join(text.table_lines({"file": label, **block}, text.COLUMNS[name]) for block in blocks)


def joined_lines(response: FrequencyResponse, tables: Sequence[ToneTable]) -> str:
    """The stepped-sine characteristic of a directory: channel by channel, frequency rising."""
    about = {row[0]: row[1:] for t in tables for row in zip(t.channels, t.roles, t.units, strict=True)}
    u_phase = response.u_total_phase_deg
    blocks = []
    for row, name in enumerate(response.channels):
        known = np.flatnonzero(np.isfinite(response.response[row]))
        block = {
            "channel": name,
            "role": about[name][0],
            "unit": about[name][1],
            "frequency_hz": response.frequency_hz[known],
            "phase_deg": response.phase_deg[row, known],
            "u_phase_deg": text.significant(u_phase[row, known], 2),
            "magnitude_re_reference": response.magnitude[row, known],
            "reference": response.reference,
            "flags": " ".join((JOINED, *response.flags[row])),
        }
        blocks.append(block)
    return _blocks("sine.txt", response.label, blocks)


def noise_lines(response: FrequencyResponse, quality: Sequence[Sequence[str]]) -> str:
    """Lines of all channels; `quality` holds the words that the samples of each gave rise to."""
    words = tuple(tuple(dict.fromkeys((*q, *own))) for q, own in zip(quality, response.flags, strict=True))
    totals = zip(response.u_total_percent, response.u_total_phase_deg, strict=True)
    blocks = (
        {
            **table,
            "coherence": text.fixed(table["coherence"], 5),
            "u_magnitude_percent": u_percent,
            "u_phase_deg": u_phase,
        }
        for table, (u_percent, u_phase) in zip(replace(response, flags=words).tables(), totals, strict=True)
    )
    return _blocks("noise.txt", response.label, blocks)


def band_lines(levels: BandLevels) -> str:
    """Lines of all channels: each channel's bands, then its overall levels."""
    return _blocks("bands.txt", levels.label, levels.tables())


def other_lines(levels: BandLevels, roles: Sequence[str]) -> str:
    """The same with role and unit, for recordings that are neither a sine nor noise; RMS only of all frequencies."""
    blocks = []
    for row, (table, role) in enumerate(zip(levels.tables(), roles, strict=True)):
        zero = levels.references[row].value
        bands = zip(table["band_hz"], table["level_dB"], strict=True)
        rms = [zero * 10 ** (level / 20) if name == "total-Z" else np.nan for name, level in bands]
        blocks.append({**table, "role": role, "unit": levels.units[row], "rms": rms})
    return _blocks("other.txt", levels.label, blocks)


def rms_lines(label: str, channels: Sequence[Channel], rms: ArrayLike, flags: Sequence[Sequence[str]]) -> str:
    """Lines of `other.txt` for channels without band levels: one total a channel."""
    columns = {
        "channel": [text.word(c.label) for c in channels],
        "role": [c.role for c in channels],
        "unit": [text.word(c.unit) for c in channels],
        "band_hz": "total-Z",
        "rms": rms,
        "level_dB": rms_level(rms, [c.unit for c in channels]),
        "flags": flags,
    }
    return _blocks("other.txt", label, [columns])


TABLE = "orders.txt"
# Up to the highest order by default, every order is seen at every speed: one column says it all.
_NO_MAP = Orders(columns=1)


def with_orders(found: FileResult, recording: Recording, settings: BatchSettings) -> FileResult:
    """The result with the orders of a recording that has a tacho, or for which the settings ask.

    Where there are none, `skipped.txt` says why. The samples are read once more: equal angles need the whole
    tacho first.
    """
    if found.kind != "done" or (settings.orders is None and not recording.by_role("tacho")):
        return found
    try:
        orders, words = _analyse(recording, settings.orders or _NO_MAP)
    except SpecanError as fault:
        reason = f"no orders: {str(fault).removeprefix(f'{recording.label}: ')}"
        return replace(found, blocks={**found.blocks, TABLE: ""}, set_aside=(*found.set_aside, ("", reason)))
    low, mean, high = orders.tacho.speed_hz
    source = f"by {orders.tacho.channel}" if orders.tacho.channel else "as stated"
    about = f"orders of a shaft at {mean:.6g} Hz ({low:.6g} to {high:.6g}) {source}, {orders.turns} turns"
    return replace(
        found,
        blocks={**found.blocks, TABLE: order_lines(orders, words)},
        about=(*found.about, about, *orders.notes),
    )


def _analyse(recording: Recording, settings: Orders) -> tuple[OrderSpectrum, Sequence[tuple[str, ...]]]:
    from specan.analysis.orders import OrderAccumulator

    accumulator = OrderAccumulator(recording, settings)
    look = QualityAccumulator(accumulator.channels, accumulator.start, accumulator.stop)
    if settings.envelope_hz is None:
        feed(recording, [accumulator, look])
    else:
        feed(recording, [look])
        for samples in accumulator.pieces():
            accumulator.add(samples)
    return accumulator.result(), [quality.flags for quality in look.result()]


def order_lines(orders: OrderSpectrum, flags: Sequence[Sequence[str]]) -> str:
    """The orders that were asked for, with phase and uncertainty; without any, the lines of the spectrum."""
    blocks = []
    for table, unit, words in zip(orders.tables(), orders.units, flags, strict=True):
        if orders.lines is None:
            table |= {name: table[name][1:] for name in ("order", "amplitude")}
        level = rms_level([table["amplitude"] / np.sqrt(2)], [unit])[0]
        blocks.append({**table, "unit": unit, "level_dB": level, "flags": " ".join(words)})
    return _blocks(TABLE, orders.label, blocks)


# Stands in the place of a file's name: all sine recordings of a directory joined.
ALL = "*"

UNITS = {
    "sine.txt": "rms, tone_rms: unit; level_dB: 20 log10(rms / reference of the unit); phase_deg: channel minus "
    "reference at the tone, positive when the channel leads; u_phase_deg: standard uncertainty; "
    "magnitude_re_reference: tone_rms over reference_rms",
    "noise.txt": "magnitude: channel over reference; phase_deg: channel minus reference, positive when the channel "
    "leads; u_magnitude_percent, u_phase_deg: standard uncertainties of noise, leakage, calibration and delay together",
    "bands.txt": "band_hz: nominal mid-band frequency, or total with its weighting; level_dB re the reference of "
    "the unit; u_dB: standard uncertainty",
    "other.txt": "rms: unit; level_dB re the reference of the unit; u_dB: standard uncertainty",
    "orders.txt": "order: cycles per turn of the shaft; amplitude: peak of the sine, unit; level_dB: of its RMS re the "
    "reference of the unit; phase_deg: at turn zero; u, u_blocks: standard uncertainty of one component, unit, from "
    "the noise about the line and from the scatter of blocks",
    "skipped.txt": "kind: aside (no failure) or failed; channel is empty where it is the whole file",
}


def write_tables(
    out: Path,
    header: Sequence[str],
    results: Sequence[FileResult],
    decimal: str = ".",
) -> dict[str, int]:
    """Write every table, those without a row as well; optional ones only where a file has them.

    Parameters
    ----------
    header : sequence of str
        Lines on settings and calibration.
    results : sequence of FileResult
        Sorted by label; those that are kept have lines.
    decimal : {".", ","}
        Decimal sign.

    Returns
    -------
    dict
        Number of rows of each table that was written.
    """
    written = {}
    reasons, joined = _stepped_sines(results)
    references = ", ".join(f"{unit} re {ref.text}" for unit, ref in LEVEL_REFERENCES.items())
    for name, columns in text.COLUMNS.items():
        here = [r for r in results if isinstance(r, Kept) and name in r.places]
        if name in text.OPTIONAL and not here:
            continue
        about = [
            f"specan {__version__} {name}",
            *header,
            f"units: {UNITS[name]}",
            f"level references: {references}",
        ]
        about += [f"file {r.label}: {line}" for r in here for line in r.about]
        lines: Iterable[str]
        if name == "skipped.txt":
            skipped = _skipped(results, reasons)
            lines, written[name] = [skipped], skipped.count("\n")
        elif name == "sine.txt":
            blocks = {**{r.label: r.lines(name) for r in here}, **joined}
            lines = [block for _, block in sorted(blocks.items())]
            written[name] = sum(block.count("\n") for block in blocks.values())
        else:
            lines = (r.lines(name) for r in here)
            written[name] = sum(r.rows[name] for r in here)
        text.write_table(out / name, about, columns, lines, decimal)
    return written


def _skipped(results: Sequence[FileResult], reasons: Sequence[tuple[str, str]]) -> str:
    rows = []
    for result in results:
        if result.kind != "done":
            rows.append((result.label, "", result.kind, result.reason))
        rows += [(result.label, channel, "aside", reason) for channel, reason in result.set_aside]
    rows += [(label, "", "aside", reason) for label, reason in reasons]
    return "".join("\t".join(map(text.word, row)) + "\n" for row in sorted(rows, key=lambda row: row[0]))


def _stepped_sines(results: Sequence[FileResult]) -> tuple[list[tuple[str, str]], dict[str, str]]:
    """Labels of what is in no stepped-sine characteristic, with the reason; lines of those that there are."""
    together: dict[str, list[ToneTable]] = defaultdict(list)
    for result in results:
        if result.tones:
            together[str(PurePosixPath(result.label).with_name(ALL))] += result.tones
    reasons, lines = [], {}
    for label, tables in together.items():
        left_out = not_steps(tables) if len(tables) > 1 else {}
        say = "; state Excitation = 'sine' in its properties if it is one"
        reasons += [
            (one, f"not in the stepped-sine characteristic: {why}{say}") for one, why in left_out.items()
        ]
        steps = [table for table in tables if table.label not in left_out]
        if len(steps) < 2:
            continue
        try:
            lines[label] = joined_lines(join_stepped_sine(steps, label), tables)
        except Exception as fault:
            known = fault if isinstance(fault, InputError) else InputError(reason_of(fault))
            reasons.append((label, f"no stepped-sine characteristic: {known}"))
    return reasons, lines
