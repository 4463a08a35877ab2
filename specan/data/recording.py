"""A recording: channels that know their unit, role and calibration, and samples that are read on demand."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from specan.arrays import Real
from specan.data.channel import Channel, Role, channels_matching, channels_meant, plain_properties, si_unit
from specan.errors import InputError, RequestError, library, nearest
from specan.result import Result, Sheet, counted, gathered, picked, shortened
from specan.units import MOTION, Quantity

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr


class SampleSource(Protocol):
    """Where samples come from; a file format implements this."""

    def read(self, indices: Sequence[int], start: int, stop: int) -> Real:
        """Samples `start` to `stop` of the channels `indices`, after the file's own scaling.

        Returns an array (len(indices), stop - start). All channels of one call have the same rate.
        """
        ...


@dataclass(frozen=True)
class ArraySource:
    """Samples held in memory, one array a channel."""

    samples: Sequence[Real]

    def read(self, indices: Sequence[int], start: int, stop: int) -> Real:
        """Samples of the chosen channels; see SampleSource."""
        return np.stack([np.asarray(self.samples[i][start:stop], dtype=np.float64) for i in indices])


Watch: TypeAlias = Callable[[Iterator[Real], Sequence[Channel], int], Iterator[Real]]


@dataclass(frozen=True, repr=False)
class Recording(Result):
    """Channels, properties and a source of samples.

    Attributes
    ----------
    label : str
        Path relative to the directory that was named, with forward slashes; goes into results.
    channels : tuple of Channel
        In the order of the file.
    source : SampleSource
        Reads samples in the unit of the file.
    properties, group_properties : mapping
        What the file says of itself, and of each of its groups.
    flags : tuple of str
        Words such as ``truncated`` that concern the whole file.
    notes : tuple of str
        Sentences for the reader about what was found and decided.
    set_aside : mapping
        ``group/name`` of channels that are no time signals, and why.
    watch : callable, optional
        ``watch(blocks, channels, length)`` hands on the blocks of a section of so many samples.
    """

    label: str
    channels: tuple[Channel, ...]
    source: SampleSource
    properties: Mapping[str, Any] = field(default_factory=dict)
    group_properties: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    flags: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    set_aside: Mapping[str, str] = field(default_factory=dict)
    watch: Watch | None = None

    def __post_init__(self) -> None:
        """Tell every channel its place in the source, and whether another one has its name."""
        alike = Counter(c.name for c in self.channels)

        def told(place: int, channel: Channel) -> Channel:
            shared = channel.shares_name or alike[channel.name] > 1
            index = place if channel.source_index < 0 else channel.source_index
            if (index, shared) == (channel.source_index, channel.shares_name):
                return channel
            return replace(channel, source_index=index, shares_name=shared)

        object.__setattr__(self, "channels", tuple(told(k, c) for k, c in enumerate(self.channels)))

    @classmethod
    def from_arrays(
        cls,
        samples: Mapping[str, ArrayLike],
        sampling_rate: float,
        *,
        units: Mapping[str, str] | None = None,
        roles: Mapping[str, Role] | None = None,
        label: str = "arrays",
    ) -> Recording:
        """A recording of arrays in memory.

        Parameters
        ----------
        samples : mapping of str to array (n,)
            By the names of the channels.
        sampling_rate : float
            In hertz, of all channels.
        units : mapping of str to str, optional
            Of the samples: ``Pa``, ``mV``, ``m/s^2``; no unit by default. An unknown unit stays as it is.
        roles : mapping of str to str, optional
            ``microphone``, ``vibrometer``, ``generator``, ``accelerometer``, ``tacho`` ...; by default
            ``microphone`` for a sound pressure and ``other`` for the rest.
        label : str
            What results say that they are of.

        Returns
        -------
        Recording
            With one channel for each array.

        Raises
        ------
        RequestError
            An array has more than one dimension.

        Examples
        --------
        >>> tone = np.sin(2 * np.pi * 100 * np.arange(8000) / 8000)
        >>> Recording.from_arrays({"Mic 1": tone}, 8000, units={"Mic 1": "Pa"})
        <Recording: arrays, 1 channel, 1 s at 8000 Hz>
        """
        for what, given in {"samples": samples, "units": units or {}, "roles": roles or {}}.items():
            if not isinstance(given, Mapping):
                raise RequestError(f"{what} is {given!r:.60}", expected="a dict with a name for each channel")
        arrays = {name: np.asarray(values, dtype=np.float64) for name, values in samples.items()}
        channels = []
        for name, values in arrays.items():
            if values.ndim != 1:
                raise RequestError(
                    f"{name!r} is an array of the shape {values.shape}", expected="one channel for each array"
                )
            unit, scale = si_unit((units or {}).get(name, "1"))
            role = (roles or {}).get(name, "microphone" if unit == "Pa" else "other")
            channels.append(
                Channel(
                    name, unit=unit, role=role, sampling_rate=float(sampling_rate), n_samples=values.size,
                    raw_unit=unit, raw_scale=scale, gain=scale,
                )
            )  # fmt: skip
        return cls(label, tuple(channels), ArraySource(list(arrays.values())))

    def __len__(self) -> int:
        return len(self.channels)

    def __iter__(self) -> Iterator[Channel]:
        return iter(self.channels)

    def __getitem__(self, name: str | int) -> Channel:
        return self.channels[name] if isinstance(name, int) else self.channel(name)

    def __contains__(self, name: object) -> bool:
        return name in (*self.channels, *(c.name for c in self.channels))

    def summary(self) -> str:
        """What it is, on one line.

        Returns
        -------
        str
            Label, channels, duration in seconds, rates in hertz.
        """
        rates = sorted({c.sampling_rate for c in self.channels})
        longest = max((c.duration_s for c in self.channels), default=0.0)
        at = ", ".join(f"{rate:g} Hz" for rate in rates)
        return f"{self.label}, {counted(len(self.channels), 'channel')}, {longest:.4g} s at {at}"

    def content(self) -> dict[str, Any]:
        """What `to_dict` gives; samples are not in it.

        Returns
        -------
        dict
            Label, flags, notes, properties, and every channel with how it was decided.
        """
        groups = self.group_properties.items()
        return {
            **picked(self, "file=label flags notes"),
            "properties": plain_properties(self.properties),
            "groups": {group: plain_properties(properties) for group, properties in groups},
            "channels": [channel.content() for channel in self.channels],
            "set_aside": dict(self.set_aside),
        }

    def in_quantity(self, quantity: Quantity) -> Recording:
        """The recording with all channels of motion to be shown as displacement, velocity or acceleration.

        Spectra are multiplied by j w, or divided by it (integration); samples stay as they were measured.

        Parameters
        ----------
        quantity : {"displacement", "velocity", "acceleration"}

        Returns
        -------
        Recording
            With the same samples.

        Raises
        ------
        RequestError
            No channel is one of motion.
        """
        channels = tuple(c.in_quantity(quantity) for c in self.channels)
        if not any(c.unit in MOTION for c in channels):
            raise RequestError(
                f"{self.label}: no channel can be shown as {quantity}",
                expected="a channel in m, m/s or m/s^2",
                remedy="give its unit in a channel table",
            )
        return replace(self, channels=channels)

    def sheets(self) -> list[Sheet]:
        """One row for each channel.

        Returns
        -------
        list of Sheet
            Name, group, role, unit, sampling rate, samples, duration.
        """
        header = ["channel", "group", "role", "unit", "rate Hz", "samples", "duration s"]
        rows = [
            [c.label, c.group, c.role, c.unit, f"{c.sampling_rate:g}", c.n_samples, f"{c.duration_s:g}"]
            for c in self.channels
        ]
        return [Sheet("", header, rows)]

    def to_dataframe(
        self, channels: Sequence[str] = (), start_s: float = 0.0, stop_s: float | None = None
    ) -> pd.DataFrame:
        """The samples: a row for each instant, a column for each channel, in the units of the channels.

        Parameters
        ----------
        channels : sequence of str
            Names or patterns; all by default. They must have one sampling rate.
        start_s, stop_s : float
            Time section.

        Returns
        -------
        pandas.DataFrame
            Index ``time_s``, in seconds.
        """
        import pandas as pd

        chosen = self.select([channels] if isinstance(channels, str) else channels)
        rate = chosen[0].sampling_rate
        start = round(start_s * rate)
        samples = self.read(chosen, start, None if stop_s is None else round(stop_s * rate))
        time = pd.Index(np.arange(start, start + samples.shape[1]) / rate, name="time_s")
        return pd.DataFrame(samples.T, index=time, columns=[c.label for c in chosen])

    def to_xarray(self) -> xr.Dataset:
        """The samples over ``time_s``, one variable for each channel.

        Returns
        -------
        xarray.Dataset
            In the units of the channels.

        Raises
        ------
        RequestError
            xarray is not installed.
        """
        library("xarray", "xarray")
        found = self.to_dataframe().to_xarray().assign_attrs(recording=self.label)
        for channel in self.channels:
            said = {"units": channel.unit, "role": channel.role, "calibration": channel.calibrated_by}
            found[channel.label].attrs.update({name: text for name, text in said.items() if text})
        return found

    def channel(self, name: str) -> Channel:
        """The channel of this name, or of this ``group/name``; any letters and the end of its name do as well.

        Parameters
        ----------
        name : str
            As the file has it, in any letters, or its end.

        Returns
        -------
        Channel
            The only one that is meant.

        Raises
        ------
        RequestError
            None is called so, or several are.
        InputError
            It is no time signal.
        """
        found = [c for c in self.channels if name in (c.name, c.path)]
        found = found or list(channels_meant(name, self.channels))
        if len(found) == 1:
            return found[0]
        if found:
            places = ", ".join(c.path for c in found)
            raise RequestError(f"{self.label}: {name!r} is in several groups", remedy=f"use one of {places}")
        for path, reason in self.set_aside.items():
            if name == path or path.endswith(f"/{name}"):
                raise InputError(f"{self.label}: {path!r} cannot be used: {reason}")
        raise RequestError(
            f"{self.label} has no channel {name!r}", remedy=nearest(name, [c.name for c in self.channels])
        )

    def calibration_of(self, names: Iterable[str | None]) -> str:
        """Which calibration channels have, in words.

        Parameters
        ----------
        names : iterable of str
            Names or ``group/name``; those of other channels are ignored.

        Returns
        -------
        str
            The file, ``nominal sensitivities``, or which channels have which.

        Examples
        --------
        >>> recording = Recording.from_arrays({"Mic 1": [0.0, 1.0]}, 8000, units={"Mic 1": "Pa"})
        >>> recording.calibration_of(["Mic 1"])
        'none'
        """
        wanted = set(names)
        of = gathered(
            (c.calibrated_by, c.name) for c in self.channels if c.calibrated_by and wanted & {c.name, c.path}
        )
        if len(of) < 2:
            return next(iter(of), "none")
        return "; ".join(f"{source} ({shortened(channels)})" for source, channels in of.items())

    def by_role(self, role: str) -> tuple[Channel, ...]:
        """Channels of one role, in the order of the file.

        Parameters
        ----------
        role : str
            ``microphone``, ``vibrometer``, ``generator``, ``accelerometer``, ``tacho`` or ``other``.

        Returns
        -------
        tuple of Channel
            Empty where none has it.
        """
        return tuple(c for c in self.channels if c.role == role)

    @property
    def runs(self) -> tuple[Recording, ...]:
        """The recordings in it: the groups that have a vibrometer each, or itself where fewer than two have one.

        Channels are compared with the vibrometer of their own run. Groups without one belong to the first run.
        """
        own = list(dict.fromkeys(c.group for c in self.by_role("vibrometer")))
        if len(own) < 2:
            return (self,)

        def run(group: str) -> Recording:
            others, first = set(own) - {group}, group == own[0]
            return replace(
                self,
                channels=tuple(
                    c for c in self.channels if c.group == group or (first and c.group not in own)
                ),
                group_properties={g: p for g, p in self.group_properties.items() if g not in others},
                notes=self.notes if first else (),
                set_aside=self.set_aside if first else {},
            )

        return tuple(map(run, own))

    def select(self, patterns: Sequence[str]) -> tuple[Channel, ...]:
        """Channels that match any of the shell-style patterns (``Mic *``); all for none.

        Parameters
        ----------
        patterns : sequence of str
            Names or patterns.

        Returns
        -------
        tuple of Channel
            In the order of the file.

        Raises
        ------
        RequestError
            Nothing matches.
        """
        if not patterns:
            return self.channels
        chosen = channels_matching(patterns, self.channels)
        if not chosen:
            self.channel(patterns[0])  # raises, with the nearest name
        return chosen

    def read(
        self, channels: Sequence[Channel | str] | Channel | str, start: int = 0, stop: int | None = None
    ) -> Real:
        """Samples in the channels' units, shape (channels, samples); all of one rate.

        Delay and phase are not touched in the time domain; see `Channel.correction`.

        Parameters
        ----------
        channels : sequence of Channel or str
            Of this recording, in this order; one by itself is a sequence of one.
        start, stop : int
            First sample, and the one after the last; to the end by default.

        Returns
        -------
        array, shape (channels, samples)
            In the units of the channels.

        Raises
        ------
        RequestError
            The channels have different rates, or the range is not inside the recording.
        """
        wanted = [channels] if isinstance(channels, (Channel, str)) else channels
        named = (c if isinstance(c, str) else c.path.removeprefix("/") for c in wanted)
        chosen = [
            c if isinstance(c, Channel) and c.source_index >= 0 else self.channel(name)
            for c, name in zip(wanted, named, strict=True)
        ]
        length = min((c.n_samples for c in chosen), default=0)
        stop = length if stop is None else stop
        if not 0 <= start <= stop <= length:
            raise RequestError(
                f"{self.label}: samples {start} to {stop} are requested",
                expected=f"a range inside 0 to {length}",
            )
        rates = sorted({c.sampling_rate for c in chosen})
        if len(rates) > 1:
            raise RequestError(
                f"{self.label}: channels with {rates[0]:g} and {rates[-1]:g} Hz are requested together",
                expected="channels of one sampling rate",
                remedy="choose channels of one group",
            )
        # Together where all begin at the same sample of the file.
        alike = [chosen] if len({c.skipped for c in chosen}) == 1 else [[c] for c in chosen]
        parts = [
            self.source.read([c.source_index for c in few], start + few[0].skipped, stop + few[0].skipped)
            for few in alike
        ]
        samples = parts[0] if len(parts) == 1 else np.concatenate(parts)
        gains = np.array([[c.gain] for c in chosen])
        if np.any(gains != 1.0):
            with np.errstate(invalid="ignore", over="ignore"):  # a damaged file may hold any number
                samples *= gains
        return samples

    def blocks(
        self, channels: Sequence[Channel], size: int, start: int = 0, stop: int | None = None
    ) -> Iterator[Real]:
        """The same in consecutive blocks of `size` samples; the last one may be shorter.

        Parameters
        ----------
        channels : sequence of Channel
            Of this recording.
        size : int
            Samples of a block.
        start, stop : int
            First sample, and the one after the last; to the end by default.

        Returns
        -------
        iterator of array, shape (channels, samples)
            In the units of the channels.
        """
        stop = min(c.n_samples for c in channels) if stop is None else stop
        found = (self.read(channels, first, min(first + size, stop)) for first in range(start, stop, size))
        return found if self.watch is None else self.watch(found, channels, stop - start)


def properties_called(key: str, recording: Recording, group: str = "") -> Iterator[tuple[str, Any]]:
    """What a property says, whatever its letters, and where: in a group that is named, the file, other groups."""
    of_groups = {f"group {name!r}": content for name, content in recording.group_properties.items()}
    own = {f"group {group!r}": recording.group_properties.get(group, {})} if group else {}
    for place, content in {**own, "file": recording.properties, **of_groups}.items():
        for name, value in content.items():
            if name.lower() == key.lower() and str(value).strip():
                yield place, value
