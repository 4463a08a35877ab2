"""``specan rms``: single-number values of every channel."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from specan_cli.options import velocity_option, weighting_option
from specan_cli.output import plot_option, table
from specan_cli.recording_verb import Delivery, Source, given, recording_verb, section_options

if TYPE_CHECKING:
    from specan.data.levels import SignalLevels


@recording_verb("rms")
@weighting_option("Weighting of the time-weighted levels of sound pressure.  [default: A]")
@click.option(
    "--averaging",
    type=click.Choice(["fast", "slow"]),
    help="Time weighting of these levels.  [default: fast]",
)
@click.option(
    "--percentile", "percentiles", type=float, multiple=True, metavar="N",
    help="Level exceeded during N % of the time; repeatable.  [default: 5, 10, 50, 90, 95]",
)  # fmt: skip
@section_options
@velocity_option()
@plot_option()
def command(
    source: Source,
    deliver: Delivery,
    **options: Any,
) -> int:
    """Find RMS, level, peak, crest factor, and equivalent and percentile levels of every channel.

    All but the mean are of the signal about its mean.

    \b
    specan rms sample_data/recordings/knock.tdms --averaging slow
    """
    from specan.api.recordings import rms

    found = rms(source.open(), **given(**options))
    return deliver(found, lambda: show(found), flags=found.flags)


def show(found: SignalLevels) -> None:
    """Two tables: the signal, and its levels."""
    stop = found.start_s + found.duration_s
    header = ["channel", "unit", "RMS", "peak", "crest", "mean"]
    rows = [
        [
            name,
            found.units[row],
            f"{found.rms[row]:.5g}",
            f"{found.peak[row]:.5g}",
            _number(found.crest_factor[row], "{:.2f}"),
            f"{found.mean[row]:.4g}",
        ]
        for row, name in enumerate(found.channels)
    ]
    click.echo(f"{found.label}: {found.start_s:g} s to {stop:g} s, about the mean")
    table("", header, rows)
    letter = {"fast": "F", "slow": "S"}[found.averaging]
    header = ["channel", "dB re", "level", "Leq A", "LE A", "C peak", f"{letter} max", f"{letter} min"]
    values = (
        found.level_dB, found.equivalent_dB["A"], found.exposure_dB["A"], found.c_peak_dB, found.max_dB, found.min_dB,
    )  # fmt: skip
    rows = [
        [name, found.references[row].text, *(_number(v[row]) for v in values)]
        for row, name in enumerate(found.channels)
    ]
    weighted = f"the {found.averaging} level, {found.weighting} weighted for Pa"
    click.echo(f"Levels; LE: exposure level; {letter} max, min: of {weighted}")
    table("", header, rows)
    rows = [
        [name, *(_number(v[row], "{:.1f}") for v in found.percentile_dB.values())]
        for row, name in enumerate(found.channels)
    ]
    click.echo(f"Percentiles of {weighted}: LN is exceeded during N % of the time")
    table("", ["channel", *(f"L{n:g}" for n in found.percentile_dB)], rows)


def _number(value: float, form: str = "{:.2f}") -> str:
    return "" if value != value else form.format(value)
