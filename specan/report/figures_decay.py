"""Figure of decay times and clarity in bands."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from specan.data.decay import DecayTimes
from specan.report.channel_lines import FEW, chosen, draw_range, styles_of
from specan.report.figure_style import heading, legend_below, new_figure, octave_axis, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@styled
def figure_decay(found: DecayTimes) -> Figure:
    """Reverberation time T20 with its standard deviation, and clarity C80, of every channel."""
    figure = new_figure(5.8)
    times, clarity = figure.subplots(2, 1, sharex=True)
    many = len(found.channels) > FEW
    if many:
        draw_range(times, found.exact_hz, found.t20_s)
        draw_range(clarity, found.exact_hz, found.c80_dB)
    for row, style in styles_of(chosen(found.t20_s), many).items():
        times.errorbar(
            found.exact_hz, found.t20_s[row], found.u_t20_s[row], marker="o", markersize=4, capsize=3,
            label=found.channels[row], **style,
        )  # fmt: skip
        clarity.plot(found.exact_hz, found.c80_dB[row], marker="o", markersize=4, **style)
    times.set_ylabel("Reverberation time T20 / s")
    clarity.set_ylabel("Clarity C80 / dB")
    times.set_ylim(bottom=0.0)
    edge = 10 ** (0.15 / found.fraction)
    octave_axis(clarity, float(found.exact_hz[0] / edge), float(found.exact_hz[-1] * edge))
    clarity.set_xlabel("Mid-band frequency / Hz")
    figure.align_ylabels()
    known = found.t20_s[np.isfinite(found.t20_s)]
    result = f"T20 {known.min():.3g} to {known.max():.3g} s" if known.size else "No band has a decay of 20 dB"
    heading(
        figure, found.label or "Decay times",
        f"1/{found.fraction} octave, ISO 3382-1; bars: one standard deviation", result,
    )  # fmt: skip
    legend_below(figure, times)
    return figure
