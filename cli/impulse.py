"""``specan impulse``: impulse responses, as a file for this and other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from specan_cli.export import SUFFIXES
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
from specan_cli.recording_verb import Source, given, opening_options, say_notes, section_options


@click.command("impulse", cls=Verb)
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "--reference",
    metavar="CH",
    help="Channel of the excitation.  [default: the generator, else the vibrometer]",
)
@click.option(
    "--method",
    type=click.Choice(["deconvolution", "H1"], case_sensitive=False),
    help="Deconvolution of sweeps, maximum length sequences and impulses, or H1 of noise.  [default: as the "
    "excitation is recognised]",
)
@click.option("--length", "length_s", type=float, metavar="S", help="Of the responses.")
@section_options
@click.option(
    "--to", "form", type=click.Choice(list(SUFFIXES)), default="wav", show_default=True, help="The format."
)
@click.option("-o", "--output", type=OutputFile(), help="The file to write [default: FILE_impulse, here].")
@plot_option("the responses")
@click.option("--json", "as_json", is_flag=True, help="Print what was written as JSON.")
@opening_options
def command(
    file: Path,
    form: str,
    output: Path | None,
    plot: Path | None,
    as_json: bool,
    opening: dict[str, Any],
    **options: Any,
) -> int:
    """Find impulse responses of microphones and accelerometers to the excitation, and write them.

    Maximum length sequences, sweeps and impulses are deconvolved; of noise, the averaged transfer function is
    transformed back.

    \b
    specan impulse sample_data/recordings/noise/noise_24_microphones.tdms --channel "Mic 1" --to csv -o mic_1.csv
    """
    from specan.api.recordings import impulse
    from specan.io.export_file import Excerpt, write_excerpt

    target = output or Path(f"{file.stem}_impulse{SUFFIXES[form]}")
    refuse_unsafe(target)
    found = impulse(Source(file, opening).open(), **given(**options))
    responses = found.recording()
    write_excerpt(Excerpt(responses, responses.channels, 0, found.samples.shape[1]), form, target)
    draw(found, plot)
    if as_json:
        emit_json({"output": str(target), "format": form, **found.to_json()})
    elif not to_standard_output(target):
        click.echo(f"{found.summary()}.")
        say_written(plot, target)
    say_notes(found.notes, {})
    return 0
