"""What drove a recording: drawn signals of fifteen kinds, and what `specan` calls them.

``python benchmarks/recognition.py [--signals 200] [--seed 1]``

Form, frequency, length, sampling rate and signal-to-noise ratio are drawn. The table counts the answers for each
kind; the last lines count what must not be: anything else among `sine` or `noise`, and sines and noises
that are not recognised.
"""

from __future__ import annotations

import argparse
from collections import Counter, defaultdict
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from specan.analysis.excitation import recognise
from specan.data.recording import ArraySource, Channel, Recording

Real = NDArray[np.float64]
RATES = (4096.0, 8000.0, 12800.0, 25600.0, 44100.0, 51200.0)


class Draw:
    """What is common to the signals of one draw: rate, length, a generator of random numbers."""

    def __init__(self, seed: tuple[int, ...]) -> None:
        self.rng = np.random.default_rng(seed)
        self.rate = float(self.rng.choice(RATES))
        self.seconds = float(np.exp(self.rng.uniform(np.log(2.0), np.log(40.0))))
        self.time = np.arange(int(self.rate * self.seconds)) / self.rate

    def between(self, low: float, high: float) -> float:
        """Uniform."""
        return float(self.rng.uniform(low, high))

    def ratio(self, low: float, high: float) -> float:
        """Uniform in the logarithm."""
        return float(np.exp(self.rng.uniform(np.log(low), np.log(high))))

    def white(self) -> Real:
        """Gaussian noise of the whole length."""
        return self.rng.standard_normal(len(self.time))

    def tone(self, frequency: float | Real) -> Real:
        """A sine of constant or varying frequency, with a phase that is drawn."""
        turns = np.cumsum(np.broadcast_to(frequency, self.time.shape)) / self.rate
        return np.sin(2 * np.pi * (turns + self.between(0, 1)))

    def frequency(self) -> float:
        """Of a tone: 20 Hz to 0.4 of the sampling rate."""
        return self.ratio(20.0, 0.4 * self.rate)


def _sine(d: Draw) -> Real:
    return d.tone(d.frequency())


def _distorted_sine(d: Draw) -> Real:
    frequency = d.ratio(20.0, 0.1 * d.rate)
    return (
        d.tone(frequency)
        + d.between(0.02, 0.3) * d.tone(2 * frequency)
        + d.between(0.02, 0.3) * d.tone(3 * frequency)
    )


def _white(d: Draw) -> Real:
    return d.white()


def _pink(d: Draw) -> Real:
    spectrum = np.fft.rfft(d.white())
    line = np.maximum(
        np.arange(len(spectrum)), max(1.0, 5.0 * d.seconds)
    )  # flat below 5 Hz, as generators make it
    return np.fft.irfft(spectrum / np.sqrt(line), len(d.time))


def _band(d: Draw) -> Real:
    low = d.ratio(30.0, 0.1 * d.rate)
    edges = [low, low * d.between(1.26, 4.0)]
    return signal.sosfilt(signal.butter(4, edges, "band", fs=d.rate, output="sos"), d.white())


def _mls(d: Draw) -> Real:
    period = signal.max_len_seq(int(d.rng.integers(10, 17)))[0] * 2.0 - 1.0
    return np.resize(period, len(d.time))


def _burst_random(d: Draw) -> Real:
    every, part = d.between(0.3, 2.0), d.between(0.4, 0.8)
    return d.white() * ((d.time / every) % 1.0 < part)


def _linear_sweep(d: Draw) -> Real:
    low = d.ratio(10.0, 200.0)
    high = min(low * d.ratio(2.0, 50.0), 0.4 * d.rate)
    edges = (low, high) if d.between(0, 1) < 0.7 else (high, low)
    return d.tone(np.linspace(*edges, len(d.time)))


def _logarithmic_sweep(d: Draw) -> Real:
    low = d.ratio(10.0, 200.0)
    high = min(low * d.ratio(2.0, 200.0), 0.4 * d.rate)
    return d.tone(np.geomspace(low, high, len(d.time)))


def _stepped(d: Draw) -> Real:
    dwell, low = d.ratio(0.2, min(3.0, d.seconds / 3)), d.ratio(20.0, 500.0)
    number = (d.time // dwell).astype(int)
    each = low * d.ratio(1.03, 1.5) ** np.arange(number.max() + 1)
    return d.tone(np.minimum(each, 0.4 * d.rate)[number])


def _two_close_tones(d: Draw) -> Real:
    frequency, apart = d.ratio(50.0, 0.3 * d.rate), d.ratio(max(0.1, 0.7 / d.seconds), 15.0)
    return d.tone(frequency) + d.between(0.5, 1.0) * d.tone(frequency + apart)


def _two_tones(d: Draw) -> Real:
    frequency = d.ratio(30.0, 0.1 * d.rate)
    return d.tone(frequency) + d.between(0.5, 1.0) * d.tone(frequency * d.between(1.05, 3.7))


def _am(d: Draw) -> Real:
    envelope = 1 + d.between(0.3, 1.0) * d.tone(d.ratio(max(0.3, 1 / d.seconds), 20.0))
    return envelope * d.tone(d.ratio(100.0, 0.3 * d.rate))


def _fm(d: Draw) -> Real:
    rate, index, carrier = d.ratio(0.3, 20.0), d.ratio(0.5, 50.0), d.ratio(200.0, 0.2 * d.rate)
    return d.tone(carrier + min(rate * index, 0.5 * carrier) * d.tone(rate))


def _pulses(d: Draw) -> Real:
    every = 1 / d.ratio(0.7, 50.0)
    width = max(1.5 / d.rate, every * d.ratio(0.0005, 0.2))
    return 1.0 * (d.time % every < width)


KINDS: dict[str, Callable[[Draw], Real]] = {
    "sine": _sine,
    "distorted sine": _distorted_sine,
    "white": _white,
    "pink": _pink,
    "band": _band,
    "MLS": _mls,
    "burst random": _burst_random,
    "linear sweep": _linear_sweep,
    "logarithmic sweep": _logarithmic_sweep,
    "stepped": _stepped,
    "two close tones": _two_close_tones,
    "two tones": _two_tones,
    "AM": _am,
    "FM": _fm,
    "pulses": _pulses,
}
SINES, NOISES = (
    frozenset({"sine", "distorted sine"}),
    frozenset({"white", "pink", "band", "MLS", "burst random"}),
)


def drawn(kind: str, *seed: int) -> Recording:
    """A recording with one vibrometer channel: the signal with white noise 0 to 60 dB below it."""
    d = Draw((list(KINDS).index(kind), *seed))
    clean = KINDS[kind](d)
    clean = clean - clean.mean()
    clean /= np.sqrt(np.mean(clean**2))
    samples = 1e-3 * (clean + 10 ** (-d.between(0.0, 60.0) / 20) * d.white())
    channel = Channel(
        "Vibrometer", role="vibrometer", unit="m/s", sampling_rate=d.rate, n_samples=len(samples)
    )
    return Recording("drawn", (channel,), ArraySource([samples]))


def wrong(kind: str, answer: str) -> bool:
    """Whether an answer puts a signal into the wrong table."""
    wanted = "sine" if kind in SINES else "noise" if kind in NOISES else None
    return answer != wanted if wanted else answer in ("sine", "noise")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--signals", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kind", choices=KINDS)
    asked = parser.parse_args()
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    faults = []
    kinds = [asked.kind] if asked.kind else list(KINDS)
    for number in range(asked.signals):
        kind = kinds[number % len(kinds)]
        found = recognise(drawn(kind, asked.seed, number))
        counts[kind][found.kind] += 1
        if wrong(kind, found.kind):
            d = Draw((list(KINDS).index(kind), asked.seed, number))
            faults.append(f"{kind} {number} ({d.rate:g} Hz, {d.seconds:.1f} s): {found.kind}, {found.reason}")
    print("| kind | " + " | ".join(ANSWERS) + " |\n|---" + "|---" * len(ANSWERS) + "|")
    for kind, answers in counts.items():
        print(f"| {kind} | " + " | ".join(str(answers[a] or "") for a in ANSWERS) + " |")
    print("\n".join([f"\n{len(faults)} of {asked.signals} wrong", *faults]))


ANSWERS = ("sine", "noise", "sweep", "stepped-sine", "unknown")

if __name__ == "__main__":
    main()
