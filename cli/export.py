"""``specan export``: samples for other tools."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from specan_cli.options import json_option, opening_options, opt, section_options
from specan_cli.output import (
    OutputFile,
    Verb,
    decimal_option,
    draw,
    emit_json,
    plot_option,
    refuse_unsafe,
    say_written,
    to_standard_output,
)
from specan_cli.recording_verb import opened_with, say_notes

FORMS = ["csv", "uff", "wav", "parquet", "tdms"]


def form_and_file(form: str | None, output: Path | None, otherwise: str) -> tuple[str, Path]:
    """The format by ``--to``, else by the ending of ``-o``; the file by ``-o``, else named after its source."""
    from specan.errors import RequestError
    from specan.io.export_file import ENDINGS

    by_ending = None if output is None else ENDINGS.get(output.suffix.lower())
    if form is None and by_ending is None:
        raise RequestError(
            "no format is named" if output is None else f"{output} ends in no known format",
            expected=f"--to {', '.join(FORMS)}, or -o with one of {', '.join(ENDINGS)}",
        )
    form = form or by_ending or ""
    if by_ending not in (None, form):
        raise RequestError(f"--to {form} and the ending of {output} differ", remedy="leave out --to")
    return form, output or Path(f"{otherwise}.{form}")


@click.command("export", cls=Verb)
@click.argument("file", type=click.Path(path_type=Path))
@opt("--to form", FORMS, "The format.  [default: by the ending of -o]")
@opt("-o --output", OutputFile(), "The file to write [default: named after FILE, here].")
@decimal_option("CSV")
@section_options
@opening_options
@plot_option("what was written")
@json_option
def command(
    file: Path,
    form: str | None,
    output: Path | None,
    decimal: str,
    plot: Path | None,
    as_json: bool,
    **options: Any,
) -> int:
    """Write the samples of a recording, in SI units, for other programs.

    Sensitivities of a calibration are applied. Phase and delay corrections apply to transfer functions only; the verb
    frf writes those.

    \b
    specan export sample_data/recordings/knock.tdms --channel "Mic 1" --decimal , -o knock.csv
    """
    from specan.errors import RequestError

    form, target = form_and_file(form, output, file.stem)
    if decimal != "." and form != "csv":
        raise RequestError(f"--decimal is for CSV, not for {form}", remedy="leave it out")
    refuse_unsafe(target)
    source, section = opened_with(file, options)
    recording = source.open()
    about, said, notes = _samples(recording, form, target, decimal, plot, **section)
    say_notes(notes, {"the file": recording.flags})
    if as_json:
        emit_json({"output": str(target), "format": form, **about})
    elif not to_standard_output(target, plot):
        names = [channel["name"] for channel in about["channels"]]
        click.echo(f"{said}.\nCalibration: {recording.calibration_of(names)}.")
        say_written(target, plot)
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
