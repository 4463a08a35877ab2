"""``specan octave``: band levels of one recording."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from specan_cli.options import FRACTIONS, limit_option, velocity_option, weighting_option
from specan_cli.output import plot_option, table
from specan_cli.recording_verb import (
    Delivery,
    Source,
    given,
    quantity_option,
    recording_verb,
    section_options,
)

if TYPE_CHECKING:
    from specan.data.band_levels import BandLevels
    from specan.data.limits import Kept
    from specan.units import Quantity

_WIDE = 6  # channels that stand side by side in a table


class _Averaging(click.ParamType):
    name = "averaging"

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        """A name, or a time constant."""
        if value in ("linear", "fast", "slow", "impulse"):
            return value
        try:
            return float(value)
        except ValueError:
            self.fail(
                f"{value!r} is neither linear, fast, slow, impulse nor a time constant in s", param, ctx
            )


@recording_verb("octave", "all levels")
@click.option("--fraction", type=click.Choice(FRACTIONS), help="1/N octave, or critical bands.  [default: 3]")
@weighting_option("Weighting of the band levels; A, B and C for sound pressure only.  [default: Z]")
@click.option(
    "--averaging",
    type=_Averaging(),
    metavar="linear|fast|slow|impulse|SECONDS",
    help="Average over the section, or exponential.  [default: linear]",
)
@click.option(
    "--hold", type=click.Choice(["max", "min"]), help="Highest or lowest value of an exponential average."
)
@click.option("--interval", "interval_s", type=float, metavar="S", help="Interval of the level history.")
@click.option(
    "--percentile",
    "percentiles",
    type=float,
    multiple=True,
    metavar="N",
    help="Also the level of an exponential average exceeded during N % of the time; repeatable.",
)
@click.option(
    "--fmin",
    type=float,
    metavar="HZ",
    help="Lowest band: the one that contains this frequency.  [default: 20]",
)
@click.option(
    "--fmax",
    type=float,
    metavar="HZ",
    help="Highest band: the one that contains this frequency.  [default: 20000]",
)
@click.option("--band", type=float, metavar="HZ", help="One band: the one that contains HZ.")
@section_options
@quantity_option
@click.option(
    "--background",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Subtract the levels of this recording of the background.",
)
@velocity_option()
@click.option(
    "--settling",
    type=click.Choice(["counted", "left-out"]),
    help="Treatment of the cut at the section's ends, for linear averages and maxima.  [default: counted]",
)
@limit_option()
@plot_option()
@click.option("--history", is_flag=True, help="Draw the first channel against time.")
def command(
    source: Source,
    deliver: Delivery,
    background: Path | None,
    limit: Path | None,
    history: bool,
    quantity: Quantity | None,
    **options: Any,
) -> int:
    """Find levels in octave and fractional-octave bands (IEC 61260-1 class 1), and overall levels.

    \b
    specan octave sample_data/recordings/knock.tdms --fraction 3 --weighting A --channel "Mic *"
    specan octave sample_data/recordings/knock.tdms --averaging fast --plot history.png --history
    """
    from specan.analysis.background import without_background
    from specan.api.recordings import octave
    from specan.errors import RequestError

    if history and (deliver.plot is None or options["averaging"] in (None, "linear")):
        raise RequestError(
            "--history draws a time-weighted level", remedy="add --plot and --averaging fast, slow or seconds"
        )
    wanted = given(**options)
    found = octave(source.open(quantity), **wanted)
    if background is not None:
        whole = {**wanted, "start_s": 0.0, "stop_s": None}
        found = without_background(found, octave(Source(background, source.opening).open(quantity), **whole))
    kept = [] if limit is None else _held(found, limit)
    return deliver(
        found, lambda: show(found), flags=found.flags, limit=limit, kept=kept,
        view="history" if history else "",
    )  # fmt: skip


def _held(found: BandLevels, limit: Path) -> list[Kept]:
    from specan.io.limit_file import read_limits

    curve = read_limits(limit)
    return [
        curve.of_bands(
            name,
            found.nominal_hz,
            found.level_dB[row],
            {w: float(v[row]) for w, v in found.overall_dB.items()},
        )
        for row, name in enumerate(found.channels)
    ]


def show(found: BandLevels) -> None:
    """A row a band and a column a channel; the overall levels below."""
    import numpy as np

    from specan.data.band_levels import division_name

    held = f", {found.hold} hold" if found.hold else ""
    title = (
        f"{found.label}: {division_name(found.fraction)} levels, {found.weighting} weighting, {found.averaging} "
        f"averaging{held}, {found.start_s:g} s to {found.start_s + found.duration_s:g} s"
    )
    click.echo(title)
    for first in range(0, len(found.channels), _WIDE):
        rows = range(first, min(first + _WIDE, len(found.channels)))
        header = ["Hz", *(f"{found.channels[r]}\ndB re {found.references[r].text}" for r in rows), "u dB", ""]
        lines = []
        for band, nominal in enumerate(found.nominal_hz):
            words = _common_words([found.band_flags(r, band) for r in rows], [found.flags[r] for r in rows])
            cells = [_decibels(found.level_dB[r, band]) for r in rows]
            lines.append([f"{nominal:g}", *cells, f"{found.u_dB[band]:.2f}", words])
        for weighting, values in found.overall_dB.items():
            if np.isfinite(values[list(rows)]).any():
                flags = [found.overall_flags(r, weighting) for r in rows]
                words = _common_words(flags, [found.flags[r] for r in rows])
                lines.append([f"overall {weighting}", *(_decibels(values[r]) for r in rows), "", words])
        table("", header, lines)
    for row in range(len(found.channels) if found.percentile_dB else 0):
        _show_percentiles(found, row)
    if found.percentile_dB:
        click.echo("LN: level exceeded during N % of the time that follows settling.")
    click.echo(f"u: standard deviation of noise. Settling: {found.settling}.")


def _show_percentiles(found: BandLevels, row: int) -> None:
    """A row a band and a column a percentage, of one channel."""
    from specan.data.band_levels import percentile_name

    bands, totals = found.percentile_dB or {}, found.percentile_overall_dB or {}
    lines = [
        [f"{nominal:g}", *(_decibels(values[row, band]) for values in bands.values())]
        for band, nominal in enumerate(found.nominal_hz)
    ]
    for weighting, levels in found.overall_dB.items():
        if levels[row] == levels[row]:
            lines.append(
                [f"overall {weighting}", *(_decibels(total[weighting][row]) for total in totals.values())]
            )
    title = f"{found.channels[row]} / dB re {found.references[row].text}"
    table(title, ["Hz", *map(percentile_name, bands)], lines)


def _common_words(flags: list[tuple[str, ...]], known: list[tuple[str, ...]]) -> str:
    """Words for one line of several channels; what has a value has one for each channel, - where it does not hold."""
    found = [[word for word in words if word not in mine] for words, mine in zip(flags, known)]
    plain = sorted({word for words in found for word in words if "=" not in word})
    names = dict.fromkeys(word.split("=")[0] for words in found for word in words if "=" in word)
    for name in names:
        values = [next((w.split("=")[1] for w in words if w.startswith(f"{name}=")), "-") for words in found]
        plain.append(f"{name}=" + "/".join(v if v == "-" else f"{float(v):.2f}" for v in values))
    return " ".join(plain)


def _decibels(level: float) -> str:
    return "" if level != level else f"{level:.2f}"
