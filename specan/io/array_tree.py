"""Signals among the named arrays of a MAT or HDF5 file, by the names that laboratories give them.

Nothing in these formats says what is a signal. A real array with many more samples than channels is one; its
sampling rate, unit and name are beside it or further up, as attributes, members or variables with usual names.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from specan.data.recording import Recording, SampleSource
from specan.errors import NoSignalError
from specan.io.channel_table import ChannelTable, channel_of
from specan.io.roles import identify
from specan.io.sampling_rate import TIME_UNITS, Rate, axis_of, is_rate, is_time

Path = tuple[str, ...]
LEAST = 16  # samples below which an array is a list of parameters

_RATES = {
    "fs", "rate", "samplerate", "samplingrate", "samplefrequency", "samplingfrequency", "samplingfreq", "fsample",
    "fsamp", "srate", "sr", "samplesperseconds", "samplespersecond", "samplingratehz", "sampleratehz", "fshz",
}  # fmt: skip
_STEPS = {
    "dt", "deltat", "increment", "wfincrement", "xincrement", "xdelta", "samplingperiod", "sampleperiod",
    "samplinginterval", "sampleinterval", "sampletime", "tsample", "ts",
}  # fmt: skip
_NAMES = {
    "names",
    "name",
    "channels",
    "channelnames",
    "channelname",
    "labels",
    "label",
    "signals",
    "signalnames",
}
_UNITS = {"units", "unit", "unitname", "unitstring", "channelunits", "ylabelunit", "quantityunit"}
_BARE = {
    "data",
    "values",
    "value",
    "y",
    "samples",
    "signal",
    "x",
    "array",
}  # names that say nothing of a signal


@dataclass(frozen=True)
class Array:
    """An array of a file, which need not be in memory.

    Attributes
    ----------
    shape : tuple of int
    kind : str
        As numpy's ``dtype.kind``.
    read : callable
        ``read(start, stop, column) -> array`` of one column of it, samples along the longer axis.
    """

    shape: tuple[int, ...]
    kind: str
    read: Any = field(repr=False)

    @property
    def size(self) -> int:
        """Number of values."""
        return int(np.prod(self.shape))

    @property
    def n_samples(self) -> int:
        """Length of its longer axis."""
        return max(self.shape, default=0)

    @property
    def n_channels(self) -> int:
        """Length of its shorter axis."""
        return self.size // self.n_samples if self.n_samples else 0


@dataclass(frozen=True)
class Tree:
    """Arrays and words of a file by their paths.

    Attributes
    ----------
    arrays : mapping
        ``{path: Array}``.
    words : mapping
        ``{path: text or list of texts}``.
    numbers : mapping
        ``{path: number}`` of single ones.
    aside : mapping
        ``{name: reason}`` of what is not read.
    """

    arrays: dict[Path, Array] = field(default_factory=dict)
    words: dict[Path, Any] = field(default_factory=dict)
    numbers: dict[Path, float] = field(default_factory=dict)
    aside: dict[str, str] = field(default_factory=dict)

    def recording(
        self, label: str, channel_table: ChannelTable | None, sampling_rate: float | None
    ) -> Recording:
        """The recording of the signals among the arrays.

        Raises
        ------
        InputError
            There is none.
        """
        signals, places, aside = signals_of(self)
        return recording_of(
            label, signals, TreeSource(places),
            channel_table=channel_table, sampling_rate=sampling_rate, set_aside=aside,
        )  # fmt: skip


@dataclass(frozen=True)
class Place:
    """Where the samples of a signal lie: an array and its column."""

    array: Array
    column: int


def signals_of(tree: Tree) -> tuple[list[Signal], list[Place], dict[str, str]]:
    """Signals, where their samples lie, and what was set aside with the reason."""
    signals: list[Signal] = []
    places: list[Place] = []
    aside = dict(tree.aside)
    for path, array in tree.arrays.items():
        name = "/".join(path)
        if array.size < LEAST or not array.n_samples:
            continue
        if array.kind not in "fiu":
            aside[name] = "complex numbers are no time signal" if array.kind == "c" else "no real numbers"
            continue
        if sum(length > 1 for length in array.shape) > 2 or array.n_samples < 4 * array.n_channels:
            aside[name] = f"an array of the shape {array.shape} is not a set of signals"
            continue
        if _is_axis(path, array):
            continue
        rate, why = _rate(tree, path, array)
        if rate is None and why:
            aside[name] = why
            continue
        group = "/".join(path[:-1])
        for column, (own, unit) in enumerate(zip(*_said(tree, path, array), strict=True)):
            signals.append(Signal(own, array.n_samples, unit, rate, group))
            places.append(Place(array, column))
    return signals, places, aside


def _is_axis(path: Path, array: Array) -> bool:
    plain = path[-1].strip()
    return array.n_channels == 1 and (is_time(plain, "", {}) or plain.lower() in ("x_values", "xdata"))


def _scopes(path: Path) -> Iterator[Path]:
    """The array itself (its attributes), then what lies beside it, then further up."""
    for end in range(len(path), -1, -1):
        yield path[:end]


def _plain(name: str) -> str:
    return re.sub(r"[^a-z]", "", name.lower())


def _rate(tree: Tree, path: Path, array: Array) -> tuple[Rate | None, str]:
    """Sampling rate, or why a time axis gives none."""
    for scope in _scopes(path):
        for where, number in tree.numbers.items():
            if where[: len(scope)] != scope or len(where) > len(scope) + 2:
                continue
            if len(where) == len(scope) + 2 and _plain(where[-2]) not in ("xvalues", "xdata", "time", "x"):
                continue  # an increment stands inside the description of the axis
            plain, said = _plain(where[-1]), "/".join(where)
            if plain in _RATES and is_rate(number):
                return Rate(float(number), f"{said} = {number:g}"), ""
            if plain in _STEPS and number > 0 and is_rate(1 / number):
                return Rate(1 / float(number), f"{said} = {number:g} s"), ""
        for where, other in tree.arrays.items():
            if where[:-1] == scope and other.n_samples == array.n_samples and _is_axis(where, other):
                unit = next(
                    (str(tree.words[w]) for w in tree.words if w[:-1] == where and _plain(w[-1]) in _UNITS),
                    "",
                )
                known = {"unit_string": unit} if unit.lower() in TIME_UNITS else {}
                axis = axis_of(
                    where[-1], "DoubleFloat", known, other.n_samples, partial(other.read, column=0)
                )
                return axis.rate, axis.why_not
    return None, ""


def _said(tree: Tree, path: Path, array: Array) -> tuple[list[str], list[str]]:
    """Name and unit of every channel of an array."""
    count = array.n_channels
    bare = path[-1].lower() in _BARE and len(path) > 1
    base = path[-2] if bare else path[-1]
    names = [base] if count == 1 else [f"{base} {k + 1}" for k in range(count)]
    units = [""] * count
    found = _list_for(tree, path, count, _NAMES, beside=count > 1 or bare)
    names = found or names
    units = _list_for(tree, path, count, _UNITS, beside=True) or units
    for k, name in enumerate(names):
        for ending in ("_unit", "_units", "Unit"):
            said = tree.words.get((*path[:-1], f"{name}{ending}"))
            if isinstance(said, str) and not units[k]:
                units[k] = said
    return names, units


def _list_for(tree: Tree, path: Path, count: int, keys: set[str], beside: bool) -> list[str]:
    """A list of as many words as there are channels, from the array's attributes or from beside it."""
    for scope in _scopes(path):
        if scope != path and not beside:
            break
        for where, said in tree.words.items():
            if where[:-1] != scope or _plain(where[-1]) not in keys:
                continue
            words = [said] if isinstance(said, str) else [str(word) for word in said]
            if len(words) == count:
                return words
            if len(words) == 1 and keys is _UNITS and scope == path:
                return words * count
    return []


@dataclass(frozen=True)
class TreeSource:
    """Samples of signals in arrays; implements `specan.data.recording.SampleSource`."""

    places: Sequence[Place]

    def read(self, indices: Sequence[int], start: int, stop: int) -> Any:
        """Samples of the chosen channels; see SampleSource."""
        chosen = [self.places[i] for i in indices]
        return np.stack([np.asarray(p.array.read(start, stop, p.column), dtype=np.float64) for p in chosen])


@dataclass(frozen=True)
class Signal:
    """One signal of a file: what is known of it beside its samples.

    Attributes
    ----------
    unit : str
        Of the samples, as the file writes it; empty where it does not.
    rate : Rate or None
        None where nothing in the file says it.
    """

    name: str
    n_samples: int
    unit: str = ""
    rate: Rate | None = None
    group: str = ""


def recording_of(
    label: str,
    signals: Sequence[Signal],
    source: SampleSource,
    *,
    channel_table: ChannelTable | None = None,
    sampling_rate: float | None = None,
    set_aside: Mapping[str, str] | None = None,
) -> Recording:
    """A recording of signals, channel by channel in their order.

    Parameters
    ----------
    label : str
    signals : sequence of Signal
    source : SampleSource
        Channel k of it is signal k.
    channel_table, sampling_rate
        As for `specan.io.open.open_recording`.
    set_aside : mapping, optional
        See `specan.data.recording.Recording`.

    Raises
    ------
    InputError
        There is no signal.
    """
    if not signals:
        why = "; ".join(f"{name}: {reason}" for name, reason in list((set_aside or {}).items())[:4])
        raise NoSignalError(f"{label} holds no time signal" + (f" ({why})" if why else ""))
    channels = []
    for place, signal in enumerate(signals):
        identity = identify(signal.name, {"unit_string": signal.unit} if signal.unit else {})
        channel = channel_of(identity, signal.name, signal.group, label, channel_table)
        rate, how = (signal.rate.hz, signal.rate.how) if signal.rate else (0.0, "nothing says it")
        if channel.sampling_rate:
            rate, how = channel.sampling_rate, channel.decisions["sampling_rate"]
        if sampling_rate is not None:
            rate, how = float(sampling_rate), "said by the user"
        channels.append(
            replace(
                channel,
                sampling_rate=rate,
                n_samples=signal.n_samples,
                source_index=place,
                decisions={**channel.decisions, "sampling_rate": how},
            )
        )
    return Recording(label, tuple(channels), source, set_aside=set_aside or {})
