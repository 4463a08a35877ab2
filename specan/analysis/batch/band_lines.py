"""Lines of `bands.txt` and `other.txt`: band levels and totals of each channel."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from specan.data.band_levels import BandLevels
from specan.data.channel import Channel
from specan.io import results_text as text
from specan.units import level_reference


@dataclass(frozen=True)
class _Line:
    row: int
    band: str
    level: float
    u_level: float
    rms: float
    flags: tuple[str, ...]


def band_lines(levels: BandLevels) -> str:
    """Lines of `bands.txt`: the bands of each channel, then its totals with every weighting."""
    lines = list(_lines(levels))
    return text.rows(
        [
            [text.word(levels.label)] * len(lines),
            [text.word(levels.channels[line.row]) for line in lines],
            [line.band for line in lines],
            text.levels([line.level for line in lines]),
            text.levels([line.u_level for line in lines]),
            [" ".join(line.flags) for line in lines],
        ]
    )


def rms_lines(label: str, channels: Sequence[Channel], rms: ArrayLike, flags: Sequence[Sequence[str]]) -> str:
    """Lines of `other.txt` for channels without band levels: one total a channel."""
    zero = np.array([level_reference(c.unit).value for c in channels])
    with np.errstate(divide="ignore"):
        level = 20 * np.log10(np.asarray(rms) / zero)
    n = len(channels)
    return text.rows(
        [
            [text.word(label)] * n,
            [text.word(c.name) for c in channels],
            [c.role for c in channels],
            [text.word(c.unit) for c in channels],
            ["total-Z"] * n,
            text.significant(rms),
            text.levels(level),
            [""] * n,
            [" ".join(words) for words in flags],
        ]
    )


def other_lines(levels: BandLevels, roles: tuple[str, ...]) -> str:
    """Lines of `other.txt`: the same with role, unit, and the RMS value of each channel."""
    lines = list(_lines(levels))
    return text.rows(
        [
            [text.word(levels.label)] * len(lines),
            [text.word(levels.channels[line.row]) for line in lines],
            [roles[line.row] for line in lines],
            [text.word(levels.units[line.row]) for line in lines],
            [line.band for line in lines],
            text.significant([line.rms for line in lines]),
            text.levels([line.level for line in lines]),
            text.levels([line.u_level for line in lines]),
            [" ".join(line.flags) for line in lines],
        ]
    )


def _lines(levels: BandLevels) -> Iterator[_Line]:
    for row in range(len(levels.channels)):
        for band, nominal in enumerate(levels.nominal_hz):
            yield _Line(
                row,
                f"{nominal:g}",
                float(levels.level_dB[row, band]),
                float(levels.u_dB[band]),
                np.nan,
                levels.band_flags(row, band),
            )
        for weighting, totals in levels.overall_dB.items():
            if not np.isnan(totals[row]) or weighting == "Z":
                rms = levels.references[row].value * 10 ** (totals[row] / 20) if weighting == "Z" else np.nan
                yield _Line(
                    row,
                    f"total-{weighting}",
                    float(totals[row]),
                    np.nan,
                    float(rms),
                    levels.overall_flags(row, weighting),
                )
