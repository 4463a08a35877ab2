"""A recording: channels that know their unit, role and calibration, and samples that are read on demand."""

from __future__ import annotations

import fnmatch
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from specan.errors import InputError, RequestError, nearest
from specan.result import Result, counted, full_names
from specan.units import MOTION, QUANTITIES, Quantity

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

Role = Literal["microphone", "vibrometer", "generator", "accelerometer", "tacho", "torque", "force", "other"]
ROLES: tuple[Role, ...] = (
    "microphone", "vibrometer", "generator", "accelerometer", "tacho", "torque", "force", "other",
)  # fmt: skip


class SampleSource(Protocol):
    """Where samples come from; a file format implements this."""

    def read(self, indices: Sequence[int], start: int, stop: int) -> NDArray[np.float64]:
        """Samples `start` to `stop` of the channels `indices`, after the file's own scaling.

        Returns an array (len(indices), stop - start). All channels of one call have the same rate.
        """
        ...


@dataclass(frozen=True)
class ArraySource:
    """Samples held in memory, one array a channel."""

    samples: Sequence[NDArray[np.float64]]

    def read(self, indices: Sequence[int], start: int, stop: int) -> NDArray[np.float64]:
        """Samples of the chosen channels; see SampleSource."""
        return np.stack([np.asarray(self.samples[i][start:stop], dtype=np.float64) for i in indices])


@dataclass(frozen=True)
class PhaseCalibration:
    """Phase of a channel relative to the reference microphone, known at some tones.

    Positive means that the channel leads; the correction is subtracted. Between tones the phase is
    interpolated; beyond them it goes on as `model` says: ``delay`` (degrees proportional to frequency)
    or ``constant``. Of an `inverted` channel 180 degrees are the same at all frequencies, and the rest
    goes on as the model says.
    """

    frequency_hz: tuple[float, ...]
    phase_deg: tuple[float, ...]
    u_phase_deg: tuple[float, ...]
    model: Literal["delay", "constant"] = "delay"
    group: str = ""  # phases are comparable within one group only
    inverted: bool = False

    def at(self, frequency_hz: NDArray[np.float64]) -> NDArray[np.float64]:
        """Phase in degrees at the given frequencies."""
        f = np.asarray(frequency_hz, dtype=float)
        tones, phases = np.asarray(self.frequency_hz), np.asarray(self.phase_deg)
        if self.inverted:
            rest = tuple(float(p % 360.0 - 180.0) for p in phases)  # from -180 to 180, near zero
            return 180.0 + replace(self, inverted=False, phase_deg=rest).at(f)
        if self.model == "constant":
            return np.interp(f, tones, phases)
        # phase / frequency is the delay in degrees per hertz: interpolated, and held beyond the tones.
        return f * np.interp(f, tones, phases / tones)

    def u_at(self, frequency_hz: NDArray[np.float64]) -> NDArray[np.float64]:
        """Standard uncertainty in degrees; it grows with the distance from the nearest tone.

        Under the delay model the stated uncertainty scales with frequency above the tone. In both
        models the phase itself may follow the other law: half the difference between the two laws,
        as a rectangular bound, is added in quadrature.
        """
        f = np.asarray(frequency_hz, dtype=float)
        tones, u = np.asarray(self.frequency_hz), np.asarray(self.u_phase_deg)
        stated = np.interp(f, tones, u) * np.maximum(1.0, f / tones[-1])
        other = replace(self, model="constant" if self.model == "delay" else "delay")
        return np.hypot(stated, np.abs(self.at(f) - other.at(f)) / (2 * np.sqrt(3)))


@dataclass(frozen=True)
class Channel:
    """One channel of a recording.

    Attributes
    ----------
    unit : str
        SI unit of the samples that `Recording.read` returns ("Pa", "m/s", "V", "1").
    raw_unit : str
        SI unit of the samples before `gain`, after the file's own scaling ("V"); empty where nothing says.
    raw_scale : float
        Factor from the samples to `raw_unit`: 1e-3 for samples in mV.
    gain : float
        Factor from the file's scaled samples to `unit` (1 / sensitivity).
    derivatives : int
        How many times the quantity has to be differentiated to become the one that the role stands
        for: a vibrometer that gives displacement has 1, one that gives acceleration -1.
    delay_s, u_delay_s : float
        By how much the channel is late, and the standard uncertainty of that.
    full_scale : float or None
        Largest magnitude in `unit` that the converter can give; samples there are clipped.
    source_index : int or None
        Place of the channel in the source of its recording; None: the place in the recording.
    decisions : mapping
        How role, unit, sensitivity, sampling rate ... were decided, in words.
    """

    name: str
    group: str = ""
    unit: str = "1"
    role: Role = "other"
    sampling_rate: float = 0.0
    n_samples: int = 0
    raw_unit: str = ""
    raw_scale: float = 1.0
    gain: float = 1.0
    derivatives: int = 0
    delay_s: float = 0.0
    u_delay_s: float = 0.0
    phase: PhaseCalibration | None = None
    u_gain_percent: float = 0.0
    full_scale: float | None = None
    start_offset_s: float = 0.0
    source_index: int | None = None
    properties: Mapping[str, Any] = field(default_factory=dict)
    decisions: Mapping[str, str] = field(default_factory=dict)

    @property
    def duration_s(self) -> float:
        """Length in seconds."""
        return self.n_samples / self.sampling_rate if self.sampling_rate else 0.0

    @property
    def target_unit(self) -> str:
        """Unit after the differentiations that `correction` carries out."""
        if not self.derivatives:
            return self.unit
        place = MOTION.index(self.unit) + self.derivatives if self.unit in MOTION else 1
        return MOTION[place] if 0 <= place < len(MOTION) else "m/s"

    def in_quantity(self, quantity: Quantity) -> Channel:
        """The channel to be shown as displacement, velocity or acceleration; itself where it is no motion.

        Examples
        --------
        >>> Channel("Acc", unit="m/s^2").in_quantity("velocity").target_unit
        'm/s'
        """
        if self.unit not in MOTION:
            return self
        return replace(self, derivatives=QUANTITIES.index(quantity) - MOTION.index(self.unit))

    def correction(self, frequency_hz: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Factor on the channel's spectrum (exp(+j w t)) that removes its phase error and delay.

        A displacement or acceleration of a vibrometer becomes a velocity: (j w) ** derivatives.
        """
        f = np.asarray(frequency_hz, dtype=float)
        factor = np.exp(2j * np.pi * f * self.delay_s)
        if self.phase is not None:
            factor = factor * np.exp(-1j * np.radians(self.phase.at(f)))
        if self.derivatives:
            omega = 2 * np.pi * f
            with np.errstate(divide="ignore", invalid="ignore"):
                factor = factor * np.where(omega > 0, (1j * omega) ** self.derivatives, 0.0)
        return factor

    def u_phase_deg(self, frequency_hz: NDArray[np.float64]) -> NDArray[np.float64]:
        """Standard uncertainty of the phase that calibration and delay leave, in degrees."""
        f = np.asarray(frequency_hz, dtype=float)
        late = 360.0 * f * self.u_delay_s
        return np.hypot(late, self.phase.u_at(f)) if self.phase is not None else late


def _meant(name: str, channels: Sequence[Channel]) -> tuple[Channel, ...]:
    """Channels that a name means which none has: the same in other letters, else the one whose name ends so.

    ``mic 1`` means ``Mic 1``; ``ai0`` means ``cDAQ1Mod1/ai0`` where no other channel ends so.
    """
    wanted = name.casefold()
    same = tuple(c for c in channels if wanted in (c.name.casefold(), f"{c.group}/{c.name}".casefold()))
    if same or not wanted:
        return same
    ends = tuple(c for c in channels if _ends_with(f"{c.group}/{c.name}".casefold(), wanted))
    return ends if len(ends) == 1 else ()


def _ends_with(name: str, end: str) -> bool:
    """Whether a name ends with whole words: ``ai0`` ends ``mod1/ai0``, not ``xai0``; a number alone does not do."""
    return name.endswith(end) and not name[: -len(end)][-1:].isalnum() and not end.isnumeric()


def matches(pattern: str, channel: Channel) -> bool:
    """Whether a shell-style pattern (``Mic *``) is or fits the channel's name or ``group/name``."""
    names = (channel.name, f"{channel.group}/{channel.name}")
    return pattern in names or any(fnmatch.fnmatchcase(name, pattern) for name in names)


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
    """

    label: str
    channels: tuple[Channel, ...]
    source: SampleSource
    properties: Mapping[str, Any] = field(default_factory=dict)
    group_properties: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    flags: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    set_aside: Mapping[str, str] = field(default_factory=dict)

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
        channels = tuple(
            replace(c.in_quantity(quantity), source_index=i if c.source_index is None else c.source_index)
            for i, c in enumerate(self.channels)
        )
        if not any(c.unit in MOTION for c in channels):
            raise RequestError(
                f"{self.label}: no channel can be shown as {quantity}",
                expected="a channel in m, m/s or m/s^2",
                remedy="give its unit in a channel table",
            )
        return replace(self, channels=channels)

    def overview(self) -> pd.DataFrame:
        """One row for each channel.

        Returns
        -------
        pandas.DataFrame
            Name, group, role, unit, sampling rate, samples, duration.
        """
        import pandas as pd

        rows = [
            [c.name, c.group, c.role, c.unit, c.sampling_rate, c.n_samples, c.duration_s]
            for c in self.channels
        ]
        names = ["channel", "group", "role", "unit", "sampling_rate_hz", "n_samples", "duration_s"]
        return pd.DataFrame(rows, columns=names)

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
        return pd.DataFrame(
            samples.T, index=time, columns=full_names([c.name for c in chosen], [c.group for c in chosen])
        )

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
        try:
            return self.to_dataframe().to_xarray()
        except ImportError:
            raise RequestError(
                "a data set needs xarray, which is not installed", remedy='pip install "specan[xarray]"'
            ) from None

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
            It is not time signal.
        """
        found = [c for c in self.channels if name in (c.name, f"{c.group}/{c.name}")]
        found = found or list(_meant(name, self.channels))
        if len(found) == 1:
            return found[0]
        if found:
            places = ", ".join(f"{c.group}/{c.name}" for c in found)
            raise RequestError(f"{self.label}: {name!r} is in several groups", remedy=f"say one of {places}")
        for path, reason in self.set_aside.items():
            if name == path or path.endswith(f"/{name}"):
                raise InputError(f"{self.label}: {path!r} cannot be used: {reason}")
        raise RequestError(
            f"{self.label} has no channel {name!r}", remedy=nearest(name, [c.name for c in self.channels])
        )

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
        names = set(patterns)  # a thousand channels may be named one by one
        shapes = [p for p in patterns if any(mark in p for mark in "*?[")]
        chosen = [
            c.name in names or f"{c.group}/{c.name}" in names or any(matches(p, c) for p in shapes)
            for c in self.channels
        ]
        exact = {name for c in self.channels for name in (c.name, f"{c.group}/{c.name}")}
        for pattern in dict.fromkeys(p for p in patterns if p not in exact):
            if pattern not in shapes:
                meant = {id(c) for c in _meant(pattern, self.channels)}
            elif not any(matches(pattern, c) for c in self.channels):
                small = pattern.casefold()
                meant = {id(c) for c in self.channels if fnmatch.fnmatchcase(c.name.casefold(), small)}
            else:
                continue
            chosen = [was or id(c) in meant for was, c in zip(chosen, self.channels, strict=True)]
        if not any(chosen):
            self.channel(patterns[0])  # raises, with the nearest name
        return tuple(c for was, c in zip(chosen, self.channels, strict=True) if was)

    def read(
        self, channels: Sequence[Channel], start: int = 0, stop: int | None = None
    ) -> NDArray[np.float64]:
        """Samples in the channels' units, shape (channels, samples); all of one rate.

        Delay and phase are not touched in the time domain; see `Channel.correction`.

        Parameters
        ----------
        channels : sequence of Channel
            Of this recording.
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
        length = min((c.n_samples for c in channels), default=0)
        stop = length if stop is None else stop
        if not 0 <= start <= stop <= length:
            raise RequestError(
                f"{self.label}: samples {start} to {stop} are asked for",
                expected=f"a range inside 0 to {length}",
            )
        rates = sorted({c.sampling_rate for c in channels})
        if len(rates) > 1:
            raise RequestError(
                f"{self.label}: channels with {rates[0]:g} and {rates[-1]:g} Hz are asked for together",
                expected="channels of one sampling rate",
                remedy="choose channels of one group",
            )
        samples = self.source.read([self._place(c) for c in channels], start, stop)
        gains = np.array([[c.gain] for c in channels])
        if np.any(gains != 1.0):
            samples *= gains
        return samples

    def _place(self, channel: Channel) -> int:
        """Place of a channel in the source."""
        if channel.source_index is not None:
            return channel.source_index
        for place, own in enumerate(self.channels):
            if own is channel or (own.group, own.name) == (channel.group, channel.name):
                return place
        raise RequestError(
            f"{self.label} has no channel {channel.name!r}", expected="a channel of this recording"
        )

    def blocks(
        self, channels: Sequence[Channel], size: int, start: int = 0, stop: int | None = None
    ) -> Iterator[NDArray[np.float64]]:
        """The same in consecutive blocks of `size` samples; the last one may be shorter.

        Parameters
        ----------
        channels : sequence of Channel
            Of this recording.
        size : int
            Samples of a block.
        start, stop : int
            First sample, and the one after the last; to the end by default.

        Yields
        ------
        array, shape (channels, samples)
            In the units of the channels.
        """
        stop = min(c.n_samples for c in channels) if stop is None else stop
        for first in range(start, stop, size):
            yield self.read(channels, first, min(first + size, stop))
