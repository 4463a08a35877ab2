"""From the signals of a file to a recording: what every format leaves to the same few rules."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from specan.data.recording import Recording, SampleSource
from specan.errors import NoSignalError
from specan.io.channel_table import ChannelTable
from specan.io.roles import identify
from specan.io.sampling_rate import Rate


@dataclass(frozen=True)
class Signal:
    """One signal of a file: what is known of it beside its samples.

    Attributes
    ----------
    name, group : str
    n_samples : int
    unit : str
        Of the samples; empty where nothing says.
    rate : Rate, optional
    properties : mapping
        As TDMS has them: those that `specan.io.roles.identify` knows say unit and sensitivity.
    full_scale : float, optional
        Largest magnitude of the samples.
    known : mapping
        Further fields of the channel.
    decisions : mapping
        How these were decided, for `info`.
    """

    name: str
    n_samples: int
    unit: str = ""
    rate: Rate | None = None
    group: str = ""
    properties: Mapping[str, Any] = field(default_factory=dict)
    full_scale: float | None = None
    known: Mapping[str, Any] = field(default_factory=dict)
    decisions: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Opening:
    """What is said of a file beside what it holds.

    Attributes
    ----------
    label : str
        Name of the recording in results.
    channel_table : ChannelTable, optional
        What the user knows about the channels.
    sampling_rate : float, optional
        Sampling rate in hertz of every channel, whatever the file says.
    """

    label: str
    channel_table: ChannelTable | None = None
    sampling_rate: float | None = None

    def recording(
        self,
        signals: Sequence[Signal],
        source: SampleSource,
        set_aside: Mapping[str, str] | None = None,
        **about: Any,
    ) -> Recording:
        """The recording of signals, channel by channel in their order.

        Roles and units come from names and properties, then from the channel table; a sampling rate from the table,
        from the user, then from the file. `about` are further fields of the recording.

        Raises
        ------
        NoSignalError
            There is none.
        """
        if not signals:
            why = "; ".join(f"{name}: {reason}" for name, reason in list((set_aside or {}).items())[:4])
            raise NoSignalError(f"{self.label} holds no time signal" + (f" ({why})" if why else ""))
        channels = []
        for signal in signals:
            said = {"unit_string": signal.unit} if signal.unit else {}
            channel = identify(signal.name, {**signal.properties, **said}, signal.group)
            decisions = {**channel.decisions, **signal.decisions}
            channel = replace(channel, **{"decisions": decisions, **signal.known})
            if self.channel_table is not None:
                channel = self.channel_table.applied(channel, self.label)
            rate = signal.rate or Rate(0.0, "nothing says it")
            if self.sampling_rate is not None:
                rate = Rate(float(self.sampling_rate), "stated by the user")
            if channel.sampling_rate:
                rate = Rate(channel.sampling_rate, channel.decisions["sampling_rate"])
            full_scale = channel.full_scale
            if full_scale is None and signal.full_scale is not None:
                full_scale = signal.full_scale * abs(channel.gain)
            channels.append(
                replace(
                    channel,
                    sampling_rate=rate.hz,
                    n_samples=signal.n_samples,
                    full_scale=full_scale,
                    properties=signal.properties,
                    decisions={**channel.decisions, "sampling_rate": rate.how},
                )
            )
        return Recording(self.label, tuple(channels), source, set_aside=set_aside or {}, **about)
