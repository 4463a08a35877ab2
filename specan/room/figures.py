"""Figures of a room: its walls, where the model of its sound field fails, and the field on a plane."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from specan.report import figure_style
from specan.report.figures_study import measured_transfer, response_drawing
from specan.report.panels import draw_panels
from specan.report.residual_map import axis_text
from specan.report.study_sheets import state_of
from specan.room.model.field_map import FieldMap
from specan.room.model.places import receivers_of
from specan.room.wall_impedance.surface_impedance import ALL, Impedance
from specan.study.localisation.by_band_and_channel import FrfErrors
from specan.study.study import Study

_LEAST_SCALE_DB = 1.0


@figure_style.styled
def figure_impedance(found: Impedance) -> Figure:
    """Absorption coefficient, and real and imaginary part of Z/(rho c), of every wall with 95 % intervals.

    What the positions do not determine is drawn pale: as an upper limit of the absorption, and not at all
    as an impedance.
    """
    walls = found.walls
    figure = figure_style.new_figure(6.2, max(5.6, 1.0 + 1.7 * len(walls)))
    grid = figure.subplots(3, len(walls), squeeze=False, sharex="col", sharey="row")
    for column, wall in enumerate(walls):
        rows = found.of(wall)
        for axes, name in zip(grid[:, column], ("absorption_normal", "resistance", "reactance"), strict=True):
            _bars(axes, rows, name)
        grid[0, column].set_title(f"Wall {wall}")
        grid[2, column].set_xlabel("Frequency / Hz")
        figure_style.octave_axis(grid[2, column], rows["mid_hz"].min() / 1.15, rows["mid_hz"].max() * 1.15)
    grid[0, 0].set(ylabel="Absorption coefficient,\nnormal incidence", ylim=(0, 1))
    grid[1, 0].set(ylabel="Re Z / (rho c)", yscale="log")
    grid[2, 0].set(ylabel="Im Z / (rho c)", yscale="symlog")
    for axes in (grid[1, 0], grid[2, 0]):
        axes.yaxis.set_major_formatter("{x:g}")
    figure.align_ylabels(grid[:, 0])
    mean = found.of(ALL)
    if len(mean):
        for axes in grid[0]:
            axes.plot(mean["mid_hz"], mean["absorption_normal"], ":", color="0.4", lw=1, label="all walls")
    known = found.table["determined"][found.table["wall"] != ALL]
    figure_style.heading(
        figure, "Surface impedance of the walls",
        f"{known.sum()} of {known.size} bands are determined. Bars: 95 % intervals; pale: upper limit only, not "
        "determined. Dotted: all walls together.",
    )  # fmt: skip
    return figure


def _bars(axes: Axes, rows: pd.DataFrame, name: str) -> None:
    """Intervals with their values; of what is not determined the absorption alone, pale and without a value."""
    absorption = name == "absorption_normal"
    style: dict[str, Any] = {"color": figure_style.COLOURS[0 if absorption else 1]}
    for mid_hz, known, value, *ends in rows[
        ["mid_hz", "determined", name, f"{name}_low", f"{name}_high"]
    ].to_numpy():
        if not (known or absorption) or not np.all(np.isfinite(ends)):
            continue
        axes.plot([mid_hz] * 2, ends, lw=3, solid_capstyle="butt", alpha=1.0 if known else 0.3, **style)
        if known:
            axes.plot(mid_hz, value, "o", ms=4, **style)


@figure_style.styled
def figure_errors(study: Study, errors: FrfErrors, shown: int) -> Figure:
    """Level error by third octave and microphone, on a plan of the microphones, and one microphone's curves.

    A dot marks an error of more than two standard uncertainties. On the plan a microphone's colour is its
    level error in the third octave that is furthest off over all microphones.

    Parameters
    ----------
    shown : int
        Number of the microphone whose magnitude and phase are drawn.
    """
    figure = figure_style.new_figure(7.0, 10.6)
    panels = figure.subplot_mosaic([["map", "plan", "side"], ["level", "level", "level"], ["phase", "phase", "phase"]],
                                   width_ratios=[1.6, 1, 1], height_ratios=[2, 1.2, 1])  # fmt: skip
    clear = np.abs(errors.level_dB) > 2 * errors.u_level_dB
    reach = max(_LEAST_SCALE_DB, float(np.nanquantile(np.abs(errors.level_dB), 0.98)))
    axes = panels["map"]
    image = axes.imshow(-errors.level_dB, cmap="PuOr_r", vmin=-reach, vmax=reach, aspect="auto")
    mic, third = np.nonzero(clear)
    axes.plot(third, mic, ".", color="k", ms=3)
    axes.grid(False)
    axes.set_yticks(range(len(errors.channels)), errors.channels)
    axes.set_xticks(range(len(errors.bands)), errors.band_texts, rotation=60)
    axes.set(xlabel=axis_text("third", {"third": errors.third}))
    figure.colorbar(image, ax=axes, label="Measured - model / dB")
    band = errors.worst_band
    receivers = receivers_of(study.model)
    places = receivers.positions_m
    dims = places.max(axis=0) if receivers.box is None else np.array(receivers.box)
    colours: dict[str, Any] = {"cmap": "PuOr_r", "vmin": -reach, "vmax": reach, "edgecolors": "0.3"}
    for name, seen in (("plan", [0, 1]), ("side", [0, 2])):
        axes = panels[name]
        across, up = places[:, seen].T
        axes.scatter(across, up, c=-errors.level_dB[:, band], s=60, **colours)
        axes.plot(across[shown], up[shown], "s", ms=13, mfc="none", color="k")
        axes.set(xlim=(0, dims[seen[0]]), ylim=(0, dims[seen[1]]), aspect="equal")
        axes.set(xlabel=f"{'xyz'[seen[0]]} / m", ylabel=f"{'xyz'[seen[1]]} / m")
    _curves(panels["level"], panels["phase"], study, errors, shown)
    figure.align_ylabels([panels["level"], panels["phase"]])
    figure_style.heading(
        figure, f"{study.directory.resolve().name}, {errors.recording}: where the model fails", *state_of(study),
        f"Dots: more than two standard uncertainties. Plans: third octave of {errors.bands[band]:g} Hz, with the "
        f"largest error; square: {errors.channels[shown]}, whose curves are below.",
    )  # fmt: skip
    return figure


def _curves(level: Axes, phase: Axes, study: Study, errors: FrfErrors, shown: int) -> None:
    """Magnitude and phase of one microphone, measured with its 95 % band and the model's."""
    number = [o.name for o in study.problem.observations].index(errors.recording)
    observation = study.problem.observations[number]
    predicted = study.problem.plain(study.shown.theta)[number]
    found = measured_transfer(observation, predicted)  # type: ignore[arg-type]
    drawing = response_drawing(found, shown, study.model.observables["frf"].unit)
    draw_panels([level, phase], drawing.panels[:2])
    level.set_ylabel(drawing.panels[0].label.replace("Magnitude", "|H|"))
    figure_style.legend_above(level)
    phase.set_xlabel(drawing.x_label)
    for axes in (level, phase):
        figure_style.octave_axis(axes, *drawing.span)
    level.tick_params(labelbottom=False)


NEAR_M = 0.05  # microphones nearer to the plane than this are drawn filled
_FINER = 6  # points of the picture for one of the map, along each axis
_DEPTH_DB = 50.0  # below the loudest point the colours end


@figure_style.styled
def field_figure(found: FieldMap) -> Figure:
    """Two maps side by side.

    Colours run from dark to light with the level (cividis, the same for every kind of colour vision) and round a circle
    of lightness and hue with the phase (twilight).
    """
    first, second = found.first_m[-1], found.second_m[-1]
    height = float(np.clip(4.0 * second / first, 2.0, 5.6)) + 1.2
    sheet = figure_style.new_figure(height, 10.6)
    axes = sheet.subplots(1, 2, sharey=True)
    found = _finer(found)
    level, phase = found.level_dB, found.phase_deg
    top = float(np.max(level))
    least = max(top - _DEPTH_DB, float(np.min(level)))
    maps = (
        (level, "cividis", (least, top), None, "Level at 1 mm/s RMS / dB re 20 µPa"),
        (phase, "twilight", (-180.0, 180.0), [-180, -90, 0, 90, 180], "Phase over the velocity / degrees"),
    )
    for place, (values, colours, limits, ticks, text) in zip(axes, maps, strict=True):
        style: dict[str, Any] = {"cmap": colours, "shading": "nearest", "rasterized": True}
        drawn = place.pcolormesh(found.first_m, found.second_m, values.T, **style)
        drawn.set_clim(*limits)
        sheet.colorbar(drawn, ax=place, label=text, ticks=ticks)
        place.grid(False)
        _microphones(place, found)
        place.set(xlabel=f"{found.along[0]} / m", aspect="equal", xlim=(0.0, first), ylim=(0.0, second))
    axes[0].set_ylabel(f"{found.along[1]} / m")
    figure_style.heading(
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
