"""``specan info``: what is in a recording, and how each thing was decided."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from specan_cli.output import Verb, draw, emit_json, plot_option, say, table
from specan_cli.recording_verb import expand, opening_options

if TYPE_CHECKING:
    from specan.data.levels import Quality
    from specan.data.recording import Recording
    from specan.data.tone import Excitation
    from specan.report.contents import Sheet


@click.command("info", cls=Verb)
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="FILE...")
@opening_options
@click.option("--levels", is_flag=True, help="Read all samples: RMS, peak, clipped, dead, NaN.")
@click.option("--all", "show_all", is_flag=True, help="Every channel and the whole of every property.")
@plot_option("the waveforms of one recording")
@click.option("--json", "as_json", is_flag=True, help="Everything, as JSON.")
def command(
    files: tuple[Path, ...],
    levels: bool,
    show_all: bool,
    plot: Path | None,
    as_json: bool,
    opening: dict[str, Any],
) -> int:
    """Show groups, channels, roles, rates, units, excitation, notes and integrity of recordings.

    Only headers are read, and a few seconds of one channel to tell sine from noise. A directory stands
    for all recordings in it: what is in each is shown with --all.

    \b
    specan info sample_data/recordings/knock.tdms --plot waveforms.png
    """
    from dataclasses import replace

    from specan.analysis.excitation import recognise
    from specan.analysis.quality import rms_and_quality
    from specan.api.recordings import read
    from specan.errors import InputError, RequestError
    from specan.report.contents import sheets

    seen: list[dict[str, Any]] = []
    failures: list[dict[str, str]] = []
    found = expand(files)
    if plot is not None and len(found) > 1:
        raise RequestError(f"--plot draws one recording, and there are {len(found)}", remedy="name one")
    for item in found:
        try:
            recording = replace(read(item.path, **opening), label=item.label)
            excitation = recognise(recording)
            quality = rms_and_quality(recording) if levels else {}
        except InputError as fault:
            if len(found) == 1:
                raise
            failures.append({"file": item.label, "reason": str(fault)})
            say(f"Left out: {fault}")
            continue
        if as_json:
            seen.append(_content(recording, item.path, excitation, quality))
        else:
            _show(recording, item.path, excitation)
            if len(found) == 1 or show_all:
                for one in sheets(recording, quality, show_all):
                    _show_sheet(one)
            seen.append({})
        draw(recording, plot)
    if not seen:
        raise InputError("no file could be read", remedy="see the reasons above")
    if as_json:
        emit_json({"files": seen, "failures": failures})
    return 1 if failures else 0


def _show(recording: Recording, path: Path, excitation: Excitation) -> None:
    click.echo(f"{recording.label}: {_headline(recording, path)}")
    tone = f" at {excitation.frequency_hz:g} Hz" if excitation.frequency_hz else ""
    click.echo(f"Excitation: {excitation.kind}{tone} ({excitation.reason})")
    click.echo(f"Calibration: {recording.calibration_of([c.name for c in recording.channels])}")
    for text in _descriptions(recording):
        click.echo(f"Description: {text}")
    for flag in recording.flags:
        click.echo(f"Flag: {flag}")
    for note in recording.notes:
        click.echo(f"Note: {note}.")


def _show_sheet(sheet: Sheet) -> None:
    click.echo()
    if sheet.above:
        click.echo(sheet.above)
    table(sheet.title, sheet.header, sheet.rows)
    if sheet.below:
        click.echo(sheet.below)


def _descriptions(recording: Recording) -> list[str]:
    """Notes that somebody wrote into the file or its groups."""
    places = [recording.properties, *recording.group_properties.values()]
    texts = [" ".join(str(p.get("Description", "")).split()) for p in places]
    return [text for text in dict.fromkeys(texts) if text]


def _headline(recording: Recording, path: Path) -> str:
    from specan.result import counted

    rates = sorted({c.sampling_rate for c in recording.channels})
    longest = max(c.duration_s for c in recording.channels)
    rate = " and ".join(f"{r:g}" for r in rates)
    size = path.stat().st_size / 1e6
    return f"{counted(len(recording.channels), 'channel')}, {longest:g} s at {rate} Hz, {size:.1f} MB"


def _content(
    recording: Recording, path: Path, excitation: Excitation, quality: dict[int, tuple[float, Quality]]
) -> dict[str, Any]:
    found = {**recording.to_json(), "size_bytes": path.stat().st_size}
    found["excitation"] = {
        "kind": excitation.kind,
        "frequency_hz": excitation.frequency_hz,
        "reason": excitation.reason,
    }
    for place, (rms, seen) in quality.items():
        found["channels"][place] |= {
            "rms": rms,
            "minimum": seen.minimum,
            "maximum": seen.maximum,
            "n_not_finite": seen.n_not_finite,
            "flags": seen.flags,
        }
    return found
