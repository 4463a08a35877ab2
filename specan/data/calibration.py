"""A calibration: sensitivity and phase of channels, and what becomes of a recording under it."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Literal, get_args

from specan.data.channel import Channel, PhaseCalibration, gain_of, row_meant
from specan.data.recording import Recording
from specan.errors import InputError, RequestError
from specan.result import Result, Sheet, cell, counted, picked

Verdict = Literal["good", "doubtful", "failed"]
VERDICTS: tuple[Verdict, ...] = get_args(Verdict)


@dataclass(frozen=True)
class Contribution:
    """One line of an uncertainty budget (GUM): what contributes, how it was evaluated, how much.

    Attributes
    ----------
    of : str
        Result that it belongs to: "sensitivity", "phase at 1000 Hz".
    name : str
        Where it comes from.
    type : {"A", "B"}
        Estimated from repeated observations, or stated.
    u : float
        Standard uncertainty of the result by it, in `unit`.
    dof : int or None
        Degrees of freedom; None: taken as known.
    """

    of: str
    name: str
    type: Literal["A", "B"]
    u: float
    unit: str
    dof: int | None


@dataclass(frozen=True)
class ChannelCalibration:
    """What a calibration found out about one channel.

    Attributes
    ----------
    channel : str
        Name, ``group/name`` or a shell-style pattern of either.
    sensitivity : float
        Output per quantity, in `unit`.
    unit : str
        Unit of the sensitivity: "mV/Pa", "(m/s)/V" (then it is quantity per output), "mV/(m/s^2)".
    u_sensitivity_percent : float
        Relative standard uncertainty of the sensitivity.
    phase : PhaseCalibration or None
        Phase relative to the first channel of its group; positive means that this channel leads.
    scatter_percent, drift_percent : float or None
        Scatter of the windows, and change from the first to the last.
    verdict : {"good", "doubtful", "failed"}
        A failed calibration is kept in the file and never applied.
    reasons : tuple of str
        Why the verdict is not "good".
    budget : tuple of Contribution
        Where the uncertainties come from; not part of the file.
    """

    channel: str
    sensitivity: float
    unit: str = "mV/Pa"
    u_sensitivity_percent: float = 0.0
    phase: PhaseCalibration | None = None
    scatter_percent: float | None = None
    drift_percent: float | None = None
    verdict: Verdict = "good"
    reasons: tuple[str, ...] = ()
    budget: tuple[Contribution, ...] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        numbers = [self.u_sensitivity_percent, self.scatter_percent or 0.0, self.drift_percent or 0.0]
        if self.phase is not None:
            numbers += [*self.phase.phase_deg, *self.phase.u_phase_deg]
        if not 0.0 < self.sensitivity < math.inf or not all(map(math.isfinite, numbers)):
            raise RequestError(
                f"the calibration of {self.channel!r} is not finite, or its sensitivity not above zero",
                expected="finite numbers",
            )


@dataclass(frozen=True, repr=False)
class Calibration(Result):
    """Calibrations of several channels, and where they come from.

    Attributes
    ----------
    channels : tuple of ChannelCalibration
        A channel of a recording takes the first that matches it.
    made_from : tuple of str
        Labels of the calibrator recordings.
    calibrator_frequency_hz, calibrator_level_dB : float or None
        Tone and level (re 20 uPa, or of the quantity) of the calibrator.
    u_calibrator_percent : float
        Relative standard uncertainty of the calibrator's level: the part of every `u_sensitivity_percent` that all
        channels have in common.
    calibrator_decided : tuple of str
        How these were decided: given, a property, or assumed.
    notes : tuple of str
        Sentences for the reader, such as that two phase groups share no microphone.
    """

    channels: tuple[ChannelCalibration, ...] = ()
    made_from: tuple[str, ...] = ()
    calibrator_frequency_hz: float | None = None
    calibrator_level_dB: float | None = None
    u_calibrator_percent: float = 0.0
    calibrator_decided: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    source: str = field(default="calibration", compare=False)  # the file's name, for messages

    dimensions = ("channel", "frequency_hz")

    def summary(self) -> str:
        """What it is, on one line."""
        tone = self.calibrator_frequency_hz
        return f"{counted(len(self.channels), 'channel')}" + (f" at {tone:.6g} Hz" if tone else "")

    def content(self) -> dict[str, Any]:
        """What `to_dict` gives, with arrays in it."""
        return asdict(self)

    def columns(self) -> dict[str, Any]:
        """One row for each channel and tone."""
        rows = [
            {
                **picked(c, "channel sensitivity unit u_sensitivity_percent"),
                "frequency_hz": frequency,
                "phase_deg": phase,
                "u_phase_deg": u_phase,
                **picked(c, "scatter_percent drift_percent verdict"),
                "reasons": "; ".join(c.reasons),
            }
            for c in self.channels
            for frequency, phase, u_phase in (
                zip(c.phase.frequency_hz, c.phase.phase_deg, c.phase.u_phase_deg)
                if c.phase
                else [(None,) * 3]
            )
        ]
        return {name: [row[name] for row in rows] for name in (rows[0] if rows else {"channel": ""})}

    def sheets(self, budget: bool = False) -> list[Sheet]:
        """Sensitivity and phase of each channel; where their uncertainties come from (GUM, 7.2.7)."""
        tone, level = self.calibrator_frequency_hz, self.calibrator_level_dB
        title = (
            "Calibration"
            + (f" at {tone:.2f} Hz" if tone else "")
            + (f", {level:g} dB re 20 uPa" if level else "")
        )
        rows = []
        for c in self.channels:
            phases, u = (c.phase.phase_deg, c.phase.u_phase_deg) if c.phase else ((), ())
            rows.append([
                c.channel, f"{c.sensitivity:.3f}", f"{c.u_sensitivity_percent:.2f}",
                *(" / ".join(f"{x:.2f}" for x in values) for values in (phases, u)), c.phase.group if c.phase else "",
                cell(c.scatter_percent, ".3f"), cell(c.drift_percent, ".3f"), "; ".join([c.verdict, *c.reasons]),
            ])  # fmt: skip
        header = ["channel", "mV/Pa", "u %", "phase deg", "u deg", "re", "scatter %", "drift %", "verdict"]
        decided = "\n".join(f"Calibrator: {line}." for line in self.calibrator_decided)
        found = [Sheet(title, header, rows, decided)]
        if budget:
            header = ["channel", "result", "contribution", "type", "u", "unit", "dof", "share %"]
            rows = [row for c in self.channels for row in _budget(c)]
            found.append(Sheet("Uncertainty budget", header, rows))
        return found

    def find(self, channel: Channel) -> ChannelCalibration | None:
        """The calibration of a channel, None where there is none."""
        return row_meant(self.channels, channel.name, channel.path)


def _budget(channel: ChannelCalibration) -> list[list[str]]:
    """Rows of the budget; the share is of the variance."""
    totals: dict[str, float] = {}
    for part in channel.budget:
        totals[part.of] = totals.get(part.of, 0.0) + part.u**2
    return [
        [
            channel.channel, part.of, part.name, part.type, f"{part.u:.4f}", part.unit,
            "" if part.dof is None else str(part.dof),
            f"{100 * part.u**2 / totals[part.of]:.0f}" if totals[part.of] else "",
        ]
        for part in channel.budget
    ]  # fmt: skip


def apply(calibration: Calibration, recording: Recording) -> Recording:
    """The recording with the sensitivities and phases of a calibration.

    Parameters
    ----------
    calibration : Calibration
        Channels that it does not name stay as they are.
    recording : Recording
        Its samples are not touched; `gain`, `phase`, `u_gain_percent` and `full_scale` change.

    Returns
    -------
    Recording
        Each calibrated channel says so in ``decisions["sensitivity"]``.

    Raises
    ------
    InputError
        A channel's samples are no voltage, so that a sensitivity cannot be applied to them.

    Examples
    --------
    >>> import numpy as np
    >>> from specan.data.channel import Channel
    >>> from specan.data.recording import ArraySource, Recording
    >>> microphone = Channel("Mic 1", unit="V", raw_unit="V", sampling_rate=8e3, n_samples=1)
    >>> recording = Recording("a.tdms", (microphone,), ArraySource([np.array([0.05])]))
    >>> calibrated = apply(Calibration((ChannelCalibration("Mic 1", 50.0),)), recording)
    >>> float(calibrated.read(calibrated.channels)[0, 0].round(9)), calibrated.channels[0].unit
    (1.0, 'Pa')
    """
    channels = tuple(
        _apply_to(calibration.find(c), c, recording, calibration.source) for c in recording.channels
    )
    return replace(recording, channels=channels)


def stated(found: Any, recording: Recording) -> Any:
    """A result of a recording; its settings say which calibration its channels have."""
    names = [getattr(c, "name", c) for c in (*found.channels, getattr(found, "reference", None))]
    return replace(found, settings={**found.settings, "calibration": recording.calibration_of(names)})


def _apply_to(
    found: ChannelCalibration | None, channel: Channel, recording: Recording, source: str
) -> Channel:
    if found is None:
        return channel
    decisions = dict(channel.decisions)
    if found.verdict == "failed":
        why = "; ".join(found.reasons) or "no reason given"
        decisions["calibration"] = f"{source}: failed ({why}), not applied"
        return replace(channel, decisions=decisions)
    if channel.raw_unit and channel.raw_unit != "V":
        raise InputError(
            f"{recording.label}: the samples of {channel.label!r} are in {channel.raw_unit}, "
            f"and {source} gives {found.sensitivity:g} {found.unit}",
            expected="samples in V for a sensitivity",
            remedy="take the channel out of the calibration, or correct the unit in the channel table",
        )
    gain, unit = gain_of(found.sensitivity, found.unit, channel.raw_scale)
    decisions["sensitivity"] = f"{source}: {found.sensitivity:.6g} {found.unit}"
    decisions["calibration"] = f"{source}: {found.verdict}" + "".join(f"; {r}" for r in found.reasons)
    if found.phase is not None:
        decisions["phase"] = f"{source}: known at {', '.join(f'{f:g}' for f in found.phase.frequency_hz)} Hz"
    return replace(
        channel,
        unit=unit,
        gain=gain,
        full_scale=None if channel.full_scale is None else channel.full_scale * abs(gain / channel.gain),
        u_gain_percent=found.u_sensitivity_percent,
        phase=found.phase if found.phase is not None else channel.phase,
        decisions=decisions,
    )
