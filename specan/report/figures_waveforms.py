"""Figure of waveforms: what the channels of a recording look like over time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from specan.data.channel import Channel
from specan.data.decay import ImpulseResponses
from specan.data.levels import decibels
from specan.data.recording import Recording
from specan.report.figure_style import COLOURS, heading, level_label, new_figure, remark, styled
from specan.report.panels import Drawing, level_panels
from specan.report.waveform import COLUMNS, Waveform, common_reach, read_overviews
from specan.units import level_reference, quotient

MOST_CHANNELS = 32
_DYNAMICS_DB = 80.0  # that the figure of impulse responses shows at most


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
    waveforms = [Waveform(recording, channel) for channel in shown]
    # A part holds the sample at its end; a section does not.
    ends = [(start_s, (c.duration_s if stop_s is None else stop_s) - 1.5 / c.sampling_rate) for c in shown]
    read_overviews([w for w, part in zip(waveforms, ends, strict=True) if w.needs_overview(*part)])
    drawn = [w.part(*part) for w, part in zip(waveforms, ends, strict=True)]
    reach = common_reach((c.unit, y) for c, (_, y) in zip(shown, drawn)) if rows > 6 else {}
    for axes, channel, (times, values) in zip(sheet, shown, drawn, strict=False):
        axes.plot(times, values, color=COLOURS[0], linewidth=0.6)
        axes.margins(x=0)
        axes.grid(rows <= 6)
        _scale(axes, channel, reach.get(channel.unit))
        if axes is not sheet[-1]:
            axes.spines["bottom"].set_visible(False)
            axes.tick_params(axis="x", length=0)
    if rows > 6:
        figure.get_layout_engine().set(h_pad=0.015, hspace=0.0)  # type: ignore[union-attr, call-arg]
    else:
        figure.align_ylabels(sheet)
    if drawn:
        sheet[-1].set_xlim(start_s, max(times[-1] for times, _ in drawn))
    sheet[-1].set_xlabel("Time / s")
    left_out = f"{len(shown)} of {len(usable)} channels. " if len(shown) < len(usable) else ""
    scales = ", ".join(f"±{end:.3g} {unit}" for unit, end in reach.items())
    about = f"Full height of a strip: {scales}. " if scales else ""
    if (said := recording.calibration_of([c.name for c in shown])) != "none":
        remark(figure, f"Calibration: {said}")
    heading(figure, recording.label or "Waveforms", left_out + about)
    return figure


def figure_impulse_responses(found: ImpulseResponses) -> Drawing:
    """Levels of impulse responses over time, one pair of axes a unit: the highest sample of each column."""
    size = max(found.time_s.size // COLUMNS, 1)
    highest = np.maximum.reduceat(np.abs(found.samples), np.arange(0, found.time_s.size, size), axis=1)
    over = found.reference_unit
    labels = [level_label(level_reference(quotient(unit, over)).text) for unit in found.units]
    panels = level_panels(labels, found.channels, found.time_s[::size], decibels(highest), _DYNAMICS_DB)
    facts = (f"{found.method} over {found.reference}",)
    return Drawing(found.label or "Impulse responses", facts, "Time / s", tuple(panels))
