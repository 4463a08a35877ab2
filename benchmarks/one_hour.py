"""A recording of one hour, 26 channels at 51.2 kHz: what a batch takes for it, CPU seconds and memory over start-up.

``python benchmarks/one_hour.py [--seconds 3600]``

Its 19 GB are not written: samples are made when they are asked for, noise over and over.
"""

from __future__ import annotations

import argparse
import resource
import sys
import time

import numpy as np
from numpy.typing import NDArray

from specan.analysis.batch.one_file import _noise
from specan.analysis.batch.result import FileResult
from specan.analysis.batch.settings import BatchSettings
from specan.data.recording import Channel, Recording

RATE, CHANNELS, POOL = 51200.0, 26, 1 << 20


class Repeated:
    """The same noise again and again; each channel begins elsewhere in it."""

    def __init__(self) -> None:
        common = np.random.default_rng(1).standard_normal(POOL)
        self._pool = np.concatenate([common, common[: 1 << 17]])

    def read(self, indices: list[int], start: int, stop: int) -> NDArray[np.float64]:
        found = np.empty((len(indices), stop - start))
        for row, index in zip(found, indices, strict=True):
            for done in range(0, stop - start, 1 << 17):
                part = row[done : done + (1 << 17)]
                first = (start + done - 3 * index) % POOL
                part[:] = self._pool[first : first + part.size]
        return found


def recording(seconds: float) -> Recording:
    """24 microphones, the vibrometer and the generator."""
    names = [f"Mic {m}" for m in range(1, 25)] + ["Vibrometer", "Generator"]
    roles = ["microphone"] * 24 + ["vibrometer", "generator"]
    units = ["Pa"] * 24 + ["m/s", "V"]
    channels = tuple(
        Channel(name, unit=unit, role=role, sampling_rate=RATE, n_samples=round(seconds * RATE))
        for name, unit, role in zip(names, units, roles, strict=True)
    )
    return Recording("hour.tdms", channels, Repeated())


def peak() -> float:
    """MB."""
    return (
        resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024) / 1e6
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=3600.0)
    asked = parser.parse_args()
    hour = recording(asked.seconds)
    before, start = peak(), time.process_time()
    found = _noise(hour, BatchSettings(), FileResult("hour.tdms", "done", ""))
    lines = {name: text.count("\n") for name, text in found.blocks.items()}
    print(f"{CHANNELS} channels x {asked.seconds:g} s at {RATE:g} Hz: {lines}")
    print("| CPU s | MB over start-up | MB |")
    print("|---|---|---|")
    print(f"| {time.process_time() - start:.0f} | {peak() - before:.0f} | {peak():.0f} |")


if __name__ == "__main__":
    main()
