"""Figure of waveforms: what the channels of a recording look like over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from specan.data.recording import Channel, Recording
from specan.dsp.extremes import low_and_high
from specan.report.figure_style import COLOURS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_CHANNELS = 32
_COLUMNS = 1500  # of the picture
_BLOCK = 1 << 16


def figure_waveforms(
    recording: Recording, channels: Sequence[Channel] = (), start_s: float = 0.0, stop_s: float | None = None
) -> Figure:
    """Waveform of each channel on a strip of its own; of long ones the extremes in each column of the picture.

    Parameters
    ----------
    recording : Recording
    channels : sequence of Channel
        All that have samples and a sampling rate by default; `MOST_CHANNELS` are drawn.
    start_s, stop_s : float
        Time section.
    """
    from matplotlib.figure import Figure  # not pyplot: no window, no global state

    usable = [c for c in channels or recording.channels if c.sampling_rate > 0 and c.n_samples > 0]
    shown = usable[:MOST_CHANNELS]
    rows = max(len(shown), 1)
    figure = Figure(figsize=(9.0, 1.2 + max(0.45 * rows, 2.0)), layout="constrained")
    sheet = figure.subplots(rows, 1, sharex=True, squeeze=False)[:, 0]
    for axes, channel in zip(sheet, shown, strict=False):
        times, low, high = _envelope(recording, channel, start_s, stop_s)
        axes.fill_between(times, low, high, color=COLOURS[0], linewidth=0.6)
        axes.set_ylabel(
            f"{channel.name} / {channel.unit}".replace("$", r"\$"), rotation=0, ha="right", va="center",
            fontsize="small",
        )  # fmt: skip
        axes.tick_params(labelsize="x-small")
        axes.grid(True, axis="x", color="0.9")
        axes.set_axisbelow(True)
        axes.margins(x=0)
    sheet[-1].set_xlabel("Time / s")
    left_out = f"; {len(shown)} of {len(usable)} channels" if len(shown) < len(usable) else ""
    figure.suptitle(f"{recording.label}{left_out}".replace("$", r"\$"), fontsize="medium")
    return figure


def _envelope(
    recording: Recording, channel: Channel, start_s: float, stop_s: float | None
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Times, lowest and highest samples; read in pieces, whatever the length."""
    rate = channel.sampling_rate
    first = min(round(start_s * rate), channel.n_samples - 1)
    last = (
        channel.n_samples if stop_s is None else min(max(round(stop_s * rate), first + 1), channel.n_samples)
    )
    if last - first <= 2 * _COLUMNS:
        samples = recording.read([channel], first, last)[0]
        return np.arange(first, last) / rate, samples, samples
    step = -(-(last - first) // _COLUMNS)
    lows, highs = [], []
    for begin in range(first, last, max(_BLOCK // step, 1) * step):
        end = min(begin + max(_BLOCK // step, 1) * step, last)
        low, high = low_and_high(recording.read([channel], begin, end)[0], -(-(end - begin) // step))
        lows.append(low)
        highs.append(high)
    low, high = np.concatenate(lows), np.concatenate(highs)
    middles = first + (np.arange(low.size, dtype=np.float64) + 0.5) * step
    return middles / rate, low, high
