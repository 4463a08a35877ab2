"""Figures of spectra, spectrograms and transfer functions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from specan.data.frequency_response import FrequencyResponse
from specan.data.spectrum import Spectrogram, Spectrum
from specan.report.figure_style import band_about, line_styles, octave_axis, with_gaps

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MANY = 8  # lines from which on the legend stands beside the axes
_DYNAMICS_DB = 100.0  # that a figure shows at most
_PHASE_DB = 40.0  # below its highest line a spectrum's phase is not drawn
_KNOWN = 0.5  # relative uncertainty of a magnitude up to which it sets the limits of the axis


def _figure(rows: Sequence[float], width: float = 8.0, height: float = 6.0) -> tuple[Figure, list[Axes]]:
    from matplotlib.figure import Figure  # not pyplot: no window, no global state

    figure = Figure(figsize=(width, height), layout="constrained")
    axes = figure.subplots(len(rows), 1, sharex=True, squeeze=False, height_ratios=list(rows))[:, 0]
    for one in axes:
        one.grid(True, color="0.9")
        one.set_axisbelow(True)
    return figure, list(axes)


def _frequency_axis(axes: Sequence[Axes], frequency_hz: NDArray[np.float64]) -> None:
    positive = frequency_hz[frequency_hz > 0]
    octave_axis(axes[-1], float(positive[0]), float(positive[-1]))
    axes[-1].set_xlabel("Frequency / Hz")


def _legend(figure: Figure, axes: Axes, names: Sequence[str]) -> None:
    if len(names) > _MANY:
        figure.legend(loc="outside right upper", fontsize="x-small", ncols=1 + len(names) // 40)
    else:
        axes.legend(fontsize="small")


def figure_frequency_response(found: FrequencyResponse, *, unwrapped: bool = False) -> Figure:
    """Magnitude with its 95 % band, phase, and a coherence strip under them.

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
    figure, axes = _figure([3, 2, 1] if with_coherence else [3, 2], height=7.5)
    f = found.frequency_hz
    level = found.level_dB
    phase = found.unwrapped_phase_deg if unwrapped else found.phase_deg
    relative = 2 * np.hypot(found.u_magnitude_percent, found.u_common_percent) / 100
    turn = 2 * np.hypot(found.u_phase_deg, found.u_common_phase_deg)
    marker = "." if len(f) < 60 else ""
    low, high = band_about(level, relative)
    for row, (name, style) in enumerate(zip(found.channels, line_styles())):
        line = {**style, "linewidth": 1.0, "marker": marker}
        axes[0].plot(f, level[row], label=name, **line)
        # A wrapped phase gets a gap where it jumps, not a vertical line.
        shown = phase[row] if unwrapped else with_gaps(phase[row])
        axes[1].plot(f, shown, **line)
        band = {"color": style["color"], "alpha": 0.2 if len(level) <= _MANY else 0.05, "linewidth": 0}
        axes[0].fill_between(f, low[row], high[row], **band)
        axes[1].fill_between(f, shown - turn[row], shown + turn[row], **band)
        if with_coherence:
            axes[2].plot(f, found.coherence[row], **{**line, "linewidth": 0.8})
    units = sorted(set(found.units))
    axes[0].set_ylabel("Magnitude / dB re 1 " + ", ".join(units))
    known = np.where(relative <= _KNOWN, level, np.nan)
    axes[0].set_ylim(*_limits(known if np.isfinite(known).any() else level))
    axes[1].set_ylabel("Phase / degrees")
    if not unwrapped:
        axes[1].set_ylim(-190, 190)
        axes[1].set_yticks(range(-180, 181, 90))
    if with_coherence:
        axes[2].set_ylabel("Coherence")
        axes[2].set_ylim(0, 1.05)
    axes[0].set_title(f"{found.label}: {found.estimator} over {found.reference}", fontsize="medium")
    _legend(figure, axes[0], found.channels)
    _frequency_axis(axes, f)
    return figure


def _limits(level: NDArray[np.float64]) -> tuple[float, float]:
    """From the highest level down to the lowest, but no further than the dynamics of a converter."""
    finite = level[np.isfinite(level)]
    if not finite.size:
        return 0.0, 1.0
    top = float(finite.max())
    return max(float(finite.min()), top - _DYNAMICS_DB) - 3, top + 3


def figure_spectrum(found: Spectrum) -> Figure:
    """Levels of every channel, and the phase where there is one."""
    figure, axes = _figure([1] if found.phase_deg is None else [3, 2])
    level = found.level_dB
    for row, (name, style) in enumerate(zip(found.channels, line_styles())):
        axes[0].plot(found.frequency_hz, level[row], label=name, linewidth=1.0, **style)
        if found.phase_deg is not None:
            strong = level[row] > np.nanmax(level[row], initial=-np.inf) - _PHASE_DB
            phase = np.where(strong, found.phase_deg[row], np.nan)
            axes[1].plot(found.frequency_hz, phase, ".", color=style["color"], markersize=3)
    axes[0].set_ylim(*_limits(level))
    axes[0].set_ylabel("Level / " + "; ".join(sorted({found.scale.level_text(u) for u in found.units})))
    if found.phase_deg is not None:
        over = f" over {found.phase_reference}" if found.phase_reference else ""
        axes[1].set_ylabel(f"Phase{over} / degrees\nwithin {_PHASE_DB:.0f} dB of the peak")
        axes[1].set_ylim(-190, 190)
        axes[1].set_yticks(range(-180, 181, 90))
    scale = found.scale
    axes[0].set_title(
        f"{found.label}: {scale.scaling}, {scale.window}, line spacing {scale.line_spacing_hz:.4g} Hz, "
        f"noise bandwidth {scale.enbw_hz:.4g} Hz",
        fontsize="medium",
    )
    _legend(figure, axes[0], found.channels)
    _frequency_axis(axes, found.frequency_hz)
    return figure


def figure_spectrogram(found: Spectrogram) -> Figure:
    """Level against time and frequency, one panel a channel."""
    figure, axes = _figure([1] * len(found.channels), height=1.5 + 2.5 * len(found.channels))
    level = found.level_dB
    positive = found.frequency_hz > 0
    f = found.frequency_hz[positive]
    for row, (name, unit, one) in enumerate(zip(found.channels, found.units, axes)):
        picture = level[row][:, positive].T
        low, high = _limits(picture)
        mesh = one.pcolormesh(
            found.time_s, f, picture, vmin=low, vmax=high, cmap="cividis", shading="nearest", rasterized=True
        )
        octave_axis(one, float(f[0]), float(f[-1]), "y")
        one.set_ylabel(f"{name}\nFrequency / Hz")
        one.grid(False)
        figure.colorbar(mesh, ax=one, label=f"Level / {found.scale.level_text(unit)}")
    axes[0].set_title(
        f"{found.label}: blocks averaged in a column: {found.blocks_per_column}", fontsize="medium"
    )
    axes[-1].set_xlabel("Time / s")
    return figure
