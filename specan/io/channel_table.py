"""The user's table of channels: roles, sensitivities, delays, beside the recordings as TOML or CSV."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from specan.csv_rows import csv_rows
from specan.data.channel import SMALLEST_GAIN, Channel, Role, gain_of, is_known, row_meant, si_unit
from specan.errors import InputError, RequestError
from specan.io.roles import derivatives_of
from specan.io.sampling_rate import FASTEST_HZ, SLOWEST_HZ
from specan.schema import Settings, parse, read_toml

NAMES = ("channels.toml", "channels.csv")

# Sound crosses 20 km in a minute; nothing in a laboratory is later.
_Delay = Annotated[float, Field(ge=-60, le=60)]
_Positive = Annotated[float, Field(gt=0)]


class Row(Settings):
    """What the user knows about the channels that a pattern names.

    Attributes
    ----------
    channel : str
        Name, ``group/name`` or a shell-style pattern of either.
    unit : str
        Unit of the quantity; of the samples where no sensitivity or gain is given.
    sensitivity, sensitivity_unit : float, str
        Voltage per quantity (mV/Pa) or quantity per voltage ((m/s)/V).
    gain : float
        Quantity in `unit` per unit of the samples, instead of a sensitivity.
    full_scale : float
        Largest value of the converter, in the unit of the samples.
    sampling_rate_hz : float
        Sampling rate; counts before everything that the file says.
    """

    channel: str
    role: Role | None = None
    unit: str | None = None
    sensitivity: float | None = None
    sensitivity_unit: str | None = None
    u_sensitivity_percent: Annotated[float, Field(ge=0, le=100)] = 0.0
    gain: float | None = None
    delay_s: _Delay = 0.0
    u_delay_s: Annotated[float, Field(ge=0, le=60)] = 0.0
    full_scale: _Positive | None = None
    sampling_rate_hz: Annotated[float, Field(ge=SLOWEST_HZ, le=FASTEST_HZ)] | None = None
    sensor: str = ""
    note: str = ""

    @model_validator(mode="after")
    def _belongs_together(self) -> Row:
        if (self.sensitivity is None) != (self.sensitivity_unit is None):
            raise ValueError("sensitivity and sensitivity_unit together")
        if self.sensitivity is not None and self.gain is not None:
            raise ValueError("either a sensitivity or a gain")
        if self.gain is not None and self.unit is None:
            raise ValueError("a unit with the gain")
        if self.gain is not None and not SMALLEST_GAIN <= abs(self.gain) <= 1 / SMALLEST_GAIN:
            raise ValueError(f"a gain other than zero, from {SMALLEST_GAIN:g} to {1 / SMALLEST_GAIN:g}")
        if self.sensitivity is not None and self.sensitivity_unit is not None:
            try:
                unit = gain_of(self.sensitivity, self.sensitivity_unit)[1]
            except RequestError as fault:
                raise ValueError(f"a sensitivity that can be used ({fault.found})") from None
            if self.unit is not None and si_unit(self.unit)[0] != unit:
                raise ValueError(f"a sensitivity in V per {self.unit}, not {self.sensitivity_unit}")
        return self


class _File(Settings):
    schema_: Annotated[Literal[1], Field(alias="schema")] = 1
    channel: tuple[Row, ...]


@dataclass(frozen=True)
class ChannelTable:
    """Rows of a channel table; a channel takes the row of its exact name, else the first that fits."""

    rows: tuple[Row, ...]
    source: str = "channel table"

    def find(self, group: str, name: str) -> Row | None:
        """Row of a channel, None where there is none."""
        return row_meant(self.rows, name, f"{group}/{name}")

    def applied(self, channel: Channel, label: str) -> Channel:
        """The channel of a recording of that name under its row; one without a row stays as it is.

        Raises
        ------
        InputError
            The row contradicts the file.
        """
        row = self.find(channel.group, channel.name)
        if row is None:
            return channel
        decisions = dict(channel.decisions)
        found = _scaled(row, channel, decisions, label, self.source)
        if row.role is not None:
            decisions["role"] = self.source
            found = replace(found, role=row.role)
        decisions.pop("derivatives", None)
        known: dict[str, Any] = {"derivatives": derivatives_of(found.role, found.unit, decisions)}
        if row.full_scale is not None:
            known["full_scale"], decisions["full_scale"] = row.full_scale * abs(found.gain), self.source
        if row.sampling_rate_hz is not None:
            known["sampling_rate"], decisions["sampling_rate"] = row.sampling_rate_hz, self.source
        return replace(
            found, decisions=decisions, delay_s=row.delay_s, u_delay_s=row.u_delay_s,
            u_gain_percent=row.u_sensitivity_percent, **known,
        )  # fmt: skip


def read_channel_table(path: Path | str) -> ChannelTable:
    """Read a channel table, TOML or CSV by its name.

    Raises
    ------
    RequestError
        The file cannot be read, or a key, unit or number in it is wrong; the message says where.
    """
    path = Path(path)
    if path.suffix.lower() == ".csv":
        _, rows = csv_rows(path, RequestError)
        if not rows:
            raise RequestError(
                f"{path.name} holds no rows", expected="a header with 'channel' and one row per channel"
            )
        found = tuple(parse(Row, content, f"{path.name}, line {line}") for line, content in rows)
        return ChannelTable(found, path.name)
    return ChannelTable(parse(_File, read_toml(path), path.name).channel, path.name)


def find_channel_table(directory: Path) -> Path | None:
    """The channel table that is in a directory.

    Raises
    ------
    RequestError
        There are two.
    """
    found = [directory / name for name in NAMES if (directory / name).is_file()]
    if len(found) > 1:
        raise RequestError(
            f"{directory} holds both {NAMES[0]} and {NAMES[1]}",
            expected="one channel table",
            remedy="remove one",
        )
    return found[0] if found else None


def _scaled(row: Row, channel: Channel, decisions: dict[str, str], label: str, source: str) -> Channel:
    """The channel with the unit and the gain of a row."""
    raw = channel.raw_unit

    def contradicts(table: str) -> InputError:
        return InputError(
            f"{label}: the samples of {channel.name!r} are in {raw} by the file, and {source} gives {table}",
            expected="statements that agree",
            remedy="correct the table, or the unit in the file",
        )

    if row.sensitivity is not None and row.sensitivity_unit is not None:
        if raw not in ("", "V"):
            raise contradicts(f"{row.sensitivity:g} {row.sensitivity_unit}")
        decisions["sensitivity"] = f"{source}: {row.sensitivity:g} {row.sensitivity_unit}"
        if not raw:
            decisions["unit"] += ", in volts, because a sensitivity per volt is given"
        gain, unit = gain_of(row.sensitivity, row.sensitivity_unit, channel.raw_scale)
        return replace(channel, gain=gain, unit=unit)
    if row.unit is None:
        return channel
    unit, scale = si_unit(row.unit)
    if row.gain is not None:
        if raw not in ("", "V", unit):
            raise contradicts(f"a gain to {row.unit}")
        decisions["sensitivity"] = f"{source}: gain {row.gain:g} {row.unit} per unit of the samples"
        return replace(channel, gain=row.gain * scale, unit=unit)
    if channel.unit == unit:
        return channel
    if raw and is_known(raw):
        raise contradicts(f"the unit {row.unit} and no sensitivity")
    decisions["unit"] = source
    decisions.pop("sensitivity", None)
    return replace(channel, unit=unit, raw_unit=unit, raw_scale=scale, gain=scale)
