"""Lines of `noise.txt`: transfer function and coherence of each channel, line by line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from specan.data.frequency_response import FrequencyResponse
from specan.io import results_text as text
from specan.io.number_text import Cells, fixed_cells, lines, significant_cells, text_cells


def noise_lines(response: FrequencyResponse, quality: Sequence[Sequence[str]]) -> str:
    """Lines of all channels; `quality` holds the words that the samples of each gave rise to."""
    frequency = _frequency_cells(response.frequency_hz.tobytes())
    u_percent = np.hypot(response.u_magnitude_percent, response.u_common_percent)
    u_phase = np.hypot(response.u_phase_deg, response.u_common_phase_deg)
    magnitude, phase = response.magnitude, text.in_one_turn(response.phase_deg)
    line_flags = response.line_flags
    blocks = []
    for row, name in enumerate(response.channels):
        words = tuple(dict.fromkeys((*quality[row], *response.flags[row])))
        cells = [
            frequency,
            significant_cells(magnitude[row], 6),
            fixed_cells(phase[row], 2),
            fixed_cells(response.coherence[row], 5),
            significant_cells(u_percent[row], 3),
            significant_cells(u_phase[row], 3),
            _line_words({name: holds[row] for name, holds in line_flags.items()}, words),
        ]
        blocks.append(lines(cells, before=f"{text.word(response.label)}\t{text.word(name)}\t"))
    return "".join(blocks)


@lru_cache(maxsize=4)
def _frequency_cells(frequencies: bytes) -> Cells:
    """Many files of a batch have the same lines."""
    return text_cells(text.frequencies(np.frombuffer(frequencies)))


def _line_words(holds: Mapping[str, NDArray[np.bool_]], words: tuple[str, ...]) -> Cells:
    """Words of the channel and of each of its lines; every combination is put together once."""
    extra = {name: lines for name, lines in holds.items() if name not in words}
    code = sum((lines.astype(int) << bit for bit, lines in enumerate(extra.values())), np.zeros(1, dtype=int))
    texts = [
        " ".join((*words, *(name for bit, name in enumerate(extra) if combination >> bit & 1)))
        for combination in range(1 << len(extra))
    ]
    count = len(next(iter(holds.values())))
    return text_cells(texts)[np.broadcast_to(code, count)]
