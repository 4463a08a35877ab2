"""From named signals, as any file of arrays holds them, to a recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from specan.data.recording import Recording, SampleSource
from specan.errors import InputError
from specan.io.channel_table import ChannelTable, channel_of
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
        raise InputError(f"{label} holds no time signal" + (f" ({why})" if why else ""))
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
