"""`calibration.toml`: a calibration as a person can read and correct it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from specan.data.calibration import Calibration, ChannelCalibration, Verdict
from specan.data.channel import PhaseCalibration
from specan.io.output_file import text_file
from specan.schema import Settings, parse, read_toml

FILE_NAME = "calibration.toml"
# Keys of the file, and what they are called in `PhaseCalibration`.
_PHASE = {
    "tone_hz": "frequency_hz", "phase_deg": "phase_deg", "u_phase_deg": "u_phase_deg", "phase_model": "model",
    "phase_group": "group",
}  # fmt: skip
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
    said = content.model_dump(exclude={"schema_", "channel"})
    return Calibration(channels=tuple(map(_channel, content.channel)), source=path.name, **said)


def calibration_beside(path: Path) -> Path | None:
    """The `calibration.toml` in the directory of a recording, None where there is none."""
    beside = path.parent / FILE_NAME
    return beside if beside.is_file() else None


def write_calibration(calibration: Calibration, path: Path | str) -> None:
    """Write a `calibration.toml`; reading it gives an equal calibration.

    The file appears as a whole or not at all.
    """
    import tomlkit

    said = {name: getattr(calibration, name) for name in _File.model_fields if hasattr(calibration, name)}
    rows = tuple(map(_row, calibration.channels))
    file = _File.model_validate({**said, "schema": 1, "channel": rows})
    content = file.model_dump(mode="json", by_alias=True, exclude_defaults=True, exclude={"channel"})
    always = {"schema": 1, "made_from": list(file.made_from)}
    with text_file(Path(path)) as out:
        out.write(_HEADER + tomlkit.dumps({**always, **content, "channel": list(map(_written, rows))}))


def _channel(row: _Row) -> ChannelCalibration:
    phase = None
    if row.tone_hz:
        own = {name: getattr(row, key) for key, name in _PHASE.items()}
        phase = PhaseCalibration(inverted=row.polarity == "inverted", **own)
    own = {name: value for name, value in row if name in ChannelCalibration.__annotations__}
    return ChannelCalibration(phase=phase, **own)


def _row(channel: ChannelCalibration) -> _Row:
    own = {name: getattr(channel, name) for name in _Row.model_fields if hasattr(channel, name)}
    if (phase := channel.phase) is not None:
        own |= {key: getattr(phase, name) for key, name in _PHASE.items()}
        own["polarity"] = "inverted" if phase.inverted else "normal"
    return _Row(**own)


def _written(row: _Row) -> dict[str, Any]:
    """The keys of a row that say something."""
    silent = set() if row.tone_hz else {"phase_model", "phase_group"}
    found = row.model_dump(mode="json", exclude_none=True, exclude=silent)
    return {name: value for name, value in found.items() if value not in ([], "normal")}
