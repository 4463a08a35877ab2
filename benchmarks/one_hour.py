"""A recording of one hour, 26 channels at 51.2 kHz: what a batch takes for it, CPU seconds and memory over start-up.

``python benchmarks/one_hour.py [--seconds 3600]``; with ``--page`` what the page needs to draw four waveforms of a
file that takes no room on the disk, the first time and again.

Its 19 GB are not written: samples are made when they are asked for, noise over and over.
"""

from __future__ import annotations

import argparse
import os
import resource
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from specan.analysis.batch.one_file import _levels
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


def silence(path: Path, seconds: float, channels: int = 4) -> None:
    """A WAV file whose samples are a hole in the disk."""
    size, rate = round(seconds * RATE) * channels * 2, round(RATE)
    head = b"RIFF" + (36 + size).to_bytes(4, "little") + b"WAVEfmt " + (16).to_bytes(4, "little")
    numbers = ((1, 2), (channels, 2), (rate, 4), (2 * channels * rate, 4), (2 * channels, 2), (16, 2))
    head += b"".join(n.to_bytes(width, "little") for n, width in numbers)
    with path.open("wb") as file:
        file.write(head + b"data" + size.to_bytes(4, "little"))
        file.truncate(len(head) + 8 + size)


def page(seconds: float) -> None:
    """Print CPU seconds until the waveforms are drawn: from the first piece, and from all samples."""
    from specan.inspect.opened import watched
    from specan.io.open import open_recording
    from specan.report.waveform import Waveform, read_overviews

    with tempfile.TemporaryDirectory() as place:
        os.environ["SPECAN_CONFIG_DIR"] = place
        path = Path(place, "hour.wav")
        silence(path, seconds)
        for time_of in ("first", "second"):
            start = time.process_time()
            opened = watched(open_recording(path), path)
            waveforms = [Waveform(opened, channel) for channel in opened.channels]
            drawn: list[float] = []

            def draw(part: float) -> bool:
                if not drawn or part == 1.0:  # noqa: B023
                    for waveform in waveforms:  # noqa: B023
                        waveform.part(0.0, seconds, 1500)
                    drawn.append(time.process_time() - start)  # noqa: B023
                return True

            read_overviews(waveforms, draw)
            print(f"{time_of} time: first picture {drawn[0]:.2f} CPU s, complete {drawn[-1]:.2f} CPU s")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=3600.0)
    parser.add_argument("--page", action="store_true")
    asked = parser.parse_args()
    if asked.page:
        page(asked.seconds)
        return
    hour = recording(asked.seconds)
    before, start = peak(), time.process_time()
    found = _levels(hour, BatchSettings(), FileResult("hour.tdms", "done", ""), "noise")
    lines = {name: text.count("\n") for name, text in found.blocks.items()}
    print(f"{CHANNELS} channels x {asked.seconds:g} s at {RATE:g} Hz: {lines}")
    print("| CPU s | MB over start-up | MB |")
    print("|---|---|---|")
    print(f"| {time.process_time() - start:.0f} | {peak() - before:.0f} | {peak():.0f} |")


if __name__ == "__main__":
    main()
