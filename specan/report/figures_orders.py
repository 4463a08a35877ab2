"""Figures of order analyses: spectra, and maps of orders against speed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from specan.data.orders import OrderSpectrum
from specan.report.figure_style import line_styles
from specan.units import level_reference

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_DYNAMICS_DB = 90.0
_MANY = 8  # panels of a map at most


def figure_orders(found: OrderSpectrum) -> Figure:
    """Levels against order, with the given lines and twice their uncertainty on top."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 5.0), layout="constrained")
    axes = figure.add_subplot()
    axes.grid(True, color="0.9")
    level = found.level_dB
    for row, (name, style) in enumerate(zip(found.channels, line_styles())):
        axes.plot(found.order, level[row], label=name, linewidth=0.8, **style)
        if found.lines is not None:
            reference = level_reference(found.units[row]).value
            with np.errstate(divide="ignore", invalid="ignore"):
                size = np.abs(found.lines.amplitude[row])
                line = 20 * np.log10(size / np.sqrt(2) / reference)
            axes.plot(found.lines.order, line, linestyle="", marker="o", markersize=3, color=style["color"])
    finite = level[:, found.order > 0][np.isfinite(level[:, found.order > 0])]
    top = float(finite.max()) if finite.size else 0.0
    axes.set_ylim(max(top - _DYNAMICS_DB, float(finite.min()) - 3 if finite.size else -10), top + 5)
    axes.set_xlim(0.0, float(found.order[-1]))
    axes.set_xlabel("Order of the shaft")
    axes.set_ylabel("Level / dB re " + ", ".join(sorted({level_reference(u).text for u in found.units})))
    axes.set_title(_title(found), fontsize="medium")
    if len(found.channels) > 1:
        axes.legend(fontsize="small", ncols=1 + len(found.channels) // 12)
    return figure


def figure_order_map(found: OrderSpectrum) -> Figure:
    """Levels against order and speed, one panel a channel; columns in the order of speed."""
    from matplotlib.figure import Figure

    count = min(len(found.channels), _MANY)
    figure = Figure(figsize=(9.0, 1.0 + 3.0 * count), layout="constrained")
    axes = figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0]
    place = np.argsort(found.speed_hz, kind="stable")
    speed = found.speed_hz[place]
    for row, one in enumerate(axes):
        picture = found.map_level_dB[place, row][:, found.order > 0]
        finite = picture[np.isfinite(picture)]
        top = float(finite.max()) if finite.size else 0.0
        mesh = one.pcolormesh(
            found.order[found.order > 0],
            speed,
            np.ma.masked_invalid(picture),
            vmin=max(top - _DYNAMICS_DB, float(finite.min()) if finite.size else top - 1.0),
            vmax=top,
            cmap="cividis",
            shading="nearest",
            rasterized=True,
        )
        one.set_ylabel(f"{found.channels[row]}\nSpeed / Hz")
        figure.colorbar(mesh, ax=one, label=f"Level / dB re {level_reference(found.units[row]).text}")
    left_out = len(found.channels) - count
    axes[0].set_title(
        _title(found) + (f"; {left_out} more channels are not drawn" if left_out else ""), fontsize="medium"
    )
    axes[-1].set_xlabel("Order of the shaft")
    return figure


def _title(found: OrderSpectrum) -> str:
    low, mean, high = found.tacho.speed_hz
    speed = f"{mean:.4g} Hz" if high - low < 0.01 * mean else f"{low:.4g} to {high:.4g} Hz"
    return f"{found.label}: orders of a shaft at {speed}, blocks of {found.block_turns} turns"
