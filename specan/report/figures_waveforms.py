"""Figure of waveforms: what the channels of a recording look like over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from specan.data.channel import Channel
from specan.data.recording import Recording
from specan.dsp.statistics import low_and_high
from specan.report.figure_style import COLOURS, heading, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from specan.data.decay import ImpulseResponses

MOST_CHANNELS = 32
_COLUMNS = 1500  # of the picture
_BLOCK = 1 << 16


def _scale(axes: Axes, channel: Channel, reach: float | None) -> None:
    """Its own scale; on a page full of strips channels of a unit share one, which is stated in the margin."""
    label, size = f"{channel.label} / {channel.unit}", 8
    if reach is not None:
        axes.set_ylim(-reach, reach)
        axes.set_yticks([])
        axes.spines["left"].set_visible(False)
        label, size = channel.label, 7
    axes.set_ylabel(label, rotation=0, ha="right", va="center", fontsize=size)


@styled
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
    usable = [c for c in channels or recording.channels if c.sampling_rate > 0 and c.n_samples > 0]
    shown = usable[:MOST_CHANNELS]
    rows = max(len(shown), 1)
    figure = new_figure(1.1 + max((0.8 if rows <= 6 else 0.21) * rows, 1.6))
    sheet = figure.subplots(rows, 1, sharex=True, squeeze=False)[:, 0]
    drawn = [_envelope(recording, channel, start_s, stop_s) for channel in shown]
    reach = _common_reach(shown, drawn) if rows > 6 else {}
    for axes, channel, (times, low, high) in zip(sheet, shown, drawn, strict=False):
        axes.fill_between(times, low, high, color=COLOURS[0], linewidth=0.6)
        axes.margins(x=0)
        axes.grid(rows <= 6)
        _scale(axes, channel, reach.get(channel.unit))
        if axes is not sheet[-1]:
            axes.spines["bottom"].set_visible(False)
            axes.tick_params(axis="x", length=0)
    if rows > 6:
        figure.get_layout_engine().set(h_pad=0.0, hspace=0.0)  # type: ignore[union-attr, call-arg]
    else:
        figure.align_ylabels(sheet)
    sheet[-1].set_xlabel("Time / s")
    left_out = f"{len(shown)} of {len(usable)} channels. " if len(shown) < len(usable) else ""
    scales = ", ".join(f"±{end:.3g} {unit}" for unit, end in reach.items())
    about = f"Full height of a strip: {scales}. " if scales else ""
    long = any(low is not high for _, low, high in drawn)
    extremes = "Filled from the lowest to the highest sample of each column." if long else ""
    heading(figure, recording.label or "Waveforms", left_out + about + extremes)
    return figure


def figure_impulse_responses(found: ImpulseResponses) -> Figure:
    """Waveforms of impulse responses."""
    return figure_waveforms(found.recording())


def _common_reach(
    shown: Sequence[Channel], drawn: Sequence[tuple[NDArray[np.float64], ...]]
) -> dict[str, float]:
    """Largest magnitude among the channels of each unit."""
    reach: dict[str, float] = {}
    for channel, (_, low, high) in zip(shown, drawn, strict=True):
        end = float(np.nanmax(np.abs([low, high]), initial=0.0))
        reach[channel.unit] = max(reach.get(channel.unit, 0.0), end if np.isfinite(end) else 0.0) or 1.0
    return reach


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
