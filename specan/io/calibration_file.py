"""`calibration.toml`: a calibration as a person can read and correct it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from specan.data.calibration import Calibration, ChannelCalibration, Verdict
from specan.data.channel import PhaseCalibration
from specan.io.output_file import text_file
from specan.schema import Settings, parse, read_toml

_HEADER = """\
# Sensitivities and phases of channels, as `specan calibrate` found them.
# Phases are relative to the first channel of their phase group; positive means that the channel leads.
# A channel whose verdict is "failed" is not applied.
"""


class _Row(Settings):
    channel: str
    sensitivity: Annotated[float, Field(gt=0)]
    unit: str = "mV/Pa"
    u_sensitivity_percent: Annotated[float, Field(ge=0)] = 0.0
    scatter_percent: float | None = None
    drift_percent: float | None = None
    tone_hz: tuple[Annotated[float, Field(gt=0)], ...] = ()
    phase_deg: tuple[float, ...] = ()
    u_phase_deg: tuple[Annotated[float, Field(ge=0)], ...] = ()
    phase_model: Literal["delay", "constant"] = "delay"
    phase_group: str = ""
    polarity: Literal["normal", "inverted"] = "normal"
    verdict: Verdict = "good"
    reasons: tuple[str, ...] = ()

    @model_validator(mode="after")
    def _tones_belong_together(self) -> _Row:
        if not len(self.tone_hz) == len(self.phase_deg) == len(self.u_phase_deg):
            raise ValueError("as many values of phase_deg and u_phase_deg as of tone_hz")
        if list(self.tone_hz) != sorted(set(self.tone_hz)):
            raise ValueError("tones that increase")
        return self


class _File(Settings):
    schema_: Annotated[Literal[1], Field(alias="schema")]
    made_from: tuple[str, ...] = ()
    calibrator_frequency_hz: float | None = None
    calibrator_level_dB: float | None = None
    u_calibrator_percent: Annotated[float, Field(ge=0)] = 0.0
    calibrator_decided: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    channel: tuple[_Row, ...] = ()


def read_calibration(path: Path | str) -> Calibration:
    """Read a `calibration.toml`.

    Raises
    ------
    RequestError
        The file is missing or not valid, or a key is unknown.
    """
    path = Path(path)
    content = parse(_File, read_toml(path), path.name)
    return Calibration(
        channels=tuple(_channel(row) for row in content.channel),
        made_from=content.made_from,
        calibrator_frequency_hz=content.calibrator_frequency_hz,
        calibrator_level_dB=content.calibrator_level_dB,
        u_calibrator_percent=content.u_calibrator_percent,
        calibrator_decided=content.calibrator_decided,
        notes=content.notes,
        source=path.name,
    )


def write_calibration(calibration: Calibration, path: Path | str) -> None:
    """Write a `calibration.toml`; reading it gives an equal calibration.

    The file appears as a whole or not at all.
    """
    import tomlkit

    content: dict[str, Any] = {"schema": 1, "made_from": list(calibration.made_from)}
    for key in ("calibrator_frequency_hz", "calibrator_level_dB"):
        if getattr(calibration, key) is not None:
            content[key] = float(getattr(calibration, key))
    if calibration.u_calibrator_percent:
        content["u_calibrator_percent"] = float(calibration.u_calibrator_percent)
    if calibration.calibrator_decided:
        content["calibrator_decided"] = list(calibration.calibrator_decided)
    if calibration.notes:
        content["notes"] = list(calibration.notes)
    content["channel"] = [_row(c) for c in calibration.channels]
    path = Path(path)
    with text_file(path) as file:
        file.write(_HEADER + tomlkit.dumps(content))


def _channel(row: _Row) -> ChannelCalibration:
    phase = None
    if row.tone_hz:
        phase = PhaseCalibration(
            row.tone_hz,
            row.phase_deg,
            row.u_phase_deg,
            row.phase_model,
            group=row.phase_group,
            inverted=row.polarity == "inverted",
        )
    return ChannelCalibration(
        channel=row.channel,
        sensitivity=row.sensitivity,
        unit=row.unit,
        u_sensitivity_percent=row.u_sensitivity_percent,
        phase=phase,
        scatter_percent=row.scatter_percent,
        drift_percent=row.drift_percent,
        verdict=row.verdict,
        reasons=row.reasons,
    )


def _row(channel: ChannelCalibration) -> dict[str, Any]:
    row: dict[str, Any] = {
        "channel": channel.channel,
        "sensitivity": float(channel.sensitivity),
        "unit": channel.unit,
        "u_sensitivity_percent": float(channel.u_sensitivity_percent),
    }
    for key in ("scatter_percent", "drift_percent"):
        if getattr(channel, key) is not None:
            row[key] = float(getattr(channel, key))
    if channel.phase is not None:
        row["tone_hz"] = [float(f) for f in channel.phase.frequency_hz]
        row["phase_deg"] = [float(p) for p in channel.phase.phase_deg]
        row["u_phase_deg"] = [float(u) for u in channel.phase.u_phase_deg]
        row["phase_model"] = channel.phase.model
        row["phase_group"] = channel.phase.group
        if channel.phase.inverted:
            row["polarity"] = "inverted"
    row["verdict"] = channel.verdict
    if channel.reasons:
        row["reasons"] = list(channel.reasons)
    return row
