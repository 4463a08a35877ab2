"""Settings of a fractional-octave analysis."""

from __future__ import annotations

from contextlib import suppress
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from specan.analysis.section import SectionSettings
from specan.divisions import division_name
from specan.dsp.bands import Bands
from specan.dsp.multirate import LOWEST_BAND
from specan.dsp.weighting import FAST, IMPULSE, SLOW, Weighting
from specan.errors import RequestError
from specan.schema import Division

Settling = Literal["left-out", "counted"]
AUDIO_RANGE = (20.0, 20000.0)
TIME_CONSTANTS = {"fast": FAST, "slow": SLOW, "impulse": IMPULSE}
# Readings of a history, unless an interval is asked for: in a time constant (a level falls by 0.54 dB from one to the
# next at most), and in all.
READINGS_PER_TIME_CONSTANT, READINGS = 8, 1000


class OctaveSettings(SectionSettings):
    """Which bands are found, and how they are averaged; see `specan.analysis.octave.Octave`."""

    fraction: Division = 3
    weighting: Weighting = "Z"
    averaging: Literal["linear", "fast", "slow", "impulse"] | float = "linear"
    hold: Literal["max", "min"] | None = None
    interval_s: float | None = Field(default=None, gt=0.0)
    percentiles: tuple[Annotated[float, Field(gt=0.0, lt=100.0)], ...] = ()
    fmin: float | None = Field(default=None, ge=LOWEST_BAND)
    fmax: float | None = Field(default=None, gt=0.0)
    band: float | None = Field(default=None, ge=LOWEST_BAND)
    velocity_reference: Literal["1 nm/s", "50 nm/s"] = "1 nm/s"
    settling: Settling = "counted"

    @field_validator("averaging", mode="before")
    @classmethod
    def _known_averaging(cls, value: object) -> object:
        # Of a union, pydantic would report each member's fault.
        if value in ("linear", *TIME_CONSTANTS):
            return value
        with suppress(ValueError):
            if 0.0 < float(str(value)) < np.inf:
                return float(str(value))
        raise ValueError("linear, fast, slow, impulse, or a time constant in s above 0")

    @model_validator(mode="after")
    def _consistent(self) -> OctaveSettings:
        if self.band is not None and (self.fmin is not None or self.fmax is not None):
            raise ValueError("one band or a range from fmin to fmax can be chosen, not both")
        if self.averaging == "linear" and (self.hold or self.interval_s is not None or self.percentiles):
            raise ValueError(
                "hold, interval and percentiles are for an exponential average: fast, slow, impulse or seconds"
            )
        if self.fmin is not None and self.fmax is not None and self.fmin > self.fmax:
            raise ValueError(f"fmin ({self.fmin:g} Hz) is above fmax ({self.fmax:g} Hz)")
        return self

    @property
    def time_constant(self) -> float:
        """Of the exponential average, in s."""
        return TIME_CONSTANTS[self.averaging] if isinstance(self.averaging, str) else self.averaging

    @property
    def averaging_name(self) -> str:
        """The averaging in words."""
        return self.averaging if isinstance(self.averaging, str) else f"{self.averaging:g} s"

    def reading_interval(self, duration: float) -> float:
        """Distance in s of the readings of a history over `duration` seconds."""
        if self.interval_s is not None:
            return self.interval_s
        step = max(self.time_constant, FAST) if self.averaging == "impulse" else self.time_constant
        step /= READINGS_PER_TIME_CONSTANT
        return step * max(1, int(np.ceil(duration / step / READINGS)))

    def bands(self, sampling_rate: float) -> Bands:
        """The bands that are found.

        Raises
        ------
        RequestError
            A band that was asked for reaches above half the sampling rate.
        """
        nyquist = sampling_rate / 2.0
        if self.band is not None:
            low = high = self.band
        else:
            low = AUDIO_RANGE[0] if self.fmin is None else self.fmin
            high = AUDIO_RANGE[1] if self.fmax is None else self.fmax
        wanted = Bands.between(self.fraction, min(low, high), high)
        found = wanted[wanted.upper <= nyquist]
        stated = self.band is not None or self.fmax is not None
        if not len(found) or (stated and len(found) < len(wanted)):
            possible = Bands.between(self.fraction, min(LOWEST_BAND, nyquist), nyquist)
            possible = possible[possible.upper <= nyquist]
            name = division_name(self.fraction).removesuffix(" band")
            raise RequestError(
                f"the {name} band at {high if stated else low:g} Hz reaches above half the "
                f"sampling rate of {sampling_rate:g} Hz",
                expected=f"bands up to {possible.nominal.max(initial=0.0):g} Hz",
                remedy="choose a lower frequency",
            )
        return found
