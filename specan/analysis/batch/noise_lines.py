"""Lines of `noise.txt`: transfer function and coherence of each channel, line by line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from specan.data.frequency_response import FrequencyResponse
from specan.io import results_text as text
from specan.io.number_text import Cells, fixed_cells, lines, significant_cells, text_cells

# Lines whose numbers are formatted together: enough to share the calls, few enough to stay in the cache.
_AT_ONCE = 1 << 14


def noise_lines(response: FrequencyResponse, quality: Sequence[Sequence[str]]) -> str:
    """Lines of all channels; `quality` holds the words that the samples of each gave rise to."""
    frequency = _frequency_cells(response.frequency_hz.tobytes())
    u_percent = np.hypot(response.u_magnitude_percent, response.u_common_percent)
    u_phase = np.hypot(response.u_phase_deg, response.u_common_phase_deg)
    magnitude, phase = response.magnitude, response.phase_deg
    line_flags = response.line_flags
    count = len(response.frequency_hz)
    at_once = max(1, _AT_ONCE // max(count, 1))
    blocks = []
    for first in range(0, len(response.channels), at_once):
        few = slice(first, first + at_once)
        columns = [
            cells.reshape(-1, count, cells.shape[1])
            for cells in (
                significant_cells(magnitude[few].ravel(), 6),
                fixed_cells(text.in_one_turn(phase[few].ravel()), 2),
                fixed_cells(response.coherence[few].ravel(), 5),
                significant_cells(u_percent[few].ravel(), 3),
                significant_cells(u_phase[few].ravel(), 3),
            )
        ]
        for row, name in enumerate(response.channels[few], start=first):
            words = tuple(dict.fromkeys((*quality[row], *response.flags[row])))
            last = _line_words({flag: holds[row] for flag, holds in line_flags.items()}, words)
            cells = [frequency, *(column[row - first] for column in columns), last]
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
