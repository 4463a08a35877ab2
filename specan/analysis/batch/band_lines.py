"""Lines of `bands.txt` and `other.txt`: band levels and totals of each channel."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from specan.data.band_levels import BandLevels
from specan.data.channel import Channel
from specan.io import results_text as text
from specan.units import level_reference


def band_lines(levels: BandLevels) -> str:
    """Lines of `bands.txt`: the bands of each channel, then its totals with every weighting."""
    return "".join(text.table_lines(columns, text.COLUMNS["bands.txt"]) for columns in _columns(levels))


def other_lines(levels: BandLevels, roles: tuple[str, ...]) -> str:
    """Lines of `other.txt`: the same with role, unit, and the RMS value of each channel."""
    return "".join(
        text.table_lines({**columns, "role": role, "unit": unit}, text.COLUMNS["other.txt"])
        for columns, role, unit in zip(_columns(levels), roles, levels.units, strict=True)
    )


def rms_lines(label: str, channels: Sequence[Channel], rms: ArrayLike, flags: Sequence[Sequence[str]]) -> str:
    """Lines of `other.txt` for channels without band levels: one total a channel."""
    zero = np.array([level_reference(c.unit).value for c in channels])
    with np.errstate(divide="ignore"):
        level = 20 * np.log10(np.asarray(rms) / zero)
    columns = {
        "file": label,
        "channel": text.words(c.name for c in channels),
        "role": [c.role for c in channels],
        "unit": text.words(c.unit for c in channels),
        "band_hz": "total-Z",
        "rms": rms,
        "level_dB": level,
        "flags": flags,
    }
    return text.table_lines(columns, text.COLUMNS["other.txt"])


def _columns(levels: BandLevels) -> Iterator[dict[str, Any]]:
    """The lines of each channel; only the total with Z has an RMS value."""
    bands = levels.exact_hz.size
    for row, name in enumerate(levels.channels):
        totals = {w: v[row] for w, v in levels.overall_dB.items() if not np.isnan(v[row]) or w == "Z"}
        rms = [
            levels.references[row].value * 10 ** (v / 20) if w == "Z" else np.nan for w, v in totals.items()
        ]
        flags = [levels.band_flags(row, band) for band in range(bands)]
        yield {
            "file": levels.label,
            "channel": name,
            "band_hz": [*(f"{f:g}" for f in levels.nominal_hz), *(f"total-{w}" for w in totals)],
            "rms": [*[np.nan] * bands, *rms],
            "level_dB": [*levels.level_dB[row], *totals.values()],
            "u_dB": [*levels.u_dB, *[np.nan] * len(totals)],
            "flags": [*flags, *(levels.overall_flags(row, w) for w in totals)],
        }
