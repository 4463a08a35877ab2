"""How figures look, how many channels share one pair of axes, and how figures are written."""

from __future__ import annotations

import functools
import io
import textwrap
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Annotation, Text
from matplotlib.ticker import NullLocator

from specan.arrays import Real
from specan.errors import RequestError
from specan.units import printed_unit

# Okabe and Ito, Color Universal Design (2008): distinguished by every kind of colour vision. Their yellow is left out:
# it is too light for a line on white.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000")
_DASHES = ("-", "--", ":", "-.")
FORMATS = ("png", "svg", "pdf")
GREY = "0.45"  # of secondary text and of lines that give context
WIDTH = 8.4  # inches; on paper three quarters of it

# Every figure has these settings, whatever the user's own are.
STYLE = Path(__file__).with_name("figures.mplstyle")


def styled(draw: Callable[..., Figure]) -> Callable[..., Figure]:
    """Decorator: draw a figure in specan's style. The user's own matplotlib settings stay as they are."""

    @functools.wraps(draw)
    def drawn(*args: Any, **kwargs: Any) -> Figure:
        with mpl.rc_context(fname=STYLE):
            return draw(*args, **kwargs)

    return drawn


def new_figure(height: float, width: float = WIDTH) -> Figure:
    """An empty figure of some inches, without a window and without pyplot's global state."""
    return Figure(figsize=(width, height), layout="constrained")


def heading(figure: Any, title: str, *facts: str) -> None:
    """Title at the top left in bold; settings and result below it in grey, folded to the figure's width."""
    width = float(figure.get_size_inches()[0])
    bold = textwrap.wrap(title, int(12.5 * width)) or [""]
    plain = [line for fact in facts if fact for line in textwrap.wrap(fact, int(15.5 * width))]
    # The blank lines keep the room for the grey ones, which hang from the title's box.
    whole = "\n".join([*bold, *("" for _ in plain)]) + (" " if plain else "")
    top = figure.suptitle(whole, x=0.012, ha="left", fontsize=10, fontweight="bold", linespacing=1.25)
    if plain:
        figure.add_artist(
            Annotation(
                "\n".join(plain), (0, 0), xycoords=top, ha="left", va="bottom", fontsize=8, color=GREY,
                linespacing=1.4, annotation_clip=False,
            )
        )  # fmt: skip


def remark(figure: Figure, text: str) -> None:
    """A line in grey at the top right, where no legend is."""
    figure.text(0.99, 0.992, text, ha="right", va="top", fontsize=7, color=GREY)


def name_rows(axes: Axes, names: Sequence[str]) -> None:
    """Names down the side, the first at the top, for what is drawn at 0, 1, 2 ... upwards."""
    axes.set_yticks(range(len(names)), list(names))
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.grid(False, axis="y")


_BELOW, _ABOVE = 6, 7  # columns of a legend at most


def legend_below(figure: Figure, axes: Axes, most: int = _BELOW, title: str | None = None) -> None:
    """Legend of some axes under the figure, where it covers nothing; in columns that fit the width."""
    handles, labels = axes.get_legend_handles_labels()
    known = dict(zip(labels, handles, strict=True))
    if known:
        ncols = _columns(list(known), float(figure.get_size_inches()[0]), most)
        figure.legend(list(known.values()), list(known), loc="outside lower center", ncols=ncols, title=title)


def legend_above(axes: Axes) -> None:
    """Legend between the top of some axes and their title, where it covers no line."""
    labels = axes.get_legend_handles_labels()[1]
    if labels:
        width = axes.get_position().width * float(axes.figure.get_size_inches()[0])  # type: ignore[union-attr]
        axes.legend(
            loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=_columns(labels, width, _ABOVE),
            borderaxespad=0.1, columnspacing=1.2,
        )  # fmt: skip


def _columns(labels: list[str], inches: float, most: int) -> int:
    """Columns of a legend: all in one row if they fit; a character takes 1/15 inch, a handle seven characters."""
    room = 15 * inches
    if sum(len(label) + 7 for label in labels) <= room:
        return len(labels)
    return max(min(int(room / (max(map(len, labels)) + 7)), most), 1)


def level_label(reference: str) -> str:
    """Label of a level axis with what 0 dB is.

    Examples
    --------
    >>> level_label("20 uPa")
    'Level / dB re 20 µPa'
    """
    return printed_unit(f"Level / dB re {reference}")


# Ticks of a logarithmic axis of frequency, in Hz, and what is at them.
OCTAVES = (1000.0 * 2.0 ** np.arange(-10, 8)).tolist()
OCTAVE_NAMES = (
    "1", "2", "4", "8", "16", "31.5", "63", "125", "250", "500", "1k", "2k", "4k", "8k", "16k", "31.5k", "63k",
    "125k",
)  # fmt: skip


def style_of(number: int, full: bool = False) -> dict[str, Any]:
    """Colour and dash of a line by its number; 28 before they repeat. Beside a range each line is full."""
    dash = "-" if full else _DASHES[number // len(COLOURS) % len(_DASHES)]
    return {"color": COLOURS[number % len(COLOURS)], "linestyle": dash}


def octave_axis(axes: Axes, low_hz: float, high_hz: float, which: Literal["x", "y"] = "x") -> None:
    """Logarithmic frequency axis with a tick at each octave."""
    axes.set(**{f"{which}scale": "log", f"{which}lim": (low_hz, high_hz)})
    shown = [(f, text) for f, text in zip(OCTAVES, OCTAVE_NAMES, strict=True) if low_hz <= f <= high_hz]
    axis = axes.xaxis if which == "x" else axes.yaxis
    axis.set_ticks([f for f, _ in shown], labels=[text for _, text in shown])
    axis.set_minor_locator(NullLocator())


def level_limits(
    level: Real, dynamics_dB: float, below: float = 3.0, above: float = 3.0
) -> tuple[float, float]:
    """From the highest level down to the lowest, but no further than `dynamics_dB`, with margins."""
    finite = level[np.isfinite(level)]
    if not finite.size:
        return 0.0, 1.0
    top = float(finite.max())
    return max(float(finite.min()), top - dynamics_dB) - below, top + above


def with_gaps(phase: Real) -> Real:
    """A wrapped phase in degrees with a gap where it jumps instead of a vertical line."""
    gapped = phase.copy()
    with np.errstate(invalid="ignore"):
        gapped[1:][np.abs(np.diff(phase)) > 180] = np.nan
    return gapped


def band_about(level_dB: Real, relative: Real) -> tuple[Real, Real]:
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
    """Format by the suffix of a file; PNG where it has none, such as standard output, ``-``.

    Raises
    ------
    RequestError
        The suffix is not one of `FORMATS`.

    Examples
    --------
    >>> figure_format(Path("spectrum.SVG"))
    'svg'
    """
    kind = path.suffix.lower().lstrip(".") or "png"
    if kind not in FORMATS:
        raise RequestError(
            f"a figure cannot be written as {path.name!r}",
            expected="a name that ends in ." + ", .".join(FORMATS),
        )
    return kind


def image(figure: Figure, kind: str, dpi: int = 150) -> bytes:
    """A figure in a format, as it lies inside a page or is handed to a browser."""
    stream = io.BytesIO()
    figure.savefig(stream, format=kind, dpi=dpi)
    return stream.getvalue()


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure as PNG, SVG or PDF; without a clock time, so that results can be compared.

    Raises
    ------
    RequestError
        The suffix is unknown, or the file cannot be written.
    """
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
    with whole_file(path) as half, mpl.rc_context(fname=STYLE):
        figure.savefig(half, format=kind, dpi=150, metadata=about[kind])
