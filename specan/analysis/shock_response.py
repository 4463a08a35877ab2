"""Shock response spectra of accelerations (ISO 18431-4)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal

import numpy as np
from pydantic import Field
from scipy.signal import cont2discrete, lfilter

from specan.analysis.quality import QualityAccumulator, quality_flags
from specan.analysis.section import SectionSettings, of_one_rate, section
from specan.arrays import Real
from specan.data.channel import Channel
from specan.data.levels import Quality
from specan.data.recording import Recording
from specan.data.spectrum import ShockResponse
from specan.errors import RequestError
from specan.units import MOTION

Response = Literal["acceleration", "pseudo-velocity", "displacement"]
_INTEGRALS = {"acceleration": 0, "pseudo-velocity": 1, "displacement": 2}


def oscillator(frequency_hz: float, quality: float, rate: float, response: Response) -> tuple[Real, Real]:
    """Numerator and denominator of the ramp-invariant filter from the acceleration of the base to a response.

    Parameters
    ----------
    frequency_hz : float
        Undamped natural frequency.
    quality : float
        Q, 1 / (2 zeta); above 1/2.
    rate : float
        Samples a second.
    response : {"acceleration", "pseudo-velocity", "displacement"}
        Absolute acceleration of the mass; relative displacement, as it is or times the natural angular frequency.

    Examples
    --------
    >>> b, a = oscillator(100.0, 10.0, 10000.0, "acceleration")
    >>> round(float(b.sum() / a.sum()), 9)  # a constant acceleration is followed
    1.0
    """
    omega, damping = 2 * np.pi * frequency_hz, 1.0 / quality
    above = [damping, 1.0] if response == "acceleration" else [-1.0]
    # In units of 1 / omega: a relative displacement then is omega^2 times what it is.
    b, a, _ = cont2discrete((above, [1.0, damping, 1.0]), omega / rate, method="foh")
    return b[0] / omega ** _INTEGRALS[response], a


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
        """Drive the oscillators with the samples of one channel after the other."""
        channels, notes = self._accelerations(recording)
        rate = channels[0].sampling_rate
        frequency = self._frequencies(rate)
        start, stop = section(recording, channels, self.start_s, self.stop_s)
        filters = [oscillator(float(f), self.quality, rate, self.response) for f in frequency]
        # The base at rest for a period, in which the residual response peaks.
        counts = stop - start + np.ceil(rate / frequency).astype(int)
        positive, negative = np.zeros((2, len(channels), frequency.size))
        mean, seen = [], list[Quality]()
        for row, channel in enumerate(channels):
            samples = np.zeros(counts.max())
            samples[: stop - start] = recording.read(channel, start, stop)[0]
            look = QualityAccumulator((channel,))
            look.add(samples[None, : stop - start])
            seen += look.result()
            mean.append(float(np.mean(samples[: stop - start])))
            if self.detrend:
                samples[: stop - start] -= mean[-1]
            for k, (b, a) in enumerate(filters):
                found = lfilter(b, a, samples[: counts[k]])
                positive[row, k], negative[row, k] = np.maximum([found.max(), -found.min()], 0.0)
        return ShockResponse(
            **self.origin(
                recording,
                channels,
                (*notes, *self._remarks(mean, seen, frequency[-1], rate)),
                (MOTION[2 - _INTEGRALS[self.response]],) * len(channels),
            ),
            frequency_hz=frequency,
            positive=positive,
            negative=negative,
            response=self.response,
            quality=self.quality,
            flags=quality_flags(channels, recording.flags, seen),
        )

    def _remarks(
        self, mean: Sequence[float], seen: Sequence[Quality], highest_hz: float, rate: float
    ) -> list[str]:
        remarks = []
        peaks = [max(abs(q.minimum), abs(q.maximum)) for q in seen]
        offset = max((abs(m) / p for m, p in zip(mean, peaks, strict=True) if p > 0), default=0.0)
        if offset > _OFFSET and not self.detrend:
            remarks.append(f"the mean is up to {100 * offset:.1f} % of the peak; --detrend subtracts it")
        if highest_hz > rate / _SAMPLES_A_PERIOD * 1.001:
            remarks.append(f"above {rate / _SAMPLES_A_PERIOD:g} Hz sampling may miss more than 5 % of a peak")
        return remarks

    def _accelerations(self, recording: Recording) -> tuple[tuple[Channel, ...], tuple[str, ...]]:
        """The chosen channels, and notes on those left out."""
        wanted = self.channels or tuple(c.path for c in recording.channels if c.unit == "m/s^2")
        if not wanted:
            raise RequestError(f"{recording.label} has no acceleration", expected="a channel in m/s^2 or g")
        channels, notes = of_one_rate(recording, wanted)
        if other := [c.label for c in channels if c.unit != "m/s^2"]:
            raise RequestError(f"{', '.join(other)}: no acceleration", expected="channels in m/s^2 or g")
        return channels, notes

    def _frequencies(self, rate: float) -> np.ndarray:
        fmax = rate / _SAMPLES_A_PERIOD if self.fmax is None else self.fmax
        if not self.fmin <= fmax < rate / 2:
            raise RequestError(
                f"natural frequencies from {self.fmin:g} to {fmax:g} Hz are requested",
                expected=f"a range that ends below {rate / 2:g} Hz, half the sampling rate",
            )
        count = int(np.floor(self.per_octave * np.log2(fmax / self.fmin) + 1e-9)) + 1
        return np.asarray(self.fmin * 2.0 ** (np.arange(count) / self.per_octave))
