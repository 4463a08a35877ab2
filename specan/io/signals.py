"""From named signals, as any file of arrays holds them, to a recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from specan.data.recording import Channel, Recording, SampleSource
from specan.errors import InputError
from specan.io.channel_table import ChannelTable, apply_row
from specan.io.roles import identify
from specan.io.sampling_rate import Rate


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
    properties: Mapping[str, Any] | None = None,
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
    properties, set_aside : mapping, optional
        See `specan.data.recording.Recording`.

    Raises
    ------
    InputError
        There is no signal.
    """
    if not signals:
        why = "; ".join(f"{name}: {reason}" for name, reason in list((set_aside or {}).items())[:4])
        raise InputError(f"{label} holds no time signal" + (f" ({why})" if why else ""))
    channels = []
    for place, signal in enumerate(signals):
        channel = _channel(signal, label, channel_table)
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
    return Recording(label, tuple(channels), source, properties or {}, set_aside=set_aside or {})


def _channel(signal: Signal, label: str, table: ChannelTable | None) -> Channel:
    identity = identify(signal.name, {"unit_string": signal.unit} if signal.unit else {})
    row = table.find(signal.group, signal.name) if table else None
    known: dict[str, Any] = {}
    decisions = identity.decisions
    if row is not None and table is not None:
        identity = apply_row(row, identity, signal.name, label, table.source)
        decisions = dict(identity.decisions)
        known = {
            "delay_s": row.delay_s,
            "u_delay_s": row.u_delay_s,
            "u_gain_percent": row.u_sensitivity_percent,
        }
        if row.full_scale is not None:
            known["full_scale"] = row.full_scale * abs(identity.gain)
        if row.sampling_rate_hz is not None:
            known["sampling_rate"], decisions["sampling_rate"] = row.sampling_rate_hz, table.source
    return Channel(
        name=signal.name,
        group=signal.group,
        unit=identity.unit,
        role=identity.role,
        raw_unit=identity.raw_unit,
        raw_scale=identity.raw_scale,
        gain=identity.gain,
        derivatives=identity.derivatives,
        decisions=decisions,
        **known,
    )
