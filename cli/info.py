"""``specan info``: what is in a recording, and how each thing was decided."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from specan_cli.output import Verb, draw, emit_json, plot_option, say, table
from specan_cli.recording_verb import expand, opening_options

if TYPE_CHECKING:
    from specan.data.channel import Channel
    from specan.data.levels import Quality
    from specan.data.recording import Recording
    from specan.data.tone import Excitation

# Properties that the table of channels already shows, or that only say how the file was written.
_SHOWN = {"unit_string", "Unit_String", "QuantityUnit", "Sensitivity", "SensitivityUnit", "name"}
_MANY = 40  # channels; beyond them equal rows are joined
_LINES = 30  # of properties; the others are told with --all


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
    for all recordings in it.

    \b
    specan info sample_data/recordings/knock.tdms --plot waveforms.png
    """
    from specan.analysis.excitation import recognise
    from specan.analysis.quality import rms_and_quality
    from specan.errors import InputError, RequestError
    from specan.io.open import open_recording

    seen: list[dict[str, Any]] = []
    failures: list[dict[str, str]] = []
    found = expand(files)
    if plot is not None and len(found) > 1:
        raise RequestError(f"--plot draws one recording, and there are {len(found)}", remedy="name one")
    for item in found:
        try:
            recording = open_recording(item.path, label=item.label, **opening)
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
            _show(recording, item.path, excitation, quality, show_all)
            seen.append({})
        draw(recording, plot)
    if not seen:
        raise InputError("no file could be read", remedy="see the reasons above")
    if as_json:
        emit_json({"files": seen, "failures": failures})
    return 1 if failures else 0


def _show(
    recording: Recording,
    path: Path,
    excitation: Excitation,
    quality: dict[int, tuple[float, Quality]],
    show_all: bool,
) -> None:
    click.echo(f"{recording.label}: {_headline(recording, path)}")
    tone = f" at {excitation.frequency_hz:g} Hz" if excitation.frequency_hz else ""
    click.echo(f"Excitation: {excitation.kind}{tone} ({excitation.reason})")
    for text in _descriptions(recording):
        click.echo(f"Description: {text}")
    for flag in recording.flags:
        click.echo(f"Flag: {flag}")
    for note in recording.notes:
        click.echo(f"Note: {note}.")
    click.echo()
    _show_channels(recording, quality, show_all)
    _show_decisions(recording)
    _show_set_aside(recording, show_all)
    _show_properties(recording, show_all)


def _descriptions(recording: Recording) -> list[str]:
    """Notes that somebody wrote into the file or its groups."""
    places = [recording.properties, *recording.group_properties.values()]
    texts = [" ".join(str(p.get("Description", "")).split()) for p in places]
    return [text for text in dict.fromkeys(texts) if text]


def _headline(recording: Recording, path: Path) -> str:
    rates = sorted({c.sampling_rate for c in recording.channels})
    longest = max(c.duration_s for c in recording.channels)
    rate = " and ".join(f"{r:g}" for r in rates)
    size = path.stat().st_size / 1e6
    return f"{len(recording.channels)} channels, {longest:g} s at {rate} Hz, {size:.1f} MB"


def _show_channels(recording: Recording, quality: dict[int, tuple[float, Quality]], show_all: bool) -> None:
    """One table a group; what all channels of a group share is in its title."""
    for group in dict.fromkeys(c.group for c in recording.channels):
        places = [k for k, c in enumerate(recording.channels) if c.group == group]
        columns: dict[str, list[Any]] = {}
        for place in places:
            row = _row(recording.channels[place], quality.get(place))
            for key, value in row.items():
                columns.setdefault(key, []).append(value)
        title = f"{group}: " if group else ""
        shared = []
        for key, word in (("rate Hz", "Hz"), ("samples", "samples")):
            if len(set(columns[key])) == 1:
                shared.append(f"{columns.pop(key)[0]} {word}")
        columns = {key: values for key, values in columns.items() if key == "channel" or any(values)}
        rows = [list(row) for row in zip(*columns.values(), strict=True)]
        if len(rows) > _MANY and not show_all:
            rows = _joined(rows)
        click.echo(title + ", ".join([f"{len(places)} channels", *shared]))
        table("", list(columns), rows)
        click.echo()


def _row(c: Channel, quality: tuple[float, Quality] | None) -> dict[str, str]:
    row = {
        "channel": c.name,
        "role": c.role,
        "unit": c.unit + ("" if c.unit == c.target_unit else f" (to {c.target_unit})"),
        "rate Hz": f"{c.sampling_rate:g}",
        "samples": str(c.n_samples),
        "sensitivity": _sensitivity(c),
        "full scale": "" if c.full_scale is None else f"{c.full_scale:.4g}",
        "delay s": f"{c.delay_s:g} +- {c.u_delay_s:g}" if c.delay_s or c.u_delay_s else "",
    }
    if quality is not None:
        rms, found = quality
        peak = max(abs(found.minimum), abs(found.maximum))
        row |= {"RMS": f"{rms:.4g}", "peak": f"{peak:.4g}", "flags": " ".join(found.flags)}
    return row


def _joined(rows: list[list[str]]) -> list[list[str]]:
    """Rows that differ in the channel's name alone become one."""
    alike: dict[tuple[str, ...], list[str]] = {}
    for name, *rest in rows:
        alike.setdefault(tuple(rest), []).append(name)
    return [[_names(names), *rest] for rest, names in alike.items()]


def _sensitivity(channel: Channel) -> str:
    """Sensitivity as an engineer reads it, from the gain."""
    if channel.raw_unit != "V" or channel.unit == "V":
        return ""
    if channel.unit == "Pa":
        return f"{1e3 * channel.raw_scale / channel.gain:.4g} mV/Pa"
    return f"{channel.gain / channel.raw_scale:.4g} ({channel.unit})/V"


def _show_decisions(recording: Recording) -> None:
    """How each thing was decided; equal reasons once, with the channels that they hold for."""
    rows = []
    for key in dict.fromkeys(key for c in recording.channels for key in c.decisions):
        reasons: dict[str, list[str]] = {}
        for c in recording.channels:
            if reason := c.decisions.get(key):
                value = {"role": f"{c.role}: ", "sampling_rate": f"{c.sampling_rate:g} Hz: "}.get(key, "")
                reasons.setdefault(value + reason.replace(repr(c.name), "of the channel"), []).append(c.name)
        rows += [[key.replace("_", " "), _names(names), reason] for reason, names in reasons.items()]
    table("How it was decided", ["", "channels", "reason"], rows)


def _show_set_aside(recording: Recording, show_all: bool) -> None:
    if not recording.set_aside:
        return
    click.echo()
    reasons: dict[str, list[str]] = {}
    for name, reason in recording.set_aside.items():
        reasons.setdefault(reason, []).append(name)
    rows = [[", ".join(n) if show_all else _names(n), reason] for reason, n in reasons.items()]
    table("Set aside", ["channels", "reason"], rows)


def _show_properties(recording: Recording, show_all: bool) -> None:
    """Properties of file and groups, and those of channels that no standard names."""
    rows = [["file", key, value] for key, value in recording.properties.items()]
    for group, properties in recording.group_properties.items():
        rows += [[group, key, value] for key, value in properties.items()]
    own: dict[tuple[str, str], list[str]] = {}
    for c in recording.channels:
        for key, value in c.properties.items():
            if key not in _SHOWN and not key.startswith("wf_"):
                own.setdefault((key, str(value)), []).append(c.name)
    rows += [[_names(names), key, value] for (key, value), names in own.items()]
    if not show_all:
        rows = [row for row in rows if not row[1].startswith("NI_") and row[1] != "Description"]
    if not rows:
        return
    click.echo()
    lines = rows if show_all else rows[:_LINES]
    table(
        "Properties", ["of", "key", "value"], [[of, key, _text(value, show_all)] for of, key, value in lines]
    )
    if len(rows) > len(lines):
        click.echo(f"... and {len(rows) - len(lines)} more (--all)")


def _names(names: Iterable[str]) -> str:
    names = list(names)
    if len(names) <= 3:
        return ", ".join(names)
    return f"{names[0]} ... {names[-1]} ({len(names)})"


def _text(value: Any, whole: bool) -> str:
    text = " ".join(str(value).split())
    return text if whole or len(text) <= 100 else text[:97] + "..."


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
