"""``specan export``: samples for other tools."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from specan_cli.options import json_option, opening_options, section_options
from specan_cli.output import Delivery, decimal_option, plot_option, samples_option, verb
from specan_cli.recording_verb import opened_with, say_notes


@verb("export")
@click.argument("file", type=click.Path(path_type=Path))
@samples_option(".csv")
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
    from specan.analysis.section import aligned, of_one_rate
    from specan.analysis.section import section as samples_of
    from specan.io.export_file import Excerpt, together, write_excerpt
    from specan.result import counted

    source, section = opened_with(file, options)
    whole = source.open()
    recording, starts = aligned(whole, of_one_rate(whole, section["channels"])[0])
    chosen, notes = of_one_rate(recording, section["channels"])
    excerpt = Excerpt(
        recording, chosen, *samples_of(recording, chosen, section["start_s"], section["stop_s"])
    )
    assert deliver.output is not None  # it has a default
    write_excerpt(excerpt, deliver.output, deliver.decimal)
    deliver.draw(recording, **{**section, "channels": chosen})
    late = [
        f"{c.label} has a phase or delay correction, which is not applied to samples in time"
        for c in chosen
        if c.phase is not None or c.delay_s
    ]
    say_notes((*starts, *notes, *late[:1]), {"the file": whole.flags})
    about = {
        "output": str(deliver.output),
        "samples": excerpt.n,
        "sampling_rate_hz": excerpt.rate,
        "channels": [{"name": c.label, "unit": c.unit} for c in chosen],
    }
    said = f"{counted(len(chosen), 'channel')}, {excerpt.n} samples at {excerpt.rate:g} Hz, in {together(chosen)}"
    calibration = whole.calibration_of([c.label for c in chosen])
    deliver.put_out(about, lambda: click.echo(f"{said}.\nCalibration: {calibration}."))
    return 0
