"""Figure of decay times and clarity in bands."""

from __future__ import annotations

from typing import TYPE_CHECKING

from specan.data.decay import DecayTimes
from specan.report.figure_style import line_styles, octave_axis

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MANY = 8  # lines from which on the legend stands beside the axes


def figure_decay(found: DecayTimes) -> Figure:
    """Reverberation time T20 with its standard deviation, and clarity C80, of every channel."""
    from matplotlib.figure import Figure  # not pyplot: no window, no global state

    figure = Figure(figsize=(9.0, 6.0), layout="constrained")
    times, clarity = figure.subplots(2, 1, sharex=True)
    for row, (name, style) in enumerate(zip(found.channels, line_styles())):
        times.errorbar(
            found.exact_hz, found.t20_s[row], found.u_t20_s[row], marker="o", capsize=3, label=name, **style
        )
        clarity.plot(found.exact_hz, found.c80_dB[row], marker="o", **style)
    for axes, label in ((times, "Reverberation time T20 / s"), (clarity, "Clarity C80 / dB")):
        axes.set_ylabel(label)
        axes.grid(True, color="0.9")
    times.set_ylim(bottom=0.0)
    edge = 10 ** (0.15 / found.fraction)
    octave_axis(clarity, float(found.exact_hz[0] / edge), float(found.exact_hz[-1] * edge))
    clarity.set_xlabel("Mid-band frequency / Hz")
    if len(found.channels) > _MANY:
        figure.legend(*times.get_legend_handles_labels(), loc="outside right upper", fontsize="x-small")
    else:
        times.legend(fontsize="small")
    figure.suptitle(
        f"{found.label}: 1/{found.fraction} octave, ISO 3382-1; bars: one standard deviation",
        fontsize="medium",
    )
    return figure
