"""``specan info``: what is in a recording, and how each thing was decided."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from specan_cli.options import opening_options, opt
from specan_cli.output import show_apart, table
from specan_cli.verb import Delivery, expand, failures, left_out, plot_option, reader, verb

if TYPE_CHECKING:
    from specan.data.levels import Quality
    from specan.data.recording import Recording
    from specan.data.tone import Excitation


@verb("info")
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="FILE...")
@opening_options
@opt("--levels", bool, "Read all samples: RMS, peak, clipped, dead, NaN.")
@opt("--all show_all", bool, "Every channel and the whole of every property.")
@plot_option("the waveforms of one recording")
@opt("--json as_json", bool, "Everything, as JSON.")
def command(files: tuple[Path, ...], levels: bool, show_all: bool, deliver: Delivery, **opening: Any) -> int:
    """Show groups, channels, roles, rates, units, excitation, notes and integrity of recordings.

    Only headers are read, and a few seconds of one channel to distinguish sine and noise. A directory stands for all
    recordings in it. Each of several has one line; --all shows everything of each.

    \b
    specan info sample_data/recordings/knock.tdms --plot waveforms.png
    """
    from specan.analysis.excitation import recognise
    from specan.analysis.quality import rms_and_quality
    from specan.errors import InputError, RequestError
    from specan.report.contents import sheets

    seen: list[dict[str, Any]] = []
    opened: list[tuple[Recording, Excitation, dict[int, tuple[float, Quality]]]] = []
    faults: dict[str, Exception] = {}
    found = expand(files)
    if deliver.plot is not None and len(found) > 1:
        raise RequestError(f"--plot draws one recording, and there are {len(found)}", remedy="name one")
    read = reader(opening)
    for item in found:
        with left_out(item.label, faults, len(found) > 1):
            recording = replace(read(item.path), label=item.label)
            excitation = recognise(recording)
            quality = rms_and_quality(recording) if levels else {}
            seen.append(_content(recording, item.path, excitation, quality))
            opened.append((recording, excitation, quality))
            deliver.draw(recording)
    if not seen:
        raise InputError("no file could be read", remedy="see the reasons above")

    def show() -> None:
        if len(found) > 1 and not show_all:
            _print_rows([_row(recording, excitation) for recording, excitation, _ in opened])
            return
        for content, (recording, excitation, quality) in zip(seen, opened, strict=True):
            click.echo("\n".join(_lines(recording, content["size_bytes"], excitation)))
            show_apart(*sheets(recording, quality, show_all))

    deliver.put_out({"files": seen, "failures": failures(faults)}, show)
    return 1 if faults else 0


def _print_rows(rows: list[list[Any]]) -> None:
    """A line for each recording; one calibration of all stands below them."""
    calibrations = {row[-1] for row in rows}
    for row in rows:
        row[-1] = row[-1].removesuffix(" sensitivities") if len(calibrations) > 1 else ""
    table("", ["file", "excitation", "tone", "channels", "s", "Hz", "flags", "calibration"], rows)
    if len(calibrations) == 1:
        click.echo(f"Calibration: {calibrations.pop()}.")


def _row(recording: Recording, excitation: Excitation) -> list[Any]:
    """One of several recordings, on one line."""
    channels = recording.channels
    rate = "/".join(f"{r:g}" for r in sorted({c.sampling_rate for c in channels}))
    tone = f"{excitation.frequency_hz:g}" if excitation.frequency_hz else ""
    duration = f"{max(c.duration_s for c in channels):g}"
    calibration = recording.calibration_of([c.name for c in channels])
    flags = " ".join(recording.flags)
    return [recording.label, excitation.kind, tone, len(channels), duration, rate, flags, calibration]


def _lines(recording: Recording, size: int, excitation: Excitation) -> list[str]:
    """What is said above the tables."""
    from specan.data.recording import properties_called
    from specan.result import counted

    label, kind, tone, channels, seconds, rate, _, calibration = _row(recording, excitation)
    written = dict.fromkeys(
        " ".join(str(text).split()) for _, text in properties_called("Description", recording)
    )
    amount = f"{size / 1e6:.1f} MB" if size >= 1e6 else f"{size / 1e3:.0f} kB"
    return [
        f"{label}: {counted(channels, 'channel')}, {seconds} s at {rate} Hz, {amount}",
        f"Excitation: {kind}{tone and f' at {tone} Hz'} ({excitation.reason})",
        f"Calibration: {calibration}",
        *(f"Description: {text}" for text in written),
        *(f"Flag: {flag}" for flag in recording.flags),
        *(f"Note: {note}." for note in recording.notes),
    ]


def _content(
    recording: Recording, path: Path, excitation: Excitation, quality: dict[int, tuple[float, Quality]]
) -> dict[str, Any]:
    from specan.result import picked

    found = {**recording.to_dict(), "size_bytes": path.stat().st_size}
    found["excitation"] = picked(excitation, "kind frequency_hz reason")
    for place, (rms, seen) in quality.items():
        found["channels"][place] |= {"rms": rms, **picked(seen, "minimum maximum flags")}
    return found
