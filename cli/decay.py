"""``specan decay``: reverberation times and clarity."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from specan_cli.output import plot_option, table
from specan_cli.recording_verb import Delivery, Source, given, recording_verb, section_options

if TYPE_CHECKING:
    from specan.data.decay import DecayTimes


@recording_verb("decay")
@click.option(
    "--reference",
    metavar="CH",
    help="Channel of the excitation: the impulse responses to it are found first.  [default: the generator "
    "of noise and sweeps]",
)
@click.option("--fraction", type=click.Choice([1, 3]), help="1/N octave.  [default: 1]")
@click.option("--fmin", type=float, metavar="HZ", help="From this band.  [default: 125; 100 for thirds]")
@click.option("--fmax", type=float, metavar="HZ", help="To this band.  [default: 4000; 5000 for thirds]")
@section_options
@plot_option()
def command(
    source: Source,
    deliver: Delivery,
    **options: Any,
) -> int:
    """Find reverberation times, clarity, definition and centre time (ISO 3382-1).

    FILE holds impulse responses (a shot, a balloon, what `specan impulse` wrote), or noise or a sweep together
    with its excitation.

    \b
    specan decay sample_data/recordings/knock.tdms --fmax 2000
    """
    from specan.api.recordings import decay

    found = decay(source.open(), **given(**options))
    return deliver(found, lambda: show(found))


def show(found: DecayTimes) -> None:
    """A table a channel, a row a band."""
    from specan.data.decay import TIMES

    header = ["Hz", "EDT s", "T20 s", "u s", "T30 s", "u s", "C80 dB", "D50 %", "range dB", ""]
    for row, name in enumerate(found.channels):
        lines = []
        for band, nominal in enumerate(found.nominal_hz):
            times = [_number(getattr(found, key)[row, band], "{:.3f}") for key in TIMES]
            ratios = [_number(getattr(found, key)[row, band], "{:.1f}") for key in ("c80_dB", "d50_percent")]
            span = _number(found.range_dB[row, band], "{:.0f}")
            flags = " ".join(found.flags(row, band))
            lines.append([f"{nominal:g}", *times, *ratios, span, flags])
        click.echo(f"{found.label}, {name}: 1/{found.fraction} octave bands")
        table("", header, lines)
    click.echo("--json and -o hold C50 and the centre time as well.")
    click.echo("u: standard deviation over positions in a diffuse field (ISO 3382-2:2008, 7.1).")


def _number(value: float, form: str) -> str:
    return "" if value != value else form.format(value)
