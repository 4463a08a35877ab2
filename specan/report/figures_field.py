"""Level and phase of a room's sound field on a plane, with the microphones on top."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from specan.models.room.field_map import FieldMap
from specan.report.figure_style import heading, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NEAR_M = 0.05  # microphones nearer to the plane than this are drawn filled
_FINER = 6  # points of the picture for one of the map, along each axis
_DEPTH_DB = 50.0  # below the loudest point the colours end


@styled
def field_figure(found: FieldMap) -> Figure:
    """Two maps side by side.

    Colours run from dark to light with the level (cividis, the same for every kind of colour vision) and round a circle
    of lightness and hue with the phase (twilight).
    """
    first, second = found.first_m[-1], found.second_m[-1]
    height = float(np.clip(4.0 * second / first, 2.0, 5.6)) + 1.2
    sheet = new_figure(height, 10.6)
    axes = sheet.subplots(1, 2, sharey=True)
    found = _finer(found)
    level, phase = found.level_dB(), found.phase_deg
    top = float(np.max(level))
    maps = (
        (
            level,
            "cividis",
            max(top - _DEPTH_DB, float(np.min(level))),
            top,
            "Level at 1 mm/s RMS / dB re 20 µPa",
        ),
        (phase, "twilight", -180.0, 180.0, "Phase over the velocity / degrees"),
    )
    for place, (values, colours, low, high, text) in zip(axes, maps, strict=True):
        drawn = place.pcolormesh(
            found.first_m,
            found.second_m,
            values.T,
            cmap=colours,
            vmin=low,
            vmax=high,
            shading="nearest",
            rasterized=True,
        )
        bar = sheet.colorbar(drawn, ax=place, label=text)
        if colours == "twilight":
            bar.set_ticks([-180, -90, 0, 90, 180])
        place.grid(False)
        _microphones(place, found)
        place.set(xlabel=f"{found.along[0]} / m", aspect="equal", xlim=(0.0, first), ylim=(0.0, second))
    axes[0].set_ylabel(f"{found.along[1]} / m")
    heading(
        sheet, f"Sound pressure over the diaphragm's velocity at {found.frequency_hz:g} Hz",
        f"Plane {found.axis} = {found.at_m:g} m. White: microphones within {100 * NEAR_M:g} cm of it.",
    )  # fmt: skip
    return sheet


def _finer(found: FieldMap) -> FieldMap:
    """The field between the points, by splines through real and imaginary part: phases have jumps, these have none."""
    from scipy.interpolate import RectBivariateSpline

    axes = [np.linspace(a[0], a[-1], _FINER * (len(a) - 1) + 1) for a in (found.first_m, found.second_m)]
    parts = [
        RectBivariateSpline(found.first_m, found.second_m, part)(*axes)
        for part in (found.response.real, found.response.imag)
    ]
    return replace(found, first_m=axes[0], second_m=axes[1], response=parts[0] + 1j * parts[1])


def _microphones(place: Axes, found: FieldMap) -> None:
    """Filled where a microphone is near the plane, hollow where it is elsewhere."""
    columns = ["xyz".index(name) for name in found.along]
    away = np.abs(found.microphone_m[:, "xyz".index(found.axis)] - found.at_m)
    for name, point, far in zip(found.names, found.microphone_m[:, columns], away, strict=True):
        place.plot(
            *point, "o", markersize=7, markeredgecolor="black", markerfacecolor="white" if far <= NEAR_M else "none",
            markeredgewidth=1.2, clip_on=False,
        )  # fmt: skip
        place.annotate(
            name.removeprefix("Mic "), point, xytext=(5, 5), textcoords="offset points", fontsize=8, color="black",
            bbox={"boxstyle": "round,pad=0.12", "facecolor": "white", "edgecolor": "none", "alpha": 0.75},
        )  # fmt: skip
