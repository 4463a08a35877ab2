"""Lines of `sine.txt`: one tone on every channel, the microphones together, a directory of stepped sines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

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
    n = len(table.channels)
    itself = np.array([name == table.reference for name in table.channels])
    lines = _lines(
        table.label,
        table.channels,
        table.roles,
        table.units,
        [table.frequency_hz] * n,
        rms=table.rms,
        level=table.level_dB,
        tone_rms=table.tone_rms,
        phase=np.where(itself, np.nan, table.phase_deg),
        u_phase=np.where(itself, np.nan, table.u_phase_deg),
        magnitude=np.where(itself, np.nan, table.magnitude),
        reference=table.reference or "",
        reference_rms=table.reference_rms,
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
        table.label,
        [MEAN],
        ["microphone"],
        ["Pa"],
        [table.frequency_hz],
        rms=[rms],
        level=[20 * np.log10(rms / level_reference("Pa").value)],
        tone_rms=[tone],
        phase=[np.nan],
        u_phase=[np.nan],
        magnitude=[tone / table.reference_rms if table.reference_rms > 0 else np.nan],
        reference=table.reference or "",
        reference_rms=table.reference_rms,
        flags=[tuple(dict.fromkeys(word for i in rows for word in table.flags[i]))],
    )


def joined_lines(response: FrequencyResponse, roles: dict[str, str], units: dict[str, str]) -> str:
    """The stepped-sine characteristic of a directory: channel by channel, frequency rising."""
    u_phase = np.hypot(response.u_phase_deg, response.u_common_phase_deg)
    blocks = []
    for row, name in enumerate(response.channels):
        known = np.flatnonzero(np.isfinite(response.response[row]))
        nothing = np.full(known.size, np.nan)
        blocks.append(
            _lines(
                response.label,
                [name] * known.size,
                [roles[name]] * known.size,
                [units[name]] * known.size,
                response.frequency_hz[known],
                rms=nothing,
                level=nothing,
                tone_rms=nothing,
                phase=response.phase_deg[row, known],
                u_phase=u_phase[row, known],
                magnitude=response.magnitude[row, known],
                reference=response.reference,
                reference_rms=np.nan,
                flags=[(JOINED, *response.flags[row])] * known.size,
            )
        )
    return "".join(blocks)


def _lines(
    label: str,
    channels: Sequence[str],
    roles: Sequence[str],
    units: Sequence[str],
    frequency: ArrayLike,
    *,
    rms: ArrayLike,
    level: ArrayLike,
    tone_rms: ArrayLike,
    phase: ArrayLike,
    u_phase: ArrayLike,
    magnitude: ArrayLike | NDArray[np.float64],
    reference: str,
    reference_rms: float,
    flags: Sequence[Sequence[str]],
) -> str:
    n = len(channels)
    return text.rows(
        [
            [text.word(label)] * n,
            [text.word(name) for name in channels],
            roles,
            [text.word(unit) for unit in units],
            text.frequencies(frequency),
            text.significant(rms),
            text.levels(level),
            text.significant(tone_rms),
            text.phases(phase),
            text.significant(u_phase, 2),
            text.significant(magnitude),
            [text.word(reference)] * n,
            text.significant(reference_rms) * n,
            [" ".join(words) for words in flags],
        ]
    )
