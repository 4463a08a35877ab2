"""What is in a recording, as tables: channels, how each thing was decided, what was set aside, properties."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import chain
from typing import Any

from specan.data.channel import Channel
from specan.data.levels import Quality
from specan.data.recording import Recording
from specan.result import Sheet, counted, gathered

# Properties that the table of channels already shows, or that only say how the file was written.
_SHOWN = {"unit_string", "Unit_String", "QuantityUnit", "Sensitivity", "SensitivityUnit", "name"}
_MANY = 40  # channels; beyond them equal rows are joined
_LINES = 30  # of properties


def sheets(
    recording: Recording, quality: Mapping[int, tuple[float, Quality]], show_all: bool = False
) -> Iterator[Sheet]:
    """The tables, some without rows; with `show_all` every channel has its row, and every property its whole text.

    Parameters
    ----------
    recording : Recording
    quality : mapping
        Of the channel of a number: RMS, and what its samples say of themselves.
    show_all : bool
    """
    for group in dict.fromkeys(c.group for c in recording.channels):
        yield _channels(recording, group, quality, show_all)
    yield Sheet("How it was decided", ["", "channels", "reason"], _decisions(recording))
    aside = recording.set_aside.items()
    reasons = gathered((why.replace(repr(n.rpartition("/")[2]), "the channel"), n) for n, why in aside)
    rows = [[", ".join(n) if show_all else _names(n), reason] for reason, n in reasons.items()]
    yield Sheet("Ignored", ["channels", "reason"], rows)
    properties = _properties(recording, show_all)
    few = properties if show_all else properties[:_LINES]
    more = f"... and {len(properties) - len(few)} more (--all)" if len(few) < len(properties) else ""
    rows = [[of, key, _text(value, show_all)] for of, key, value in few]
    yield Sheet("Properties", ["of", "key", "value"], rows, more)


def _channels(
    recording: Recording, group: str, quality: Mapping[int, tuple[float, Quality]], show_all: bool
) -> Sheet:
    """Of one group; what all its channels share is above the table."""
    places = [k for k, c in enumerate(recording.channels) if c.group == group]
    cells = (_row(recording.channels[place], quality.get(place)).items() for place in places)
    columns = gathered(chain.from_iterable(cells))
    shared = []
    for key, word in (("rate Hz", "Hz"), ("samples", "samples")):
        if len(set(columns[key])) == 1:
            shared.append(f"{columns.pop(key)[0]} {word}")
    rows = [list(row) for row in zip(*columns.values(), strict=True)]
    if len(rows) > _MANY and not show_all:
        alike = gathered((tuple(rest), name) for name, *rest in rows)
        rows = [[_names(names), *rest] for rest, names in alike.items()]
    above = (f"{group}: " if group else "") + ", ".join([counted(len(places), "channel"), *shared])
    return Sheet(above, list(columns), rows)


def _row(c: Channel, quality: tuple[float, Quality] | None) -> dict[str, str]:
    row = {
        "channel": c.label,
        "role": c.role,
        "unit": c.unit + ("" if c.unit == c.target_unit else f" (to {c.target_unit})"),
        "rate Hz": f"{c.sampling_rate:g}",
        "samples": str(c.n_samples),
        "sensitivity": _sensitivity(c),
        "full scale": "" if c.full_scale is None else f"{c.full_scale:.6g} {c.unit}".removesuffix(" 1"),
        "delay s": f"{c.delay_s:g} +- {c.u_delay_s:g}" if c.delay_s or c.u_delay_s else "",
    }
    if quality is not None:
        rms, found = quality
        peak = max(abs(found.minimum), abs(found.maximum))
        row |= {"RMS": f"{rms:.4g}", "peak": f"{peak:.4g}", "flags": " ".join(found.flags)}
    return row


def _sensitivity(channel: Channel) -> str:
    """Sensitivity as an engineer reads it, from the gain."""
    if channel.raw_unit != "V" or channel.unit == "V":
        return ""
    if channel.unit == "Pa":
        return f"{1e3 * channel.raw_scale / channel.gain:.4g} mV/Pa"
    return f"{channel.gain / channel.raw_scale:.4g} ({channel.unit})/V"


def _decisions(recording: Recording) -> list[list[str]]:
    """How each thing was decided; equal reasons once, with the channels that they hold for."""
    rows = []
    for key in dict.fromkeys(key for c in recording.channels for key in c.decisions):
        told = (c for c in recording.channels if c.decisions.get(key))
        reasons = gathered((_reason(c, key), c.label) for c in told)
        rows += [
            [key.replace("_", " "), _names(names, recording), reason] for reason, names in reasons.items()
        ]
    return rows


def _reason(c: Channel, key: str) -> str:
    value = {"role": f"{c.role}: ", "sampling_rate": f"{c.sampling_rate:g} Hz: "}.get(key, "")
    return value + c.decisions[key].replace(repr(c.name), "of the channel")


def _properties(recording: Recording, show_all: bool) -> list[list[Any]]:
    """Properties of file and groups, and those of channels that no standard names."""
    rows = [["file", key, value] for key, value in recording.properties.items()]
    for group, properties in recording.group_properties.items():
        rows += [[group, key, value] for key, value in properties.items()]
    own: dict[tuple[str, str], list[str]] = {}
    for c in recording.channels:
        for key, value in c.properties.items():
            if key not in _SHOWN and not key.startswith("wf_"):
                own.setdefault((key, str(value)), []).append(c.label)
    rows += [[_names(names, recording), key, value] for (key, value), names in own.items()]
    if not show_all:
        rows = [row for row in rows if not row[1].startswith("NI_") and row[1] != "Description"]
    return rows


def _names(names: Iterable[str], recording: Recording | None = None) -> str:
    """Names in short; "all" where they are all channels of a recording."""
    names = list(names)
    if recording is not None and 1 < len(names) == len(recording.channels):
        return f"all ({len(names)})"
    if len(names) <= 3:
        return ", ".join(names)
    return f"{names[0]} ... {names[-1]} ({len(names)})"


def _text(value: Any, whole: bool) -> str:
    text = " ".join(str(value).split())
    return text if whole or len(text) <= 100 else text[:97] + "..."
