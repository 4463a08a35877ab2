"""Figures of spectra, spectrograms, transfer functions and orders, as what they show."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from specan.arrays import Real
from specan.data.frequency_response import FrequencyResponse
from specan.data.levels import decibels, rms_level
from specan.data.limits import LimitCurve
from specan.data.orders import OrderSpectrum
from specan.data.spectrum import ShockResponse, Spectrogram, Spectrum, SpectrumScale
from specan.data.tone import ToneTable
from specan.report.figure_style import band_about, level_label, with_gaps
from specan.report.panels import FEW, Curve, Drawing, Panel, Picture, grouped, level_panels, with_bounds
from specan.result import counted
from specan.units import level_reference, printed_unit

_DYNAMICS_DB = 100.0  # that a figure shows at most
_PICTURE_DB = 60.0  # that colours show: more would hide what differs by a few
_ORDERS_DB = 90.0
_PHASE_DB = 40.0  # below its highest line a spectrum's phase is not drawn
_KNOWN = 0.5  # relative uncertainty of a magnitude up to which it sets the limits of the axis
_MOST_MAPS = 8


def figure_frequency_response(found: FrequencyResponse, *, unwrapped: bool = False) -> Drawing:
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
    f, level = found.frequency_hz, found.level_dB
    relative = 2 * found.u_total_percent / 100
    known = np.where(relative <= _KNOWN, level, np.nan)
    low, high = band_about(level, relative)
    labels = [f"Magnitude / dB re 1 {unit}" for unit in found.units]
    panels = level_panels(labels, found.channels, f, level, _DYNAMICS_DB, decisive=known, low=low, high=high)
    # A wrapped phase gets a gap where it jumps, not a vertical line.
    phases = found.unwrapped_phase_deg if unwrapped else np.array([with_gaps(row) for row in found.phase_deg])
    turn = 2 * found.u_total_phase_deg
    named = list(zip(found.channels, phases, turn, found.coherence, strict=True))
    curves = tuple(Curve(name, f, phase, phase - reach, phase + reach) for name, phase, reach, _ in named)
    panels.append(Panel("Phase / degrees", curves, share=2, leads=False, phase=not unwrapped, kind="thin"))
    if np.isfinite(found.coherence).any():
        curves = tuple(Curve(name, f, coherence) for name, *_, coherence in named)
        panels.append(Panel("Coherence", curves, (0.0, 1.05), share=1, leads=False))
    facts = f"{found.estimator} over {found.reference}", _worth(found, relative)
    return Drawing(found.label or "Transfer functions", facts, "Frequency / Hz", tuple(panels), hertz=True)


def _worth(found: FrequencyResponse, relative: Real) -> str:
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


def figure_spectrum(found: Spectrum, *, limits: LimitCurve | None = None) -> Drawing:
    """Levels of every channel, one pair of axes a level reference, their limits, and the phase where there is one."""
    level, f, scale = found.level_dB, found.frequency_hz, found.scale
    labels = [f"Level / {printed_unit(scale.level_text(unit))}" for unit in found.units]
    panels = level_panels(labels, found.channels, f, level, _DYNAMICS_DB)
    if limits is not None:
        panels = with_bounds(panels, limits.label, f, limits.at_lines(f))
    if found.phase_deg is not None:
        strong = level > np.nanmax(level, axis=1, initial=-np.inf)[:, None] - _PHASE_DB
        phases = np.where(strong, found.phase_deg, np.nan)
        over = f" over {found.phase_reference}" if found.phase_reference else ""
        label = f"Phase{over}\n/ degrees"
        curves = tuple(Curve(name, f, phase) for name, phase in zip(found.channels, phases, strict=True))
        panels.append(Panel(label, curves, share=2, leads=False, phase=True, kind="dots"))
    about = f"{_said(scale)}, {found.averaging} averaging of {counted(found.n_blocks, 'block')}"
    facts = [about, _strongest(found)]
    if found.phase_deg is not None:
        facts.append(f"Phases of lines within {_PHASE_DB:.0f} dB of the highest")
    return Drawing(found.label or "Spectrum", tuple(facts), "Frequency / Hz", tuple(panels), hertz=True)


def _said(scale: SpectrumScale) -> str:
    """What a line is, in words."""
    return (
        f"{scale.scaling.replace('psd', 'power spectral density')}, {scale.window} window, line spacing "
        f"{scale.line_spacing_hz:.4g} Hz, noise bandwidth {scale.enbw_hz:.4g} Hz"
    )


def _strongest(found: Spectrum) -> str:
    """Highest line of each level reference."""
    level = np.where((found.frequency_hz > 0) & np.isfinite(found.level_dB), found.level_dB, -np.inf)
    texts = []
    for text, rows in grouped(found.scale.level_text(u) for u in found.units).items():
        row, line = np.unravel_index(int(np.argmax(level[rows])), level[rows].shape)
        if np.isfinite(level[rows][row, line]):
            name, hertz = found.channels[rows[int(row)]], found.frequency_hz[line]
            texts.append(f"{name} {level[rows][row, line]:.1f} {printed_unit(text)} at {hertz:.5g} Hz")
    return "Highest line: " + "; ".join(texts) if texts else ""


def figure_spectrogram(found: Spectrogram) -> Drawing:
    """Level against time and frequency, one panel a channel."""
    scale, positive = found.scale, found.frequency_hz > 0
    pictures = [
        Picture(name, found.time_s, found.frequency_hz[positive], level[:, positive].T, "Frequency / Hz",
                f"Level / {printed_unit(scale.level_text(unit))}", hertz=True)
        for name, unit, level in zip(found.channels, found.units, found.level_dB, strict=True)
    ]  # fmt: skip
    about = f"{_said(scale)}, {counted(found.blocks_per_column, 'block')} per column"
    return Drawing(
        found.label or "Spectrogram", (about,), "Time / s", pictures=tuple(pictures), dynamics_dB=_PICTURE_DB,
    )  # fmt: skip


def figure_shock_response(found: ShockResponse) -> Drawing:
    """Maximax over the natural frequency, both logarithmic, one pair of axes a unit."""
    labels = [printed_unit(f"Maximax / {unit}") for unit in found.units]
    panels = level_panels(labels, found.channels, found.frequency_hz, decibels(found.maximax), _DYNAMICS_DB)
    panels = [replace(panel, amplitude=True) for panel in panels]
    facts = (f"shock response, {found.response}, Q {found.quality:g}",)
    return Drawing(
        found.label or "Shock response", facts, "Natural frequency / Hz", tuple(panels), hertz=True
    )


def figure_tone(found: ToneTable) -> Drawing:
    """Levels of the harmonics over the fundamental of each channel."""
    with np.errstate(invalid="ignore", divide="ignore"):  # a channel without the tone has no levels
        level = decibels(found.harmonics_rms / found.harmonics_rms[:, :1])
    number = np.arange(1.0, level.shape[1] + 1.0)
    curves = (Curve(name, number, one) for name, one in zip(found.channels, level, strict=True))
    limits = float(np.nanmin(np.where(np.isfinite(level), level, 0.0))) - 10.0, 10.0
    panel = Panel("Level re fundamental / dB", tuple(curves), limits, share=6, kind="rows")
    worst = int(np.argmax(np.nan_to_num(found.thd_percent)))
    facts = (
        f"{found.frequency_hz:.6g} Hz",
        f"THD at most {found.thd_percent[worst]:.3g} %: {found.channels[worst]}",
        "Grey: the other channels" if len(found.channels) > FEW else "",
    )
    ends = 0.5, number[-1] + 0.5
    return Drawing(found.label or "Tone", facts, "Number of the harmonic", (panel,), x_limits=ends)


def figure_orders(found: OrderSpectrum) -> Drawing:
    """Levels against order, with the given lines as dots; one pair of axes a level reference."""
    labels = [level_label(level_reference(unit).text) for unit in found.units]
    more: dict[str, Any] = {}
    if (lines := found.lines) is not None:
        rms = np.abs(lines.amplitude) / np.sqrt(2)
        more["dots"] = [(lines.order, one) for one in rms_level(rms, found.units)]
    order, level = found.order[found.order > 0], found.level_dB[:, found.order > 0]
    panels = level_panels(labels, found.channels, order, level, _ORDERS_DB, **more)
    facts = _about_orders(found), "Dots: the requested lines" if found.lines else ""
    return Drawing(found.label, facts, "Order of the shaft", tuple(panels))


def figure_order_map(found: OrderSpectrum) -> Drawing:
    """Levels against order and speed, one panel a channel; at a steady speed against time."""
    steady = found.tacho.drift_percent < 1.0
    over = found.time_s if steady else found.speed_hz
    place, positive = np.argsort(over, kind="stable"), found.order > 0
    pictures = [
        Picture(name, found.order[positive], over[place], found.map_level_dB[place, row][:, positive],
                "Time / s" if steady else "Speed / Hz", level_label(level_reference(unit).text))
        for row, (name, unit) in enumerate(zip(found.channels[:_MOST_MAPS], found.units, strict=False))
    ]  # fmt: skip
    left_out = len(found.channels) - len(pictures)
    more = f"{counted(left_out, 'more channel')} not drawn" if left_out else ""
    facts = _about_orders(found), more
    return Drawing(found.label, facts, "Order of the shaft", pictures=tuple(pictures), dynamics_dB=_ORDERS_DB)


def _about_orders(found: OrderSpectrum) -> str:
    low, mean, high = found.tacho.speed_hz
    speed = f"{mean:.4g} Hz" if high - low < 0.01 * mean else f"{low:.4g} to {high:.4g} Hz"
    source = f"by {found.tacho.channel}" if found.tacho.channel else "as stated"
    turns = counted(found.turns, "turn")
    return f"Shaft at {speed} {source}, {turns}, blocks of {counted(found.block_turns, 'turn')}"
