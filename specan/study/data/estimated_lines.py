"""Lines of transfer functions of a recording: their noise, free of what short records leak, and their windows."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.special import digamma

from specan.arrays import Complex, Real
from specan.data.channel import Channel
from specan.data.recording import Recording
from specan.dsp.welch import effective_averages, hop_of, power_density
from specan.study.observation.window_leakage import fold

if TYPE_CHECKING:
    from specan.analysis.transfer_function import TransferFunction


LEAST_BLOCKS = 4  # below which scatter is no estimate of the noise
HALF = 5  # lines of the whole record to either side; 11 equations for 8 unknowns


class EstimatedLines:
    """Transfer functions of a recording by averages, with what its noise and its windows do to their lines.

    Attributes
    ----------
    frequency_hz, numbers : array (lines,)
        And the number of each line in a block.
    response, coherence : array (channels, lines)
    u_common_percent, u_common_deg : array (channels,)
        Uncertainty of the sensitivities, the largest of all lines.
    density : array (channels, lines)
        Noise of the responses, squared per Hz, which no leakage enlarges.
    worth : array (lines,)
        Square of the random uncertainty of the real part of a line over that density.
    folding : Folding
        What the windows make of a model's response.
    signals : tuple of array
        Samples of the reference, and of the generator where one takes its noise out.
    block, start : int
        Samples of a block, and before the first of them.
    notes : tuple of str
    """

    def __init__(
        self,
        recording: Recording,
        reference: Channel,
        settings: TransferFunction,
        band_hz: tuple[float, float],
    ) -> None:
        rate, block = reference.sampling_rate, settings.block
        start = round((settings.start_s or 0.0) * rate)
        # A few channels at once: each has many lines beyond the band.
        # 1 << 21: samples of blocks that are analysed together: a second of 40 channels at 51.2 kHz
        count = min(-(-len(settings.channels) * block // (1 << 21)), len(settings.channels))
        few = [tuple(part.tolist()) for part in np.array_split(np.array(settings.channels), count)]
        parts = [
            settings.model_copy(update={"channels": names})(recording).between(*band_hz) for names in few
        ]
        order = [
            [part.channels.index(name) for name in names] for part, names in zip(parts, few, strict=True)
        ]

        def all_of(name: str) -> Any:
            return np.concatenate(
                [getattr(part, name)[rows] for part, rows in zip(parts, order, strict=True)]
            )

        self.block, self.start = block, start
        self.frequency_hz: Real = parts[0].frequency_hz
        self.numbers = np.round(self.frequency_hz * block / rate).astype(int)
        helper = [recording.by_role("generator")[0]] if settings.estimator == "H3c" else []
        self.signals = tuple(recording.read([reference, *helper]))
        channels = [recording.channel(name) for name in settings.channels]
        responses = (recording.read([channel])[0] for channel in channels)
        drive = _drive(self.signals, rate, block, start, self.frequency_hz)
        n_blocks = (reference.n_samples - start - block) // hop_of(block, 0.5) + 1
        averages = effective_averages(n_blocks, "hann", 0.5)
        self.response: Complex = all_of("response")
        self.coherence: Real = all_of("coherence")
        self.u_common_percent: Real = all_of("u_common_percent").max(axis=1)
        self.u_common_deg: Real = all_of("u_common_phase_deg").max(axis=1)
        self.density = noise_density(self.signals[0], responses, rate, self.frequency_hz)
        self.worth: Real = 1 / (2 * averages * drive)
        self.folding = fold(self.signals[0], rate, block, start, self.numbers, *self.signals[1:])
        self.notes = tuple(dict.fromkeys(note for part in parts for note in part.notes))

    @property
    def noise(self) -> Real:
        """Random uncertainty of the real part of every line: ``sqrt(G_nn / (4 n_eff G_vv))``."""
        return np.sqrt(self.density * self.worth)


def _drive(signals: tuple[Real, ...], rate: float, block: int, start: int, frequency_hz: Real) -> Real:
    """Power density of the reference at given frequencies; of what the generator drives, where that is recorded."""
    f, density = power_density(signals[0][start:], rate, block)
    drive = np.interp(frequency_hz, f, density)
    if len(signals) == 1:
        return drive
    from scipy.signal import coherence

    return drive * np.interp(frequency_hz, *coherence(signals[1], signals[0], rate, "hann", block))


def noise_density(reference: Real, responses: Iterable[Real], rate: float, frequency_hz: Real) -> Real:
    """One-sided noise density of each response at the given frequencies.

    Around a line the transfer function and the transient that the record's ends leave are polynomials of
    the line's number, ``P_k = G(k) V_k + T(k) + noise``; what a least-squares fit over a few lines of the
    whole record's spectrum leaves is noise. A coherence of short blocks would count the leakage of a lightly
    damped mode as noise too (Pintelon and Schoukens, System Identification, 2nd ed. (2012), ch. 7).

    Parameters
    ----------
    reference : array (n,)
    responses : iterable of array (n,)
        One a channel; taken one at a time, so that a long recording need not be held whole.
    rate : float
        Sampling rate, Hz.
    frequency_hz : array (lines,)

    Returns
    -------
    array (channels, lines)
        Unit of the responses squared per Hz, smoothed over neighbouring lines.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> v, noise = rng.standard_normal((2, 20_000))
    >>> found = noise_density(v, 3 * v[None] + 0.1 * noise, 1000.0, np.arange(20.0, 400.0))
    >>> round(float(found.mean() / (0.01 / 500)), 1)
    1.0
    """
    n = reference.size
    spectrum = np.fft.rfft(reference)
    centre = np.clip(np.round(frequency_hz * n / rate).astype(int), HALF + 1, spectrum.size - HALF - 2)
    number = np.arange(-HALF, HALF + 1)
    powers = (number[:, None] / HALF) ** np.arange(4)  # of a polynomial of third order
    rows = centre[:, None] + number
    system = np.concatenate(
        [powers * spectrum[rows][..., None], np.broadcast_to(powers, (*rows.shape, 4))], -1
    )
    # columns of very different size: the transient is far smaller than the response
    scale = np.linalg.norm(system, axis=1, keepdims=True)
    basis, _ = np.linalg.qr(system / np.where(scale > 0, scale, 1.0))
    # (lines, equations, channels)
    picked = np.stack([np.fft.rfft(response)[rows] for response in responses], axis=-1)
    left = picked - basis @ (basis.conj().transpose(0, 2, 1) @ picked)
    freedom = rows.shape[1] - system.shape[2]
    density = 2 * np.sum(np.abs(left) ** 2, axis=1).T / (freedom * n * rate)
    return _smooth(density, freedom)


def _smooth(density: Real, freedom: float) -> Real:
    """Mean of the logarithm over neighbouring lines, freed of its bias; a peak does not lift its neighbours."""
    from scipy.ndimage import uniform_filter1d

    logarithm = np.log(np.maximum(density, np.finfo(float).tiny))
    bias = float(digamma(freedom)) - np.log(freedom)
    # 15: lines over which the logarithm of the noise is averaged
    smooth: Real = np.exp(
        uniform_filter1d(logarithm, min(15, density.shape[1]), axis=1, mode="nearest") - bias
    )
    return smooth
