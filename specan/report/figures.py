"""Which function draws which result."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from specan.errors import RequestError
from specan.report import figure_style
from specan.report.panels import Drawing, figure_of_panels

# Of installed packages: class = function, or class.view, of a comparison with a model class.model.
ENTRY_POINTS = "specan.figures"
# class, and the view of it -> where its figure is drawn; by name, so that the class is not loaded.
FIGURES = {
    "Recording": "specan.report.figures_waveforms:figure_waveforms",
    "BandLevels": "specan.report.figures_bands:figure_band_levels",
    "BandLevels history": "specan.report.figures_bands:figure_level_history",
    "Spectrum": "specan.report.figures_spectra:figure_spectrum",
    "Spectrogram": "specan.report.figures_spectra:figure_spectrogram",
    "FrequencyResponse": "specan.report.figures_spectra:figure_frequency_response",
    "ShockResponse": "specan.report.figures_spectra:figure_shock_response",
    "ToneTable": "specan.report.figures_spectra:figure_tone",
    "SignalLevels": "specan.report.figures_bands:figure_levels",
    "OrderSpectrum": "specan.report.figures_spectra:figure_orders",
    "OrderSpectrum map": "specan.report.figures_spectra:figure_order_map",
    "ImpulseResponses": "specan.report.figures_waveforms:figure_impulse_responses",
    "DecayTimes": "specan.report.figures_bands:figure_decay",
    "Calibration": "specan.report.figures_calibration:figure_calibration",
    "Comparison": "specan.report.figures_study:figure_comparison",
    "NextMeasurements": "specan.report.figures_steps:figure_next",
    "Change": "specan.report.figures_steps:figure_change",
    "History": "specan.report.figures_steps:figure_history",
    "Diagnosis": "specan.report.figures_steps:figure_diagnosis",
}


def plot(result: Any, path: str | Path | None = None, *, view: str = "", **options: Any) -> Figure:
    """Draw a result as ``--plot`` of its verb does.

    Parameters
    ----------
    result : Recording, or a result of specan
        What to draw.
    path : str or Path, optional
        Also save it there: .png, .svg or .pdf.
    view : str, optional
        ``history`` of band levels against time, ``map`` of orders against speed.
    **options
        Of the figure: ``channels``, ``start_s`` and ``stop_s`` of waveforms, ``unwrapped`` of transfer functions.

    Returns
    -------
    matplotlib.figure.Figure
        Not shown; that is up to the caller.

    Raises
    ------
    RequestError
        There is no figure of it.
    """
    figure = figure_of(result, view, **options)
    if path is not None:
        figure_style.save_figure(figure, Path(path))
    return figure


def description_of(result: Any, view: str = "", **options: Any) -> Any:
    """What the figure of a result shows, as panels or pictures; of some results the figure itself.

    Raises
    ------
    RequestError
        There is none.
    """
    kinds = [f"{kind.__name__} {view}".rstrip() for kind in type(result).__mro__]
    draw = next(filter(None, map(figure_named, kinds)), None)
    if draw is None:
        raise RequestError(
            f"there is no figure of a {kinds[0]}",
            expected="one of " + ", ".join(FIGURES),
            remedy="use its data frame",
        )
    return draw(result, **options)


def figure_of(result: Any, view: str = "", **options: Any) -> Figure:
    """The figure of a result; see `description_of`."""
    drawn = description_of(result, view, **options)
    figure = figure_of_panels(drawn) if isinstance(drawn, Drawing) else drawn
    if said := getattr(result, "settings", {}).get("calibration"):
        figure_style.remark(figure, f"Calibration: {said}")
    return figure


def figure_named(kind: str) -> Callable[..., Any] | None:
    """What draws a class, or a view of it: here, or of an installed package."""
    own = {point.name.replace(".", " "): point.value for point in entry_points(group=ENTRY_POINTS)}
    place = FIGURES.get(kind) or own.get(kind)
    if place is None:
        return None
    module, _, function = place.partition(":")
    draw: Callable[..., Any] = getattr(importlib.import_module(module), function)
    return draw
