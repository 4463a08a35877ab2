"""Which function draws which result."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from specan.errors import RequestError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# class, and the view of it -> where its figure is drawn; by name, so that neither matplotlib nor the class is loaded.
FIGURES = {
    "Recording": "specan.report.figures_waveforms:figure_waveforms",
    "BandLevels": "specan.report.figures_bands:figure_band_levels",
    "BandLevels history": "specan.report.figures_bands:figure_level_history",
    "Spectrum": "specan.report.figures_spectra:figure_spectrum",
    "Spectrogram": "specan.report.figures_spectra:figure_spectrogram",
    "FrequencyResponse": "specan.report.figures_spectra:figure_frequency_response",
    "SignalLevels": "specan.report.figures_bands:figure_levels",
    "OrderSpectrum": "specan.report.figures_orders:figure_orders",
    "OrderSpectrum map": "specan.report.figures_orders:figure_order_map",
    "ImpulseResponses": "specan.report.figures_waveforms:figure_impulse_responses",
    "DecayTimes": "specan.report.figures_bands:figure_decay",
    "Calibration": "specan.report.figures_calibration:figure_calibration",
    "Comparison": "specan.report.figures_study:figure_of_comparison",
    "NextMeasurements": "specan.report.figures_diagnosis:figure_next",
    "Change": "specan.report.figures_change:figure_change",
    "History": "specan.report.figures_change:figure_history",
    "Impedance": "specan.report.figures_room:figure_impedance",
    "Diagnosis": "specan.report.figures_diagnosis:figure_diagnosis",
}


def figure_of(result: Any, view: str = "", **options: Any) -> Figure:
    """The figure of a result.

    Raises
    ------
    RequestError
        There is none.
    """
    kinds = [f"{kind.__name__} {view}".rstrip() for kind in type(result).__mro__]
    name = next((kind for kind in kinds if kind in FIGURES), None)
    if name is None:
        raise RequestError(
            f"there is no figure of a {kinds[0]}",
            expected="one of " + ", ".join(FIGURES),
            remedy="use its data frame",
        )
    module, _, function = FIGURES[name].partition(":")
    figure: Figure = getattr(importlib.import_module(module), function)(result, **options)
    return figure
