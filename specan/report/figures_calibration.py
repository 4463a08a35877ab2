"""Figure of a calibration: sensitivity and phase of every channel with their uncertainties."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from specan.data.calibration import Calibration
from specan.report.figure_style import COLOURS, heading, legend_below, name_rows, new_figure, styled

_MARKS = {"good": ("o", COLOURS[0]), "doubtful": ("s", COLOURS[5]), "failed": ("x", COLOURS[1])}


@styled
def figure_calibration(found: Calibration) -> Figure:
    """Sensitivities, and phases over the first channel of each group; the bars are 95 %."""
    groups = dict.fromkeys(c.phase.group for c in found.channels if c.phase is not None)
    figure = new_figure(1.7 + 0.2 * len(found.channels), 8.4 if groups else 5.6)
    left, *right = figure.subplots(1, 2 if groups else 1, sharey=True, squeeze=False)[0]
    for k, c in enumerate(found.channels):
        mark, colour = _MARKS[c.verdict]
        style: dict[str, Any] = {"fmt": mark, "color": colour, "capsize": 2, "label": c.verdict}
        left.errorbar(c.sensitivity, k, xerr=2 * c.u_sensitivity_percent / 100 * c.sensitivity, **style)
        if c.phase is not None:  # at each of the calibration's own frequencies
            phase, u = np.asarray(c.phase.phase_deg, float), np.asarray(c.phase.u_phase_deg, float)
            right[0].errorbar(phase, np.full(phase.size, k), xerr=2 * u, **style)
    units = ", ".join(dict.fromkeys(c.unit for c in found.channels))
    left.set_xlabel(f"Sensitivity / ({units})" if units else "Sensitivity")
    for axes in (left, *right):
        name_rows(axes, [c.channel for c in found.channels])
    for axes in right:
        axes.set_xlabel(f"Phase over {', '.join(groups)} / degrees" if any(groups) else "Phase / degrees")
    tone = f" at {found.calibrator_frequency_hz:.2f} Hz" if found.calibrator_frequency_hz else ""
    verdicts = [c.verdict for c in found.channels]
    counts = [f"{verdicts.count(verdict)} {verdict}" for verdict in _MARKS if verdict in verdicts]
    if len(counts) > 1:
        legend_below(figure, left)
    heading(figure, f"Calibration{tone}", ", ".join(counts) + "; bars: 95 % intervals")
    return figure
