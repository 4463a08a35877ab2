"""``specan decay``: reverberation times and clarity."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from specan import __version__
from specan_cli.figure_output import plot_option
from specan_cli.output import table
from specan_cli.recording_input import given, say_notes, section_options
from specan_cli.results import deliver, result_options
from specan_cli.several_files import RecordingVerb, recording_argument

if TYPE_CHECKING:
    from specan.data.decay import DecayTimes


@click.command("decay", cls=RecordingVerb)
@recording_argument()
@click.option(
    "--reference",
    metavar="CH",
    help="Channel of the excitation: the impulse responses to it are found first.  [default: the generator "
    "of noise and sweeps]",
)
@click.option("--fraction", type=click.Choice(["1", "3"]), help="1/N octave.  [default: 1]")
@click.option("--fmin", type=float, metavar="HZ", help="From this band.  [default: 125; 100 for thirds]")
@click.option("--fmax", type=float, metavar="HZ", help="To this band.  [default: 4000; 5000 for thirds]")
@section_options
@plot_option()
@result_options()
def command(
    file: Path,
    reference: str | None,
    fraction: str | None,
    plot: Path | None,
    output: Path | None,
    as_json: bool,
    opening: dict[str, Any],
    **options: Any,
) -> int:
    """Find reverberation times, clarity, definition and centre time (ISO 3382-1).

    FILE holds impulse responses (a shot, a balloon, what `specan impulse` wrote), or noise or a sweep together
    with its excitation.

    \b
    specan decay sample_data/recordings/knock.tdms --fmax 2000
    """
    from specan.api.recordings import decay, read

    recording = read(file, **opening)
    found = decay(
        recording, reference, **given(fraction=None if fraction is None else int(fraction), **options)
    )
    deliver(
        plot, output, as_json, draw=lambda path: _draw(found, path), write=lambda path: write_text(found, path),
        content=lambda: content(found), show=lambda: show(found),
    )  # fmt: skip
    say_notes(found.notes, {})
    return 0


_TIMES = ("edt_s", "t20_s", "u_t20_s", "t30_s", "u_t30_s")
_RATIOS = ("c50_dB", "c80_dB", "d50_percent", "centre_time_s", "range_dB", "nonlinearity_permille")


def _draw(found: DecayTimes, path: Path) -> None:
    from specan.report.figure_style import save_figure
    from specan.report.figures_decay import figure_decay

    save_figure(figure_decay(found), path)


def content(found: DecayTimes) -> dict[str, Any]:
    """All there is, for JSON."""
    return {
        "file": found.label,
        "fraction": found.fraction,
        "nominal_hz": found.nominal_hz,
        "exact_hz": found.exact_hz,
        "channels": [
            {
                "channel": name,
                "group": found.groups[row],
                "start_s": found.start_s[row],
                **{key: getattr(found, key)[row] for key in (*_TIMES, *_RATIOS, "curvature_percent")},
                "flags": [found.flags(row, band) for band in range(found.exact_hz.size)],
            }
            for row, name in enumerate(found.channels)
        ],
        "notes": found.notes,
        "settings": found.settings,
    }


def show(found: DecayTimes) -> None:
    """A table a channel, a row a band."""
    header = ["Hz", "EDT s", "T20 s", "u s", "T30 s", "u s", "C80 dB", "D50 %", "range dB", ""]
    for row, name in enumerate(found.channels):
        lines = []
        for band, nominal in enumerate(found.nominal_hz):
            times = [_number(getattr(found, key)[row, band], "{:.3f}") for key in _TIMES]
            ratios = [_number(getattr(found, key)[row, band], "{:.1f}") for key in ("c80_dB", "d50_percent")]
            span = _number(found.range_dB[row, band], "{:.0f}")
            flags = " ".join(found.flags(row, band))
            lines.append([f"{nominal:g}", *times, *ratios, span, flags])
        click.echo(f"{found.label}, {name}: 1/{found.fraction} octave bands")
        table("", header, lines)
    click.echo("--json and -o hold C50 and the centre time as well.")
    click.echo("u: standard deviation over positions in a diffuse field (ISO 3382-2:2008, 7.1).")


def write_text(found: DecayTimes, path: Path) -> None:
    """All bands, tab-separated, the channels one after the other."""
    from specan.io import results_text as text

    bands = [f"{f:g}" for f in found.nominal_hz]
    blocks = [
        text.rows(
            [
                [text.word(name)] * len(bands),
                bands,
                *(text.significant(getattr(found, key)[row], 4) for key in (*_TIMES, *_RATIOS)),
                text.significant(found.curvature_percent[row], 4),
                [" ".join(found.flags(row, band)) for band in range(len(bands))],
            ]
        )
        for row, name in enumerate(found.channels)
    ]
    header = [
        f"specan {__version__} decay",
        f"decay times of {found.label}, 1/{found.fraction} octave bands (ISO 3382-1:2009)",
        "u: standard deviation over positions in a diffuse field (ISO 3382-2:2008, 7.1)",
        f"settings: {found.settings}",
        *found.notes,
    ]
    columns = ("channel", "band_hz", *_TIMES, *_RATIOS, "curvature_percent", "flags")
    text.write_table(path, header, columns, blocks)


def _number(value: float, form: str) -> str:
    return "" if value != value else form.format(value)
