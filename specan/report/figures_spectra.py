"""Figures of spectra, spectrograms and transfer functions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from specan.data.frequency_response import FrequencyResponse
from specan.data.spectrum import Spectrogram, Spectrum
from specan.report.figure_style import (
    FEW,
    Styles,
    band_about,
    draw_range,
    draw_thin,
    grouped,
    heading,
    legend_above,
    legend_below,
    level_limits,
    micro,
    new_figure,
    octave_axis,
    outer_lines,
    phase_axis,
    styled,
    with_gaps,
)
from specan.result import counted

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_DYNAMICS_DB = 100.0  # that a figure shows at most
_PHASE_DB = 40.0  # below its highest line a spectrum's phase is not drawn
_KNOWN = 0.5  # relative uncertainty of a magnitude up to which it sets the limits of the axis


def _sheet(rows: Sequence[float], height: float) -> tuple[Figure, list[Axes]]:
    figure = new_figure(height)
    axes = figure.subplots(len(rows), 1, sharex=True, squeeze=False, height_ratios=list(rows))[:, 0]
    return figure, list(axes)


def _frequency_axis(axes: Sequence[Axes], frequency_hz: NDArray[np.float64]) -> None:
    positive = frequency_hz[frequency_hz > 0]
    octave_axis(axes[-1], float(positive[0]), float(positive[-1]))
    axes[-1].set_xlabel("Frequency / Hz")


@styled
def figure_frequency_response(found: FrequencyResponse, *, unwrapped: bool = False) -> Figure:
    """Magnitude with its 95 % band, phase, and a coherence strip under them.

    Each unit has its own axis of magnitude. Of more than eight channels the range is drawn, the median, and the
    channels that are furthest from it.

    Parameters
    ----------
    found : FrequencyResponse
    unwrapped : bool
        Phase without jumps instead of -180 to 180 degrees.

    Notes
    -----
    The band is twice the standard uncertainty, random and common parts in quadrature.
    """
    with_coherence = bool(np.isfinite(found.coherence).any())
    units = grouped(found.units)
    figure, axes = _sheet([*[3] * len(units), 2, *([1] if with_coherence else [])], 4.7 + 1.7 * len(units))
    f, level = found.frequency_hz, found.level_dB
    relative = 2 * np.hypot(found.u_magnitude_percent, found.u_common_percent) / 100
    styles: Styles = {}
    for panel, (unit, rows) in zip(axes, units.items(), strict=False):
        outer = outer_lines(panel, f, level, rows, styles)
        _magnitudes(panel, found, outer, relative, styles)
        panel.set_ylabel(f"Magnitude / dB re 1 {unit}")
        known = np.where(relative[rows] <= _KNOWN, level[rows], np.nan)
        panel.set_ylim(*level_limits(known if np.isfinite(known).any() else level[rows], _DYNAMICS_DB))
        if len(units) > 1:
            legend_above(panel)
    _phases(axes[len(units)], found, styles, unwrapped)
    if with_coherence:
        if len(level) > FEW:
            draw_range(axes[-1], f, found.coherence)
        for row, style in styles.items():
            axes[-1].plot(f, found.coherence[row], **style, linewidth=0.8)
        axes[-1].set(ylabel="Coherence", ylim=(0, 1.05))
    heading(
        figure,
        found.label or "Transfer functions",
        f"{found.estimator} over {found.reference}",
        _worth(found, relative),
    )
    if len(units) == 1:
        legend_below(figure, axes[0])
    _frequency_axis(axes, f)
    figure.align_ylabels(axes)
    return figure


def _magnitudes(
    axes: Axes,
    found: FrequencyResponse,
    rows: Sequence[int],
    relative: NDArray[np.float64],
    styles: Styles,
) -> None:
    f, level = found.frequency_hz, found.level_dB
    low, high = band_about(level, relative)
    marker = "." if len(f) < 60 else ""
    for row in rows:
        axes.fill_between(f, low[row], high[row], color=styles[row]["color"], alpha=0.2, linewidth=0)
        axes.plot(f, level[row], label=found.channels[row], linewidth=1.0, marker=marker, **styles[row])


def _phases(axes: Axes, found: FrequencyResponse, styles: Styles, unwrapped: bool) -> None:
    f = found.frequency_hz
    # A wrapped phase gets a gap where it jumps, not a vertical line.
    phases = found.unwrapped_phase_deg if unwrapped else np.array([with_gaps(row) for row in found.phase_deg])
    turn = 2 * np.hypot(found.u_phase_deg, found.u_common_phase_deg)
    if len(phases) > len(styles):
        draw_thin(axes, f, phases)
    for row, style in styles.items():
        axes.fill_between(
            f, phases[row] - turn[row], phases[row] + turn[row], color=style["color"], alpha=0.2, linewidth=0
        )
        axes.plot(f, phases[row], linewidth=1.0, marker="." if len(f) < 60 else "", **style)
    if unwrapped:
        axes.set_ylabel("Phase / degrees")
    else:
        phase_axis(axes)


def _worth(found: FrequencyResponse, relative: NDArray[np.float64]) -> str:
    """How well the result is known: median of the 95 % band, and of the coherence."""
    known = relative[np.isfinite(relative)]
    texts = []
    if known.size:
        texts.append(f"95 % band ±{20 * np.log10(1 + float(np.median(known))):.2g} dB (median)")
    coherence = found.coherence[np.isfinite(found.coherence)]
    if coherence.size:
        texts.append(f"coherence {float(np.median(coherence)):.3g} (median)")
    if found.n_blocks > 1:
        texts.append(f"{counted(found.n_blocks, 'block')}")
    return ", ".join(texts)


@styled
def figure_spectrum(found: Spectrum) -> Figure:
    """Levels of every channel, one pair of axes a level reference, and the phase where there is one."""
    references = grouped(found.scale.level_text(u) for u in found.units)
    with_phase = found.phase_deg is not None
    figure, axes = _sheet(
        [*[3] * len(references), *([2] if with_phase else [])], 2.2 + 2.2 * (len(references) + with_phase)
    )
    level, f = found.level_dB, found.frequency_hz
    styles: Styles = {}
    for panel, (text, rows) in zip(axes, references.items(), strict=False):
        for row in outer_lines(panel, f, level, rows, styles):
            panel.plot(f, level[row], label=found.channels[row], linewidth=1.0, **styles[row])
        panel.set_ylim(*level_limits(level[rows], _DYNAMICS_DB))
        panel.set_ylabel(f"Level / {micro(text)}")
        if len(references) > 1:
            legend_above(panel)
    if found.phase_deg is not None:
        for row, style in styles.items():
            strong = level[row] > np.nanmax(level[row], initial=-np.inf) - _PHASE_DB
            phase = np.where(strong, found.phase_deg[row], np.nan)
            axes[-1].plot(f, phase, ".", color=style["color"], markersize=3)
        over = f" over {found.phase_reference}" if found.phase_reference else ""
        phase_axis(axes[-1], f"Phase{over} / degrees\nwithin {_PHASE_DB:.0f} dB of the peak")
    scale = found.scale
    heading(
        figure, found.label or "Spectrum",
        f"{scale.scaling}, {scale.window}, {found.averaging} averaging of {counted(found.n_blocks, 'block')}, "
        f"line spacing {scale.line_spacing_hz:.4g} Hz, noise bandwidth {scale.enbw_hz:.4g} Hz",
        _strongest(found),
    )  # fmt: skip
    if len(references) == 1:
        legend_below(figure, axes[0])
    _frequency_axis(axes, f)
    figure.align_ylabels(axes)
    return figure


def _strongest(found: Spectrum) -> str:
    """Highest line of each level reference."""
    level = np.where((found.frequency_hz > 0) & np.isfinite(found.level_dB), found.level_dB, -np.inf)
    texts = []
    for text, rows in grouped(found.scale.level_text(u) for u in found.units).items():
        row, line = np.unravel_index(int(np.argmax(level[rows])), level[rows].shape)
        if np.isfinite(level[rows][row, line]):
            name, hertz = found.channels[rows[int(row)]], found.frequency_hz[line]
            texts.append(f"{name} {level[rows][row, line]:.1f} {micro(text)} at {hertz:.5g} Hz")
    return "Highest line: " + "; ".join(texts) if texts else ""


@styled
def figure_spectrogram(found: Spectrogram) -> Figure:
    """Level against time and frequency, one panel a channel."""
    figure, axes = _sheet(
        [1] * len(found.channels), 1.4 + max(2.4, 4.2 / len(found.channels)) * len(found.channels)
    )
    level = found.level_dB
    positive = found.frequency_hz > 0
    f = found.frequency_hz[positive]
    for row, (name, unit, one) in enumerate(zip(found.channels, found.units, axes)):
        picture = level[row][:, positive].T
        low, high = level_limits(picture, _DYNAMICS_DB)
        mesh = one.pcolormesh(
            found.time_s, f, picture, vmin=low, vmax=high, cmap="cividis", shading="nearest", rasterized=True
        )
        octave_axis(one, float(f[0]), float(f[-1]), "y")
        one.set_ylabel(f"{name}\nFrequency / Hz")
        one.grid(False)
        figure.colorbar(mesh, ax=one, label=f"Level / {micro(found.scale.level_text(unit))}")
    scale = found.scale
    heading(
        figure, found.label or "Spectrogram",
        f"{scale.scaling}, {scale.window}, line spacing {scale.line_spacing_hz:.4g} Hz, noise bandwidth "
        f"{scale.enbw_hz:.4g} Hz, blocks averaged in a column: {found.blocks_per_column}",
    )  # fmt: skip
    axes[-1].set_xlabel("Time / s")
    return figure
