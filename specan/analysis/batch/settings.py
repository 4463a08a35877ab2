"""Settings of a batch: those of its analyses, and what is common to them."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, field_validator

from specan.analysis.insertion import CalibrationSettings
from specan.analysis.octave import Octave
from specan.analysis.orders import Orders
from specan.analysis.tone import Tone
from specan.analysis.transfer_function import DEFAULT_LINES, TransferFunction
from specan.schema import Settings, parse, read_toml


class BatchSettings(Settings):
    """What a batch does with its files; the tables of a settings file have the same names.

    Attributes
    ----------
    reference : str or None
        Channel over which phases and transfer functions stand; the vibrometer by default.
    excitation : {"sine", "noise", "sweep"} or None
        What drove all recordings; recognised file by file by default.
    sampling_rate : float or None
        In hertz, of all channels, in place of what the files say.
    tone : Tone
        Of sine recordings.
    transfer_function : TransferFunction
        Of noise recordings; 3200 lines unless it says otherwise: the tables of all files then have the same lines.
    octave : Octave
        Band levels of noise recordings and of those that are neither.
    calibration : CalibrationSettings
        Of calibrator recordings among the files.
    orders : Orders or None
        Of all recordings; by default those that have a tacho are analysed, with its own settings.
    decimal : {".", ","}
        Decimal sign of the tables; results do not depend on it.
    """

    reference: str | None = None
    excitation: Literal["sine", "noise", "sweep"] | None = None
    sampling_rate: Annotated[float, Field(gt=0)] | None = None
    tone: Tone = Tone()
    transfer_function: TransferFunction = TransferFunction(lines=DEFAULT_LINES)
    octave: Octave = Octave()
    calibration: CalibrationSettings = CalibrationSettings()
    orders: Orders | None = None
    decimal: Literal[".", ","] = "."

    @field_validator("transfer_function")
    @classmethod
    def _same_lines(cls, value: TransferFunction) -> TransferFunction:
        return value if value.lines is not None else value.model_copy(update={"lines": DEFAULT_LINES})

    def completed(self) -> Self:
        """The same with the common reference in each analysis that names none."""
        if self.reference is None:
            return self
        given = {"reference": self.reference}
        return self.model_copy(
            update={
                name: part if part.reference is not None else part.model_copy(update=given)
                for name, part in (("tone", self.tone), ("transfer_function", self.transfer_function))
            }
        )

    def as_json(self) -> str:
        """All settings on one line, keys sorted; orders only where they are set, the decimal sign not at all."""
        left_out = {"decimal", "orders"} if self.orders is None else {"decimal"}
        content = self.model_dump(mode="json", exclude=left_out)
        return json.dumps(content, sort_keys=True, separators=(",", ":"))

    @property
    def fingerprint(self) -> str:
        """First twelve digits of the SHA-256 of `as_json`."""
        return hashlib.sha256(self.as_json().encode()).hexdigest()[:12]


def read_settings(path: Path | None, given: dict[str, Any]) -> BatchSettings:
    """Settings from a file, overruled by what was given on the command line.

    Parameters
    ----------
    path : Path or None
        A TOML file; unknown keys are errors.
    given : dict
        Keys of `BatchSettings`; nested ones as dicts. None means not given.
    """
    content = {} if path is None else read_toml(path)
    where = "settings" if path is None else path.name
    parse(BatchSettings, content, where)  # a fault of the file is reported as one of the file
    for key, value in given.items():
        if isinstance(value, dict):
            kept = {k: v for k, v in value.items() if v is not None}
            if kept:
                content[key] = {**content.get(key, {}), **kept}
        elif value is not None:
            content[key] = value
    return parse(BatchSettings, content, "settings").completed()
