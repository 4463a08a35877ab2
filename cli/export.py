"""``specan export``: samples for other tools."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from specan_cli.options import json_option, opening_options, opt, section_options
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
from specan_cli.recording_verb import opened_with, say_notes

SUFFIXES = {"csv": ".csv", "uff": ".uff", "wav": ".wav", "parquet": ".parquet"}


@click.command("export", cls=Verb)
@click.argument("file", type=click.Path(path_type=Path))
@opt("--to form", list(SUFFIXES), "The format.", required=True)
@opt("-o --output", OutputFile(), "The file to write [default: named after FILE, here].")
@opt(
    "--decimal", [".", ","], "Decimal sign of CSV; with a comma, columns are separated by semicolons.",
    default=".", show_default=True,
)  # fmt: skip
@opt("--reference", None, "Write transfer functions over this channel instead of samples (--to uff).", "NAME")
@section_options
@opening_options
@plot_option("what was written")
@json_option
def command(
    file: Path,
    form: str,
    output: Path | None,
    decimal: str,
    plot: Path | None,
    as_json: bool,
    **options: Any,
) -> int:
    """Write the samples of a recording, in SI units, for other programs; or its transfer functions.

    Sensitivities of a calibration are applied; phase and delay corrections apply to transfer functions only.

    \b
    specan export sample_data/recordings/knock.tdms --to csv --channel "Mic 1" --decimal , -o knock.csv
    """
    from specan.errors import RequestError

    reference = options.pop("reference")
    if decimal != "." and form != "csv":
        raise RequestError(f"--decimal is for CSV, not for {form}", remedy="leave it out")
    if reference is not None and form != "uff":
        raise RequestError(
            f"--reference is for --to uff, not for {form}",
            remedy=f"specan frf {file} --reference {reference} -o FILE writes transfer functions as text",
        )
    target = output or Path(file.stem + SUFFIXES[form])
    refuse_unsafe(target)
    source, section = opened_with(file, options)
    recording = source.open()
    if reference is None:
        about, said, notes = _samples(recording, form, target, decimal, plot, **section)
    else:
        about, said, notes = _transfer(recording, reference, target, plot, **section)
    say_notes(notes, {"the file": recording.flags})
    if as_json:
        emit_json({"output": str(target), "format": form, **about})
    elif not to_standard_output(target):
        names = [channel["name"] for channel in about["channels"]]
        click.echo(f"{said}.\nCalibration: {recording.calibration_of(names)}.")
        say_written(target)
    return 0


def _samples(
    recording: Any, form: str, target: Path, decimal: str, plot: Path | None, **section: Any
) -> tuple[dict[str, Any], str, tuple[str, ...]]:
    """Write samples; what JSON and the screen say of them, and notes."""
    from specan.analysis.section import aligned, of_one_rate
    from specan.analysis.section import section as samples_of
    from specan.io.export_file import Excerpt, together, write_excerpt
    from specan.result import counted

    recording, starts = aligned(recording, of_one_rate(recording, section["channels"])[0])
    chosen, notes = of_one_rate(recording, section["channels"])
    excerpt = Excerpt(
        recording, chosen, *samples_of(recording, chosen, section["start_s"], section["stop_s"])
    )
    write_excerpt(excerpt, form, target, decimal)
    draw(recording, plot, **{**section, "channels": chosen})
    corrected = [c.label for c in chosen if c.phase is not None or c.delay_s]
    late = [
        f"{name} carries a phase or delay correction, which samples in time do not show" for name in corrected
    ]
    about = {
        "samples": excerpt.n,
        "sampling_rate_hz": excerpt.rate,
        "channels": [{"name": c.label, "unit": c.unit} for c in chosen],
    }
    said = f"{counted(len(chosen), 'channel')}, {excerpt.n} samples at {excerpt.rate:g} Hz, in {together(chosen)}"
    return about, said, (*starts, *notes, *late[:1])


def _transfer(
    recording: Any, reference: str, target: Path, plot: Path | None, **section: Any
) -> tuple[dict[str, Any], str, tuple[str, ...]]:
    """Write transfer functions as a universal file; what JSON and the screen say of them, and notes."""
    from specan.api.recordings import frf
    from specan.io.export_file import write_uff_transfer

    found = frf(recording, reference, **section)
    write_uff_transfer(found, target)
    draw(found, plot)
    about = {
        "lines": int(found.frequency_hz.size),
        "reference": found.reference,
        "channels": [{"name": n, "unit": u} for n, u in zip(found.channels, found.units, strict=True)],
    }
    return about, found.summary(), found.notes
