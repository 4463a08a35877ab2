"""``specan export``: samples for other tools."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from specan_cli.output import (
    OutputFile,
    Verb,
    draw,
    emit_json,
    plot_option,
    refuse_unsafe,
    say_written,
    to_standard_output,
)
from specan_cli.recording_verb import Source, opening_options, say_calibration, say_notes, section_options

if TYPE_CHECKING:
    from specan.data.recording import Recording

SUFFIXES = {"csv": ".csv", "uff": ".uff", "wav": ".wav", "parquet": ".parquet"}


@click.command("export", cls=Verb)
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--to", "form", required=True, type=click.Choice(list(SUFFIXES)), help="The format.")
@click.option(
    "-o",
    "--output",
    type=OutputFile(),
    help="The file to write [default: named after FILE, here].",
)
@click.option(
    "--decimal",
    type=click.Choice([".", ","]),
    default=".",
    show_default=True,
    help="Decimal sign of CSV; with a comma, columns are separated by semicolons.",
)
@click.option("--reference", metavar="NAME", help="Write transfer functions over this channel instead of samples "
              "(--to uff).")  # fmt: skip
@section_options
@opening_options
@plot_option("what was written")
@click.option("--json", "as_json", is_flag=True, help="Print what was written as JSON.")
def command(
    file: Path,
    form: str,
    output: Path | None,
    decimal: str,
    reference: str | None,
    channels: tuple[str, ...],
    start_s: float,
    stop_s: float | None,
    opening: dict[str, Any],
    plot: Path | None,
    as_json: bool,
) -> int:
    """Write the samples of a recording, in SI units, for other programs; or its transfer functions.

    Sensitivities of a calibration are applied; phase and delay corrections apply to transfer functions only.

    \b
    specan export sample_data/recordings/knock.tdms --to csv --channel "Mic 1" --decimal , -o knock.csv
    """
    from specan.analysis.section import aligned, of_one_rate, section
    from specan.errors import RequestError
    from specan.io.export_file import Excerpt, together, write_excerpt
    from specan.result import counted

    if decimal != "." and form != "csv":
        raise RequestError(f"--decimal is for CSV, not for {form}", remedy="leave it out")
    if reference is not None and form != "uff":
        raise RequestError(
            f"--reference is for --to uff, not for {form}",
            remedy=f"specan frf {file} --reference {reference} -o FILE writes transfer functions as text",
        )
    target = output or Path(file.stem + SUFFIXES[form])
    refuse_unsafe(target)
    recording = Source(file, opening).open()
    if reference is not None:
        return _transfer(recording, reference, channels, (start_s, stop_s), target, plot, as_json)
    recording, starts = aligned(recording, of_one_rate(recording, channels)[0])
    chosen, notes = of_one_rate(recording, channels)
    start, stop = section(recording, chosen, start_s, stop_s)
    excerpt = Excerpt(recording, chosen, start, stop)
    write_excerpt(excerpt, form, target, decimal)
    draw(recording, plot, channels=chosen, start_s=start_s, stop_s=stop_s)
    late = tuple(
        f"{c.label} carries a phase or delay correction, which samples in time do not show"
        for c in chosen
        if c.phase is not None or c.delay_s
    )
    say_notes((*starts, *notes, *late[:1]), {"the file": recording.flags})
    if as_json:
        emit_json(
            {
                "output": str(target),
                "format": form,
                "samples": excerpt.n,
                "sampling_rate_hz": excerpt.rate,
                "channels": [{"name": c.label, "unit": c.unit} for c in chosen],
            }
        )
    elif not to_standard_output(target):
        click.echo(
            f"{counted(len(chosen), 'channel')}, {excerpt.n} samples at {excerpt.rate:g} Hz, in {together(chosen)}."
        )
        click.echo(f"Calibration: {recording.calibration_of([c.name for c in chosen])}.")
        say_written(target)
    return 0


def _transfer(
    recording: Recording,
    reference: str,
    channels: tuple[str, ...],
    section: tuple[float, float | None],
    target: Path,
    plot: Path | None,
    as_json: bool,
) -> int:
    """Write transfer functions as a universal file."""
    from specan.api.recordings import frf
    from specan.io.export_file import write_uff_transfer

    found = frf(recording, reference, channels=channels, start_s=section[0], stop_s=section[1])
    write_uff_transfer(found, target)
    draw(found, plot)
    say_notes(found.notes, {"the file": recording.flags})
    if as_json:
        emit_json(
            {
                "output": str(target),
                "format": "uff",
                "lines": int(found.frequency_hz.size),
                "reference": found.reference,
                "channels": [
                    {"name": n, "unit": u} for n, u in zip(found.channels, found.units, strict=True)
                ],
            }
        )
    elif not to_standard_output(target):
        click.echo(f"{found.summary()}.")
        say_calibration(found)
        say_written(target)
    return 0
