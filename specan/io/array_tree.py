"""Signals among the named arrays of a MAT or HDF5 file, by the names that laboratories give them.

Nothing in these formats says what is a signal. A real array with many more samples than channels is one; its
sampling rate, unit and name are beside it or further up, as attributes, members or variables with usual names.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from specan.data.recording import Recording
from specan.io.sampling_rate import INTERVAL_KEYS, RATE_KEYS, TIME_UNITS, Rate, is_rate, is_time, rate_of_axis
from specan.io.signals import Opening, Signal

Path = tuple[str, ...]
LEAST = 16  # samples below which an array is a list of parameters

# Beside the keys that acquisition programs write.
_RATES = RATE_KEYS | {
    "rate", "fsample", "fsamp", "srate", "sr", "samplesperseconds", "samplingratehz", "sampleratehz", "fshz",
}  # fmt: skip
_STEPS = INTERVAL_KEYS | {"increment", "wfincrement", "xincrement", "xdelta", "sampletime", "tsample", "ts"}
_NAMES = {
    "names", "name", "channels", "channelnames", "channelname", "labels", "label", "signals", "signalnames",
}  # fmt: skip
_UNITS = {"units", "unit", "unitname", "unitstring", "channelunits", "ylabelunit", "quantityunit"}
# Names that say nothing of a signal.
_BARE = {"data", "values", "value", "y", "samples", "signal", "x", "array"}


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

    @property
    def why_no_signal(self) -> str:
        """Why its numbers are no time signals; empty where they may be."""
        if self.kind not in "fiu":
            return "complex numbers are no time signal" if self.kind == "c" else "no real numbers"
        if sum(length > 1 for length in self.shape) > 2 or self.n_samples < 4 * self.n_channels:
            return f"an array of the shape {self.shape} is not a set of signals"
        return ""


def column_of(data: Any, start: int, stop: int, column: int) -> np.ndarray:
    """Samples of one of the signals that an array, or a data set of a file, holds along its longest side."""
    long = int(np.argmax(data.shape))
    index: list[Any] = [0] * len(data.shape)
    index[long] = slice(start, stop)
    for other in [k for k, length in enumerate(data.shape) if length > 1 and k != long][:1]:
        index[other] = column
    return np.asarray(data[tuple(index)])


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

    def put(self, where: Path, value: Any) -> None:
        """Take up a word, a list of words or a number; anything else says nothing."""
        flat = [v.decode("utf-8", "replace") if isinstance(v, bytes) else v for v in np.ravel(value).tolist()]
        if flat and all(isinstance(v, str) for v in flat):
            self.words[where] = flat[0].strip() if len(flat) == 1 else [v.strip() for v in flat]
        elif len(flat) == 1 and isinstance(flat[0], (int, float)):
            self.numbers[where] = float(flat[0])

    def recording(self, opening: Opening) -> Recording:
        """The recording of the signals among the arrays.

        Raises
        ------
        InputError
            There is none.
        """
        signals: list[Signal] = []
        places: list[tuple[Array, int]] = []
        aside = dict(self.aside)
        for path, array in self.arrays.items():
            if array.size < LEAST or not array.n_samples:
                continue
            rate: Rate | str | None = array.why_no_signal
            if not rate:
                if _is_axis(path, array):
                    continue
                rate = _rate(self, path, array)
            if isinstance(rate, str):
                aside["/".join(path)] = rate
                continue
            for column, (own, unit) in enumerate(zip(*_said(self, path, array), strict=True)):
                signals.append(Signal(own, array.n_samples, unit, rate, "/".join(path[:-1])))
                places.append((array, column))
        return opening.recording(signals, TreeSource(places), aside)


def _is_axis(path: Path, array: Array) -> bool:
    plain = path[-1].strip()
    return array.n_channels == 1 and (is_time(plain, "", {}) or plain.lower() in ("x_values", "xdata"))


def _scopes(path: Path) -> Iterator[Path]:
    """The array itself (its attributes), then what lies beside it, then further up."""
    for end in range(len(path), -1, -1):
        yield path[:end]


def _plain(name: str) -> str:
    return re.sub(r"[^a-z]", "", name.lower())


def _rate(tree: Tree, path: Path, array: Array) -> Rate | str | None:
    """Sampling rate, or why a time axis gives none."""
    for scope in _scopes(path):
        for where, number in tree.numbers.items():
            if where[: len(scope)] != scope or len(where) > len(scope) + 2:
                continue
            if len(where) == len(scope) + 2 and _plain(where[-2]) not in ("xvalues", "xdata", "time", "x"):
                continue  # an increment stands inside the description of the axis
            plain, said = _plain(where[-1]), "/".join(where)
            if plain in _RATES and is_rate(number):
                return Rate(float(number), f"{said} = {number:g}")
            if plain in _STEPS and number > 0 and is_rate(1 / number):
                return Rate(1 / float(number), f"{said} = {number:g} s")
        for where, other in tree.arrays.items():
            if where[:-1] == scope and other.n_samples == array.n_samples and _is_axis(where, other):
                unit = next(
                    (str(tree.words[w]) for w in tree.words if w[:-1] == where and _plain(w[-1]) in _UNITS),
                    "",
                )
                known = {"unit_string": unit} if unit.lower() in TIME_UNITS else {}
                read = partial(other.read, column=0)
                return rate_of_axis(where[-1], "DoubleFloat", known, other.n_samples, read)
    return None


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
    """Samples of signals in arrays and their columns; implements `specan.data.recording.SampleSource`."""

    places: Sequence[tuple[Array, int]]

    def read(self, indices: Sequence[int], start: int, stop: int) -> Any:
        """Samples of the chosen channels; see SampleSource."""
        chosen = [self.places[i] for i in indices]
        return np.stack([np.asarray(array.read(start, stop, k), dtype=np.float64) for array, k in chosen])
