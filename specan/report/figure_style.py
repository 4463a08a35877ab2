"""How figures look, and how they are written: the same bytes for the same result."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from specan.errors import RequestError, nearest

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito, Color Universal Design (2008): told apart by every kind of colour vision. Their yellow is left out:
# it is too light for a line on white.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000")
_DASHES = ("-", "--", ":", "-.")
FORMATS = ("png", "svg", "pdf")

_OCTAVES = 1000.0 * 2.0 ** np.arange(-10, 8)
_NOMINAL = (
    "1", "2", "4", "8", "16", "31.5", "63", "125", "250", "500", "1k", "2k", "4k", "8k", "16k", "31.5k", "63k",
    "125k",
)  # fmt: skip


def line_styles() -> Iterator[dict[str, Any]]:
    """Colour and dash of one line after the other; 28 before they repeat."""
    styles = [{"color": colour, "linestyle": dash} for dash in _DASHES for colour in COLOURS]
    return cycle(styles)


def octave_ticks() -> tuple[list[float], tuple[str, ...]]:
    """Frequencies of the ticks of a logarithmic axis, in Hz, and what stands at them."""
    return _OCTAVES.tolist(), _NOMINAL


def octave_axis(axes: Axes, low_hz: float, high_hz: float, which: Literal["x", "y"] = "x") -> None:
    """Logarithmic frequency axis with a tick at each octave."""
    from matplotlib.ticker import NullLocator

    axes.set(**{f"{which}scale": "log", f"{which}lim": (low_hz, high_hz)})
    shown = [(f, text) for f, text in zip(*octave_ticks(), strict=True) if low_hz <= f <= high_hz]
    axis = axes.xaxis if which == "x" else axes.yaxis
    axis.set_ticks([f for f, _ in shown], labels=[text for _, text in shown])
    axis.set_minor_locator(NullLocator())


def with_gaps(phase: NDArray[np.float64]) -> NDArray[np.float64]:
    """A wrapped phase in degrees with a gap where it jumps instead of a vertical line."""
    gapped = phase.copy()
    with np.errstate(invalid="ignore"):
        gapped[1:][np.abs(np.diff(phase)) > 180] = np.nan
    return gapped


def band_about(
    level_dB: NDArray[np.float64], relative: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Levels below and above a level whose magnitude is uncertain by a relative amount; -40 dB of it at the lowest.

    Examples
    --------
    >>> low, high = band_about(np.array([80.0]), np.array([0.1]))
    >>> low.round(2).tolist(), high.round(2).tolist()
    ([79.08], [80.83])
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        return level_dB + 20 * np.log10(np.maximum(1 - relative, 1e-2)), level_dB + 20 * np.log10(
            1 + relative
        )


def figure_format(path: Path) -> str:
    """Format by the suffix of a file, checked before the work is done.

    Raises
    ------
    RequestError
        The suffix is not one of `FORMATS`, or the directory does not exist.

    Examples
    --------
    >>> figure_format(Path("spectrum.SVG"))
    'svg'
    """
    kind = path.suffix.lower().lstrip(".")
    if kind not in FORMATS:
        raise RequestError(
            f"a figure cannot be written as {path.name!r}",
            expected="a name that ends in ." + ", .".join(FORMATS),
            remedy=nearest(kind, FORMATS) if kind else "",
        )
    if not path.absolute().parent.is_dir():
        raise RequestError(f"the directory of {path} does not exist", remedy="make it, or choose another")
    return kind


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure as PNG, SVG or PDF; without a clock time, so that results can be compared.

    Raises
    ------
    RequestError
        The suffix is unknown, or the file cannot be written.
    """
    import matplotlib
    from matplotlib.text import Text

    from specan import __version__
    from specan.io.output_file import whole_file

    kind = figure_format(path)
    maker = f"specan {__version__}"
    about = {
        "png": {"Software": maker},
        "svg": {"Creator": maker, "Date": None},
        "pdf": {"Creator": maker, "CreationDate": None},
    }
    for text in figure.findobj(Text):
        text.set_text(text.get_text().encode("utf-8", "backslashreplace").decode("utf-8"))
    with whole_file(path) as half, matplotlib.rc_context({"svg.hashsalt": "specan"}):
        figure.savefig(half, format=kind, dpi=150, metadata=about[kind])
