"""A channel of a recording: unit, sensitivity, role and calibration, and which names mean it."""

from __future__ import annotations

import fnmatch
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any, Literal

import numpy as np

from specan.arrays import Complex, Real
from specan.errors import RequestError
from specan.result import picked
from specan.units import MOTION, QUANTITIES, Quantity, convert, is_compatible, scale_to

Role = Literal["microphone", "vibrometer", "generator", "accelerometer", "tacho", "torque", "force", "other"]


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

    def at(self, frequency_hz: Real) -> Real:
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

    def u_at(self, frequency_hz: Real) -> Real:
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
    start_offset_s : float
        When its first sample was taken, on a clock that all channels of the recording share.
    skipped : int
        Samples of the file before the first one of the channel.
    source_index : int
        Place of the channel in the source of its recording; below 0: the place in the recording.
    shares_name : bool
        Whether another channel of its recording has the same name.
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
    skipped: int = 0
    source_index: int = -1
    shares_name: bool = False
    properties: Mapping[str, Any] = field(default_factory=dict)
    decisions: Mapping[str, str] = field(default_factory=dict)

    @property
    def calibrated_by(self) -> str:
        """The calibration that was applied, or that the sensitivity is nominal; empty for a channel without one."""
        source, _, outcome = self.decisions.get("calibration", "").partition(": ")
        if outcome.startswith("failed"):
            return f"nominal sensitivities, {source} failed"
        return source or ("nominal sensitivities" if "sensitivity" in self.decisions else "")

    def content(self) -> dict[str, Any]:
        """What the JSON of a recording says of the channel."""
        names = "name group role unit sampling_rate_hz=sampling_rate n_samples duration_s start_offset_s"
        more = "sample_unit=raw_unit gain u_gain_percent derivatives delay_s u_delay_s full_scale"
        return {
            **picked(self, f"{names} {more}"),
            "phase": self.phase and picked(self.phase, "frequency_hz phase_deg u_phase_deg model group"),
            "decisions": dict(self.decisions),
            "properties": plain_properties(self.properties),
        }

    @property
    def path(self) -> str:
        """Group and name, ``group/name``."""
        return f"{self.group}/{self.name}"

    @property
    def label(self) -> str:
        """What results and messages call it: its name, and its group before it where it shares the name.

        Examples
        --------
        >>> Channel("Mic 1", "Run 2").label, Channel("Mic 1", "Run 2", shares_name=True).label
        ('Mic 1', 'Run 2/Mic 1')
        """
        return self.path if self.shares_name and self.group else self.name

    def __repr__(self) -> str:
        return f"<Channel: {self.label}, {self.role}, {self.unit}, {self.duration_s:g} s at {self.sampling_rate:g} Hz>"

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

    @property
    def conversion(self) -> str:
        """What is made of it by differentiation or integration, in words; empty for nothing."""
        if not self.derivatives:
            return ""
        names = dict(zip(MOTION, QUANTITIES))
        kind = names.get(self.unit, "displacement" if self.derivatives > 0 else "acceleration")
        return f"{kind} is converted to {names[self.target_unit]} by j w"

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

    def from_time(self, start_s: float) -> Channel:
        """The channel from `start_s` of the clock on; what is left of a sample is a delay.

        Examples
        --------
        >>> later = Channel("Mic 1", sampling_rate=1000.0, n_samples=100).from_time(0.0102)
        >>> later.skipped, later.n_samples, round(later.delay_s, 6)
        (10, 90, 0.0002)
        """
        ahead = (start_s - self.start_offset_s) * self.sampling_rate
        whole = round(ahead)
        return replace(
            self,
            skipped=self.skipped + whole,
            n_samples=self.n_samples - whole,
            delay_s=self.delay_s + (ahead - whole) / self.sampling_rate,
            start_offset_s=start_s,
        )

    def correction(self, frequency_hz: Real) -> Complex:
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

    def u_phase_deg(self, frequency_hz: Real) -> Real:
        """Standard uncertainty of the phase that calibration and delay leave, in degrees."""
        f = np.asarray(frequency_hz, dtype=float)
        late = 360.0 * f * self.u_delay_s
        return np.hypot(late, self.phase.u_at(f)) if self.phase is not None else late


def plain_properties(properties: Mapping[str, Any]) -> dict[str, Any]:
    """Properties as JSON values; time stamps as ISO 8601."""
    return {
        key: value if isinstance(value, (str, int, float, bool)) else str(value)
        for key, value in properties.items()
    }


def channels_meant(name: str, channels: Sequence[Channel]) -> tuple[Channel, ...]:
    """Channels that a name means which none has: the same in other letters, else the one whose name ends so.

    ``mic 1`` means ``Mic 1``; ``ai0`` means ``cDAQ1Mod1/ai0`` where no other channel ends so.
    """
    wanted = name.casefold()
    same = tuple(c for c in channels if wanted in (c.name.casefold(), c.path.casefold()))
    if same or not wanted:
        return same
    ends = tuple(c for c in channels if _ends_with(c.path.casefold(), wanted))
    return ends if len(ends) == 1 else ()


def _ends_with(name: str, end: str) -> bool:
    """Whether a name ends with whole words: ``ai0`` ends ``mod1/ai0``, not ``xai0``; a number alone does not do."""
    return name.endswith(end) and not name[: -len(end)][-1:].isalnum() and not end.isnumeric()


def matches(pattern: str, channel: Channel) -> bool:
    """Whether a shell-style pattern (``Mic *``) is or fits the channel's name or ``group/name``."""
    names = (channel.name, channel.path)
    return pattern in names or any(fnmatch.fnmatchcase(name, pattern) for name in names)


def row_meant(rows: Iterable[Any], *names: str) -> Any:
    """The row of a table whose ``channel`` is one of the names, else the first whose pattern fits one, else None."""
    exact = next((row for row in rows if row.channel in names), None)
    return exact or next((r for r in rows if any(fnmatch.fnmatchcase(n, r.channel) for n in names)), None)


def channels_matching(patterns: Sequence[str], channels: Sequence[Channel]) -> tuple[Channel, ...]:
    """Channels that any of the names and shell-style patterns means, in their order; empty where none does.

    ``Mic 1,Mic 7`` are two names, unless a channel is called so.
    """
    exact = {name for c in channels for name in (c.name, c.path)}
    parts = [[p] if p in exact or "," not in p else p.split(",") for p in patterns]
    patterns = [part.strip() if len(names) > 1 else part for names in parts for part in names]
    names = set(patterns)  # a thousand channels may be named one by one
    chosen = {id(c) for c in channels if c.name in names or c.path in names}
    for pattern in [p for p in names if p not in exact or any(mark in p for mark in "*?[")]:
        small = pattern.casefold()
        found = [c for c in channels if matches(pattern, c)]
        found = found or [c for c in channels if fnmatch.fnmatchcase(c.name.casefold(), small)]
        chosen |= {id(c) for c in found or channels_meant(pattern, channels)}
    return tuple(c for c in channels if id(c) in chosen)


# Quantities of a laboratory, in the units that channels carry.
QUANTITY_UNITS = ("V", "Pa", "m/s", "m/s^2", "m", "N", "Nm", "A", "Hz", "K", "1")

# The common spellings need no unit library, whose import costs more than the headers of a file.
_USUAL = {
    "v": ("V", 1.0), "volt": ("V", 1.0), "volts": ("V", 1.0), "mv": ("V", 1e-3), "uv": ("V", 1e-6),
    "pa": ("Pa", 1.0), "pascal": ("Pa", 1.0), "pascals": ("Pa", 1.0), "hpa": ("Pa", 100.0), "kpa": ("Pa", 1e3),
    "m/s": ("m/s", 1.0), "mm/s": ("m/s", 1e-3), "um/s": ("m/s", 1e-6), "m/s/s": ("m/s^2", 1.0),
    "m/s^2": ("m/s^2", 1.0), "m/s2": ("m/s^2", 1.0), "m/s**2": ("m/s^2", 1.0), "mm/s^2": ("m/s^2", 1e-3),
    "ms^-2": ("m/s^2", 1.0), "ms-2": ("m/s^2", 1.0), "g": ("m/s^2", 9.80665), "gn": ("m/s^2", 9.80665),
    "m": ("m", 1.0), "mm": ("m", 1e-3), "um": ("m", 1e-6), "n": ("N", 1.0), "newton": ("N", 1.0),
    "newtons": ("N", 1.0), "n*m": ("Nm", 1.0), "n m": ("Nm", 1.0), "n-m": ("Nm", 1.0), "hz": ("Hz", 1.0),
    "1": ("1", 1.0), "-": ("1", 1.0),
}  # fmt: skip
# Where capitals tell units apart: mega and milli, newton metre and nanometre.
_CAPITALS = {"MV": ("V", 1e6), "MPa": ("Pa", 1e6), "mPa": ("Pa", 1e-3), "Nm": ("Nm", 1.0), "nm": ("m", 1e-9)}


@cache
def si_unit(text: str) -> tuple[str, float]:
    """SI unit that `text` stands for, and the factor to it; an unknown unit stays as it is written.

    Units with an offset (degC) stay as they are as well: a factor cannot convert them.

    Examples
    --------
    >>> si_unit("Volts"), si_unit("kPa"), si_unit("g"), si_unit("C"), si_unit("furlong/fortnight*apple")
    (('V', 1.0), ('Pa', 1000.0), ('m/s^2', 9.80665), ('C', 1.0), ('furlong/fortnight*apple', 1.0))
    """
    plain = _plain(text)
    if plain in _CAPITALS:
        return _CAPITALS[plain]
    if plain.lower() in _USUAL:
        return _USUAL[plain.lower()]
    if "deg" in plain.lower() or plain.startswith("°"):
        return text.strip(), 1.0
    for unit in QUANTITY_UNITS:
        if unit != "1" and is_compatible(plain, unit) and convert(0.0, plain, unit) == 0.0:
            return unit, scale_to(plain, unit)
    return text.strip(), 1.0


def is_known(text: str) -> bool:
    """Whether `text` is a unit of one of the quantities that channels carry."""
    return si_unit(text)[0] in QUANTITY_UNITS


# Squares of samples are summed: beyond this they could leave the range of floating-point numbers. Real gains lie far
# inside: 1 nm per V of a vibrometer, 1e-7 V per step of a converter.
SMALLEST_GAIN = 1e-30


def gain_of(sensitivity: float, unit: str, raw_scale: float = 1.0) -> tuple[float, str]:
    """Gain from samples to the quantity in SI units, and that unit.

    Parameters
    ----------
    sensitivity : float
        In `unit`: voltage per quantity ("mV/Pa", "mV/g") or quantity per voltage ("(m/s)/V").
    unit : str
        Its unit.
    raw_scale : float
        Volts per unit of the samples (1e-3 for samples in mV).

    Returns
    -------
    tuple
        Factor on the samples, and the SI unit of the result.

    Raises
    ------
    RequestError
        The sensitivity is not above zero, or its unit holds no voltage.

    Examples
    --------
    >>> gain_of(50.0, "mV/Pa")
    (20.0, 'Pa')
    >>> gain_of(50.0, "(mm/s)/V")
    (0.05, 'm/s')
    """
    if not SMALLEST_GAIN <= abs(sensitivity) <= 1 / SMALLEST_GAIN:
        raise RequestError(
            f"the sensitivity is {sensitivity} {unit}",
            expected=f"a number other than zero, from {SMALLEST_GAIN:g} to {1 / SMALLEST_GAIN:g}",
        )
    plain = _plain(unit)
    per_quantity = re.fullmatch(r"([a-zA-Z]?V)/(.+)", plain)
    per_voltage = re.fullmatch(r"(.+)/([a-zA-Z]?V)", plain)
    if per_quantity:
        quantity, scale = si_unit(_bare(per_quantity[2]))
        if quantity in QUANTITY_UNITS:
            return raw_scale * scale / (sensitivity * si_unit(per_quantity[1])[1]), quantity
    elif per_voltage:
        quantity, scale = si_unit(_bare(per_voltage[1]))
        if quantity in QUANTITY_UNITS:
            return raw_scale * sensitivity * scale / si_unit(per_voltage[2])[1], quantity
    raise RequestError(
        f"the sensitivity unit {unit!r} is not known",
        expected="a voltage per quantity such as mV/Pa or mV/g, or a quantity per voltage such as (m/s)/V",
    )


def _plain(text: str) -> str:
    """One spelling of powers, products and prefixes."""
    text = text.strip().replace("²", "^2").replace("µ", "u").replace("μ", "u").replace("·", "*")
    return _bare(re.sub(r"\s*([/*^])\s*", r"\1", text))


def _bare(text: str) -> str:
    """Without the parentheses around the whole."""
    return text[1:-1] if re.fullmatch(r"\([^()]*\)", text) else text
