"""``specan impulse``: impulse responses, as a file for this and other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from specan_cli.options import json_option, opening_options, opt, section_options
from specan_cli.output import Delivery, decimal_option, plot_option, samples_option, verb
from specan_cli.recording_verb import given, opened_with, say_calibration, say_notes


@verb("impulse")
@click.argument("file", type=click.Path(path_type=Path))
@opt("--reference", None, "Channel of the excitation.  [default: the generator, else the vibrometer]", "CH")
@opt(
    "--method", ["deconvolution", "H1"],
    "Deconvolution of sweeps, maximum length sequences and impulses, or H1 of noise.  [default: as the "
    "excitation is recognised]",
)  # fmt: skip
@opt("--length length_s", float, "Length of the responses.", "S")
@section_options
@samples_option("_impulse.wav")
@decimal_option("CSV")
@plot_option("the responses")
@json_option
@opening_options
def command(file: Path, deliver: Delivery, **options: Any) -> int:
    """Compute impulse responses of microphones and accelerometers to the excitation, and write them.

    Maximum length sequences, sweeps and impulses are deconvolved; of noise, the averaged transfer function is
    transformed back.

    \b
    specan impulse sample_data/recordings/noise/noise_24_microphones.tdms --channel "Mic 1" -o mic_1.csv
    """
    from specan.api.recordings import impulse
    from specan.io.export_file import Excerpt, write_excerpt

    source, own = opened_with(file, options)
    found = impulse(source.open(), **given(**own))
    responses = found.recording()
    excerpt = Excerpt(responses, responses.channels, 0, found.samples.shape[1])
    assert deliver.output is not None  # it has a default
    write_excerpt(excerpt, deliver.output, deliver.decimal)
    deliver.draw(found)

    def show() -> None:
        click.echo(f"{found.summary()}.")
        say_calibration(found)

    deliver.put_out({"output": str(deliver.output), **found.to_dict()}, show)
    say_notes(found.notes, {})
    return 0
