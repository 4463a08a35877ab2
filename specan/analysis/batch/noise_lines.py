"""Lines of `noise.txt`: transfer function and coherence of each channel, line by line."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from specan.data.frequency_response import FrequencyResponse
from specan.io import results_text as text


def noise_lines(response: FrequencyResponse, quality: Sequence[Sequence[str]]) -> str:
    """Lines of all channels; `quality` holds the words that the samples of each gave rise to."""
    frequency = text.frequencies(response.frequency_hz)
    u_percent = np.hypot(response.u_magnitude_percent, response.u_common_percent)
    u_phase = np.hypot(response.u_phase_deg, response.u_common_phase_deg)
    blocks = []
    for row, name in enumerate(response.channels):
        words = tuple(dict.fromkeys((*quality[row], *response.flags[row])))
        channel = f"{text.word(response.label)}\t{text.word(name)}"
        blocks.append(
            text.rows_of_numbers(
                [f"{channel}\t{each}" for each in frequency],
                [
                    text.significant_numbers(response.magnitude[row]),
                    text.phase_numbers(response.phase_deg[row]),
                    text.fixed_numbers(response.coherence[row], 5),
                    text.significant_numbers(u_percent[row], 3),
                    text.significant_numbers(u_phase[row], 3),
                ],
                _line_words(response, row, words),
            )
        )
    return "".join(blocks)


def _line_words(response: FrequencyResponse, row: int, words: tuple[str, ...]) -> list[str]:
    """Words of the channel and of each of its lines; every combination is put together once."""
    extra = {name: holds[row] for name, holds in response.line_flags.items() if name not in words}
    code = sum((holds.astype(int) << bit for bit, holds in enumerate(extra.values())), np.zeros(1, dtype=int))
    texts = [
        " ".join((*words, *(name for bit, name in enumerate(extra) if combination >> bit & 1)))
        for combination in range(1 << len(extra))
    ]
    return [texts[c] for c in np.broadcast_to(code, len(response.frequency_hz)).tolist()]
