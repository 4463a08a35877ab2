"""Figure of a calibration: sensitivity and phase of every channel with their uncertainties."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from specan.data.calibration import Calibration, ChannelCalibration
from specan.report.figure_style import COLOURS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MARKS = {"good": ("o", COLOURS[0]), "doubtful": ("s", COLOURS[5]), "failed": ("x", COLOURS[1])}


def figure_calibration(found: Calibration) -> Figure:
    """Sensitivities, and phases over the first channel of each group; the bars are 95 %."""
    from matplotlib.figure import Figure  # not pyplot: no window, no global state

    with_phase = any(c.phase is not None for c in found.channels)
    figure = Figure(
        figsize=(8.0 if with_phase else 5.0, 1.4 + 0.26 * len(found.channels)), layout="constrained"
    )
    sheet = figure.subplots(1, 2 if with_phase else 1, sharey=True, squeeze=False)[0]
    units = ", ".join(dict.fromkeys(c.unit for c in found.channels))
    _sensitivities(sheet[0], found)
    sheet[0].set_xlabel(f"Sensitivity / ({units})" if units else "Sensitivity")
    if with_phase:
        _phases(sheet[1], found)
    sheet[0].set_yticks(range(len(found.channels)), [c.channel.replace("$", r"\$") for c in found.channels])
    sheet[0].set_ylim(len(found.channels) - 0.4, -0.6)
    for axes in sheet:
        axes.grid(True, axis="x", color="0.9")
        axes.set_axisbelow(True)
    handles = dict(zip(*sheet[0].get_legend_handles_labels()[::-1], strict=True))
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=3, fontsize="small")
    tone = f" at {found.calibrator_frequency_hz:.2f} Hz" if found.calibrator_frequency_hz else ""
    figure.suptitle(f"Calibration{tone}", fontsize="medium")
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
