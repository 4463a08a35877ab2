"""Shock response spectra of accelerations (ISO 18431-4)."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field

from specan.analysis.accumulator import READ_BLOCK
from specan.analysis.quality import QualityAccumulator, quality_flags
from specan.analysis.section import SectionSettings, of_one_rate, section, slow_part
from specan.data.recording import Recording
from specan.data.shock_response import ShockResponse
from specan.dsp.shock_response import Oscillators, Response
from specan.errors import RequestError

_UNITS = {"acceleration": "m/s^2", "pseudo-velocity": "m/s", "displacement": "m"}
_SAMPLES_A_PERIOD = 10  # fewer may miss a peak by more than 5 %
_OFFSET = 0.01  # of the peak, from which a mean is worth a note


class ShockSettings(SectionSettings):
    """Settings of shock response spectra.

    Attributes
    ----------
    quality : float
        Q of the oscillators: 10 is a damping ratio of 5 %.
    response : {"acceleration", "pseudo-velocity", "displacement"}
        Absolute acceleration; or relative displacement, as it is or times the natural angular frequency.
    fmin, fmax : float
        Natural frequencies; by default from 10 Hz to a tenth of the sampling rate.
    per_octave : int
        Natural frequencies in an octave.
    detrend : bool
        Subtract the mean of the section.
    channels : tuple of str
        Names or patterns; all accelerations by default.
    start_s, stop_s : float
        Time section.
    """

    quality: Annotated[float, Field(gt=0.5)] = 10.0
    response: Response = "acceleration"
    fmin: Annotated[float, Field(gt=0)] = 10.0
    fmax: Annotated[float, Field(gt=0)] | None = None
    per_octave: Annotated[int, Field(ge=1, le=96)] = 12
    detrend: bool = False

    def __call__(self, recording: Recording) -> ShockResponse:
        """Drive the oscillators with the samples of every channel."""
        wanted = self.channels or tuple(c.path for c in recording.channels if c.unit == "m/s^2")
        if not wanted:
            raise RequestError(f"{recording.label} has no acceleration", expected="a channel in m/s^2 or g")
        channels, notes = of_one_rate(recording, wanted)
        if other := [c.label for c in channels if c.unit != "m/s^2"]:
            raise RequestError(f"{', '.join(other)} is no acceleration", expected="channels in m/s^2 or g")
        rate = channels[0].sampling_rate
        frequency = self._frequencies(rate)
        start, stop = section(recording, channels, self.start_s, self.stop_s)
        mean = slow_part(recording, channels, start, stop).constant
        oscillators = Oscillators(len(channels), frequency, self.quality, rate, self.response)
        quality = QualityAccumulator(channels)
        for samples in recording.blocks(channels, READ_BLOCK, start, stop):
            quality.add(samples)
            oscillators.add(samples - mean[:, None] if self.detrend else samples)
        oscillators.end()
        seen = quality.result()
        peaks = [max(abs(q.minimum), abs(q.maximum)) for q in seen]
        offset = max((abs(m) / p for m, p in zip(mean, peaks, strict=True) if p > 0), default=0.0)
        if offset > _OFFSET and not self.detrend:
            notes = (*notes, f"the mean is up to {100 * offset:.1f} % of the peak; --detrend subtracts it")
        if frequency[-1] > rate / _SAMPLES_A_PERIOD * 1.001:
            notes = (
                *notes,
                f"above {rate / _SAMPLES_A_PERIOD:g} Hz sampling may miss more than 5 % of a peak",
            )
        return ShockResponse(
            label=recording.label,
            channels=tuple(c.label for c in channels),
            units=(_UNITS[self.response],) * len(channels),
            frequency_hz=frequency,
            positive=oscillators.highest,
            negative=-oscillators.lowest,
            response=self.response,
            quality=self.quality,
            flags=quality_flags(channels, recording.flags, seen),
            notes=notes,
            settings=self.model_dump(mode="json"),
        )

    def _frequencies(self, rate: float) -> np.ndarray:
        fmax = rate / _SAMPLES_A_PERIOD if self.fmax is None else self.fmax
        if not self.fmin <= fmax < rate / 2:
            raise RequestError(
                f"natural frequencies from {self.fmin:g} to {fmax:g} Hz are requested",
                expected=f"a range that ends below {rate / 2:g} Hz, half the sampling rate",
            )
        count = int(np.floor(self.per_octave * np.log2(fmax / self.fmin) + 1e-9)) + 1
        return np.asarray(self.fmin * 2.0 ** (np.arange(count) / self.per_octave))
