"""Figure of a calibration: sensitivity and phase of every channel with their uncertainties."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from specan.data.calibration import Calibration, ChannelCalibration
from specan.report.figure_style import COLOURS, heading, legend_below, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MARKS = {"good": ("o", COLOURS[0]), "doubtful": ("s", COLOURS[5]), "failed": ("x", COLOURS[1])}


@styled
def figure_calibration(found: Calibration) -> Figure:
    """Sensitivities, and phases over the first channel of each group; the bars are 95 %."""
    with_phase = any(c.phase is not None for c in found.channels)
    figure = new_figure(1.7 + 0.2 * len(found.channels), 8.4 if with_phase else 5.6)
    sheet = figure.subplots(1, 2 if with_phase else 1, sharey=True, squeeze=False)[0]
    units = ", ".join(dict.fromkeys(c.unit for c in found.channels))
    _sensitivities(sheet[0], found)
    sheet[0].set_xlabel(f"Sensitivity / ({units})" if units else "Sensitivity")
    if with_phase:
        _phases(sheet[1], found)
    sheet[0].set_yticks(range(len(found.channels)), [c.channel for c in found.channels])
    sheet[0].set_ylim(len(found.channels) - 0.4, -0.6)
    for axes in sheet:
        axes.grid(False, axis="y")
    tone = f" at {found.calibrator_frequency_hz:.2f} Hz" if found.calibrator_frequency_hz else ""
    counts = [f"{len(_of(found, verdict))} {verdict}" for verdict in _MARKS if _of(found, verdict)]
    if len(counts) > 1:
        legend_below(figure, sheet[0])
    heading(figure, f"Calibration{tone}", ", ".join(counts) + "; bars: 95 % intervals")
    return figure


def _of(found: Calibration, verdict: str) -> list[tuple[int, ChannelCalibration]]:
    return [(k, c) for k, c in enumerate(found.channels) if c.verdict == verdict]


def _sensitivities(axes: Axes, found: Calibration) -> None:
    for verdict, (mark, colour) in _MARKS.items():
        mine = _of(found, verdict)
        if mine:
            values = [c.sensitivity for _, c in mine]
            reach = [2 * c.u_sensitivity_percent / 100 * c.sensitivity for _, c in mine]
            axes.errorbar(
                values, [k for k, _ in mine], xerr=reach, fmt=mark, color=colour, capsize=2, label=verdict
            )


def _phases(axes: Axes, found: Calibration) -> None:
    """The phase at each of the calibration's own frequencies."""
    for verdict, (mark, colour) in _MARKS.items():
        for k, c in _of(found, verdict):
            if c.phase is not None:
                phase = np.asarray(c.phase.phase_deg, dtype=float)
                reach = 2 * np.asarray(c.phase.u_phase_deg, dtype=float)
                axes.errorbar(phase, np.full(phase.size, k), xerr=reach, fmt=mark, color=colour, capsize=2)
    groups = ", ".join(dict.fromkeys(c.phase.group for c in found.channels if c.phase is not None))
    axes.set_xlabel(f"Phase over {groups} / degrees" if groups else "Phase / degrees")
