"""Lines of `sine.txt`: one tone on every channel, the microphones together, a directory of stepped sines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from specan.data.frequency_response import FrequencyResponse
from specan.data.tone import ToneTable
from specan.io import results_text as text
from specan.units import level_reference

MEAN = "energy-mean"
JOINED = "stepped-sine"


def with_flags(table: ToneTable, quality: Sequence[Sequence[str]]) -> ToneTable:
    """The table with the words that the samples themselves gave rise to, each word once."""
    flags = tuple(
        tuple(dict.fromkeys((*words, *own))) for words, own in zip(quality, table.flags, strict=True)
    )
    return replace(table, flags=flags)


def tone_lines(table: ToneTable) -> str:
    """One line a channel, and the energy mean of the microphones if there are several."""
    others = np.array([name != table.reference for name in table.channels])
    lines = _lines(
        table,
        channel=text.words(table.channels),
        role=table.roles,
        unit=text.words(table.units),
        rms=table.rms,
        level_dB=table.level_dB,
        tone_rms=table.tone_rms,
        phase_deg=np.where(others, table.phase_deg, np.nan),
        u_phase_deg=text.significant(np.where(others, table.u_phase_deg, np.nan), 2),
        magnitude_re_reference=np.where(others, table.magnitude, np.nan),
        flags=table.flags,
    )
    return lines + _energy_mean(table)


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
        level_dB=20 * np.log10(rms / level_reference("Pa").value),
        tone_rms=tone,
        magnitude_re_reference=tone / table.reference_rms if table.reference_rms > 0 else np.nan,
        flags=[tuple(dict.fromkeys(word for i in rows for word in table.flags[i]))],
    )


def _lines(table: ToneTable, **columns: Any) -> str:
    common = {
        "file": table.label, "frequency_hz": table.frequency_hz, "reference": table.reference or "",
        "reference_rms": table.reference_rms,
    }  # fmt: skip
    return text.table_lines({**common, **columns}, text.COLUMNS["sine.txt"])


def joined_lines(response: FrequencyResponse, roles: dict[str, str], units: dict[str, str]) -> str:
    """The stepped-sine characteristic of a directory: channel by channel, frequency rising."""
    u_phase = np.hypot(response.u_phase_deg, response.u_common_phase_deg)
    blocks = []
    for row, name in enumerate(response.channels):
        known = np.flatnonzero(np.isfinite(response.response[row]))
        columns = {
            "file": response.label,
            "channel": name,
            "role": roles[name],
            "unit": units[name],
            "frequency_hz": response.frequency_hz[known],
            "phase_deg": response.phase_deg[row, known],
            "u_phase_deg": text.significant(u_phase[row, known], 2),
            "magnitude_re_reference": response.magnitude[row, known],
            "reference": response.reference,
            "flags": " ".join((JOINED, *response.flags[row])),
        }
        blocks.append(text.table_lines(columns, text.COLUMNS["sine.txt"]))
    return "".join(blocks)
