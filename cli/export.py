"""``specan export``: samples for other tools."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from specan_cli.options import json_option, opening_options, opt, section_options
from specan_cli.output import SAMPLES, Delivery, OutputFile, decimal_option, plot_option, refuse_unsafe, verb
from specan_cli.recording_verb import opened_with, say_notes


@verb("export")
@click.argument("file", type=click.Path(path_type=Path))
@opt(
    "-o --output",
    OutputFile(*SAMPLES),
    "The file to write, in the format of its ending.  [default: FILE.csv, here]",
)
@decimal_option("CSV")
@section_options
@opening_options
@plot_option("what was written")
@json_option
def command(file: Path, deliver: Delivery, **options: Any) -> int:
    """Write the samples of a recording, in SI units, for other programs.

    Sensitivities of a calibration are applied. Phase and delay corrections apply to transfer functions only; the verb
    frf writes those.

    \b
    specan export sample_data/recordings/knock.tdms --channel "Mic 1" --decimal , -o knock.csv
    """
    target = deliver.output or Path(f"{file.stem}.csv")
    refuse_unsafe(target)
    source, section = opened_with(file, options)
    recording = source.open()
    deliver = replace(deliver, output=target)
    about, said, notes = _samples(recording, target, deliver, **section)
    say_notes(notes, {"the file": recording.flags})
    names = [channel["name"] for channel in about["channels"]]
    calibration = recording.calibration_of(names)
    deliver.put_out(
        {"output": str(target), **about}, lambda: click.echo(f"{said}.\nCalibration: {calibration}.")
    )
    return 0


def _samples(
    recording: Any, target: Path, deliver: Delivery, **section: Any
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
    write_excerpt(excerpt, target, deliver.decimal)
    deliver.draw(recording, **{**section, "channels": chosen})
    corrected = [c.label for c in chosen if c.phase is not None or c.delay_s]
    late = [
        f"{name} has a phase or delay correction, which is not applied to samples in time"
        for name in corrected
    ]
    about = {
        "samples": excerpt.n,
        "sampling_rate_hz": excerpt.rate,
        "channels": [{"name": c.label, "unit": c.unit} for c in chosen],
    }
    said = f"{counted(len(chosen), 'channel')}, {excerpt.n} samples at {excerpt.rate:g} Hz, in {together(chosen)}"
    return about, said, (*starts, *notes, *late[:1])
