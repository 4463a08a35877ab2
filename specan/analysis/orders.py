"""Order analysis: spectra, lines and averages per turn of a shaft."""

from __future__ import annotations

from specan.analysis.order_accumulator import OrderAccumulator
from specan.analysis.order_settings import OrderSettings
from specan.data.orders import OrderSpectrum
from specan.data.recording import Recording


class Orders(OrderSettings):
    """Settings of an order analysis.

    Attributes
    ----------
    channels : tuple of str
        Names or patterns; all but the tachos by default.
    tacho : str or None
        Channel; the recording's only tacho by default.
    pulses_per_turn : float or None
        Of the tacho's shaft; its property ``PulsesPerRevolution`` by default.
    ratio : float
        Turns of the tacho's shaft per turn of the reference shaft, to which orders belong.
    speed_hz : float or None
        Known constant speed of the reference shaft, instead of a tacho.
    max_order : float or None
        By default what 1/2.56 of the sampling rate holds at the highest speed.
    turns : int
        Turns of a block of the spectrum: lines lie 1/turns apart.
    average_turns : int
        Turns of the synchronous average: as many as the machine takes to repeat itself.
    orders : tuple of float
        Orders whose complex amplitudes are wanted.
    mesh : float or None
        Order of tooth meshing: its first `harmonics` multiples with `sidebands` orders to either side join `orders`.
    quantity : str or None
        Convert vibration to displacement, velocity or acceleration, by the frequency of each line.
    envelope_hz : pair or None
        Analyse the envelope of this band instead of the signal.
    columns : int
        Columns of the map over speed, at most.

    Examples
    --------
    >>> import numpy as np
    >>> from specan.data.channel import Channel
    >>> from specan.data.recording import ArraySource
    >>> t = np.arange(20000) / 10000
    >>> channel = Channel("Acc 1", unit="m/s^2", sampling_rate=10000.0, n_samples=20000)
    >>> recording = Recording("a.tdms", (channel,), ArraySource([3.0 * np.cos(2 * np.pi * 240 * t)]))
    >>> found = Orders(speed_hz=10.0, orders=(24.0,))(recording)
    >>> np.abs(found.lines.amplitude).round(3).tolist(), float(found.order[np.argmax(found.amplitude[0])])
    ([[3.0]], 24.0)
    """

    def accumulator(self, recording: Recording) -> OrderAccumulator:
        """For a pass over the recording."""
        return OrderAccumulator(recording, self)

    def __call__(self, recording: Recording) -> OrderSpectrum:
        """Read the recording once and return what it holds per turn."""
        accumulator = self.accumulator(recording)
        for samples in accumulator.pieces():
            accumulator.add(samples)
        return accumulator.result()
