"""CPU seconds and memory of PSD, H1, H2 and coherence of many channels, beside scipy and a plain FFT.

``python benchmarks/transfer_functions.py [--seconds 60] [--rate 51200] [--channels 26]`` makes noise in memory and runs
each way in a process of its own, on one thread. Memory is what comes on top of the samples. The
tone analysis of the same channels is measured along.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time

BLOCK = 8192

WAYS = {
    "rfft of every channel": "plain_fft",
    "specan: PSD, H1, coherence, uncertainty": "specan_h1",
    "specan: the same and H2": "specan_h1_h2",
    "specan: three channels (H3c)": "specan_h3c",
    "specan: tone, harmonics, phases": "specan_tone",
    "scipy welch and csd": "scipy_welch",
}


def samples(channels: int, seconds: float, rate: float):  # type: ignore[no-untyped-def]
    """Partly common noise and, for the tone analysis, a tone 20 dB above it."""
    import numpy as np

    rng = np.random.default_rng(1)
    n = int(seconds * rate)
    common = rng.standard_normal(n, dtype=np.float32)
    tone = 14 * np.cos(2 * np.pi * 250.3 / rate * np.arange(n, dtype=np.float64))
    x = np.empty((channels, n))
    for row in x:
        row[:] = common + 0.3 * rng.standard_normal(n, dtype=np.float32)
    return x, tone


def recording(x, rate: float):  # type: ignore[no-untyped-def]
    from specan.data.recording import ArraySource, Channel, Recording

    roles = ["vibrometer", "generator"] + ["microphone"] * (len(x) - 2)
    channels = tuple(
        Channel(f"{role} {k}", role=role, unit="1", sampling_rate=rate, n_samples=x.shape[1])
        for k, role in enumerate(roles)
    )
    return Recording("benchmark", channels, ArraySource(list(x)))


def plain_fft(x, rate: float) -> None:  # type: ignore[no-untyped-def]
    import numpy as np

    for row in x:
        np.fft.rfft(row)


def specan_h1(x, rate: float) -> None:  # type: ignore[no-untyped-def]
    from specan.analysis.transfer_function import TransferFunction

    TransferFunction(channels=("*",))(recording(x, rate))


def specan_h1_h2(x, rate: float) -> None:  # type: ignore[no-untyped-def]
    from specan.dsp.transfer_function import estimate
    from specan.dsp.welch import CrossSpectra

    spectra = CrossSpectra(rate, BLOCK, n_channels=len(x), references=[0])
    for start in range(0, x.shape[1], 1 << 16):
        spectra.add(x[:, start : start + (1 << 16)])
    s = spectra.result()
    for name in ("H1", "H2"):
        estimate(name, s.auto[0], s.auto[1:], s.cross[0, 1:], s.n_effective)


def specan_h3c(x, rate: float) -> None:  # type: ignore[no-untyped-def]
    from specan.analysis.transfer_function import TransferFunction

    TransferFunction(channels=("micro*",), estimator="H3c")(recording(x, rate))


def specan_tone(x, rate: float) -> None:  # type: ignore[no-untyped-def]
    from specan.analysis.tone import Tone

    Tone(frequency_hz=250.3)(recording(x, rate))


def scipy_welch(x, rate: float) -> None:  # type: ignore[no-untyped-def]
    import numpy as np
    from scipy import signal

    options = {"fs": rate, "nperseg": BLOCK}
    _, vv = signal.welch(x[0], **options)
    for row in x[1:]:
        _, yy = signal.welch(row, **options)
        _, vy = signal.csd(x[0], row, **options)
        _ = vy / vv, yy / np.conj(vy), np.abs(vy) ** 2 / vv / yy


def run_one(way: str, channels: int, seconds: float, rate: float) -> None:
    """Best CPU time of two, and peak memory of a third run, as JSON."""
    import tracemalloc

    x, tone = samples(channels, seconds, rate)
    if way == "specan_tone":
        x += tone
    action = globals()[way]
    action(x[:, : 4 * BLOCK].copy(), rate)  # imports
    times = []
    for _ in range(2):
        begin = time.process_time()
        action(x, rate)
        times.append(time.process_time() - begin)
    tracemalloc.start()
    action(x, rate)
    peak = tracemalloc.get_traced_memory()[1] / 1e6
    print(json.dumps({"cpu": min(times), "peak": peak}))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--rate", type=float, default=51200.0)
    parser.add_argument("--channels", type=int, default=26)
    parser.add_argument("--way", choices=list(WAYS.values()), help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.way:
        run_one(given.way, given.channels, given.seconds, given.rate)
        return
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    same = [f"--{name}={getattr(given, name)}" for name in ("seconds", "rate", "channels")]
    print(f"{given.channels} channels, {given.seconds:g} s, {given.rate:g} Hz, float64, blocks of {BLOCK}\n")
    print("| what | CPU s | of the rfft | MB over the samples |\n|---|---|---|---|")
    yardstick = 0.0
    for name, way in WAYS.items():
        command = [sys.executable, __file__, "--way", way, *same]
        done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
        result = json.loads(done.stdout)
        yardstick = yardstick or result["cpu"]
        print(f"| {name} | {result['cpu']:.2f} | {result['cpu'] / yardstick:.2f} | {result['peak']:.0f} |")


if __name__ == "__main__":
    main()
