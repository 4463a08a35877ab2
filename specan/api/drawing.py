"""Figures of results."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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
    from specan.report.figures import figure_of

    figure = figure_of(result, view, **options)
    if path is not None:
        from specan.report.figure_style import save_figure

        save_figure(figure, Path(path))
    return figure
