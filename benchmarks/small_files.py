"""Many short files: `specan batch` beside a plain loop of npTDMS and scipy, CPU seconds of whole processes.

``python benchmarks/small_files.py [--files 40] [--channels 4]``; with ``--jobs`` one process beside two instead, with
``--fixed`` what a single short file costs whatever its length.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

RATE, SECONDS = 51200, 1
PLAIN = """
import sys
from pathlib import Path
import numpy as np
from nptdms import TdmsFile
from scipy import signal
bands = 1000.0 * 10.0 ** (0.1 * np.arange(-17, 14))
filters = [signal.butter(4, [f * 10**-0.05, f * 10**0.05], "bandpass", fs=51200, output="sos") for f in bands]
for path in sorted(Path(sys.argv[1]).glob("*.tdms")):
    channels = [c[:] for c in TdmsFile.read(path)["Measurement"].channels()]
    reference = channels[-1]
    _, xx = signal.welch(reference, 51200, nperseg=8192)
    for x in channels:
        _, yy = signal.welch(x, 51200, nperseg=8192)
        _, xy = signal.csd(reference, x, 51200, nperseg=8192)
        xy / xx, np.abs(xy) ** 2 / xx / yy
        [10 * np.log10(np.mean(signal.sosfilt(sos, x) ** 2)) for sos in filters]
"""


def write(path: Path, channels: int, seed: int, seconds: int = SECONDS) -> None:
    """One recording of noise, raw int32 with a linear scale."""
    from nptdms import ChannelObject, GroupObject, TdmsWriter

    rng = np.random.default_rng(seed)
    common = rng.standard_normal(RATE * seconds)
    objects = [GroupObject("Measurement", {"Excitation": "gaussian noise"})]
    for number in range(channels):
        name = f"Mic {number + 1}" if number < channels - 1 else "Vibrometer"
        samples = 0.5 * np.roll(common, 3 * number) + 0.2 * rng.standard_normal(common.size)
        unit = "Pa" if number < channels - 1 else "m/s"
        properties = {"wf_increment": 1 / RATE, "NI_ChannelName": name, "unit_string": unit}
        objects.append(ChannelObject("Measurement", name, samples, properties))
    with TdmsWriter(str(path)) as writer:
        writer.write_segment(objects)


def cpu(command: list[str]) -> float:
    """CPU seconds of a process, which may keep compiled modules as an installation does."""
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, capture_output=True, env=environment)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def table(files: int = 40, channels: int = 4) -> list[str]:
    """Lines of a table: CPU seconds of both, the smaller of two runs each, taken in turn."""
    with tempfile.TemporaryDirectory() as place:
        data = Path(place, "data")
        data.mkdir()
        for number in range(files):
            write(data / f"f{number:03d}.tdms", channels, number)
        ours, plain = [], []
        specan = str(Path(sys.executable).with_name("specan"))
        for run in range(2):
            ours.append(cpu([specan, "batch", str(data), "-o", f"{place}/{run}", "--jobs", "1"]))
            plain.append(cpu([sys.executable, "-c", PLAIN, str(data)]))
    return [
        f"| what, {files} files of {channels} channels | CPU s | of the plain loop |",
        "|---|---|---|",
        *(
            f"| {name} | {min(runs):.2f} | {min(runs) / min(plain):.2f} |"
            for name, runs in (("specan batch", ours), ("plain npTDMS and scipy", plain))
        ),
    ]


def scaling(files: int = 200, channels: int = 4) -> list[str]:
    """Lines of a table: wall and CPU seconds with one and two processes, the smaller of two runs each."""
    found: dict[int, list[tuple[float, float]]] = {1: [], 2: []}
    with tempfile.TemporaryDirectory() as place:
        data = Path(place, "data")
        data.mkdir()
        for number in range(files):
            write(data / f"f{number:03d}.tdms", channels, number)
        specan = str(Path(sys.executable).with_name("specan"))
        for run in range(2):
            for jobs, runs in found.items():
                start = time.monotonic()
                used = cpu([specan, "batch", str(data), "-o", f"{place}/{run}{jobs}", "--jobs", str(jobs)])
                runs.append((time.monotonic() - start, used))
    best = {jobs: [min(column) for column in zip(*runs, strict=True)] for jobs, runs in found.items()}
    return [
        f"| {files} files of {channels} channels, processes | wall s | of one process | CPU s |",
        "|---|---|---|---|",
        *(f"| {jobs} | {w:.2f} | {w / best[1][0]:.2f} | {c:.2f} |" for jobs, (w, c) in best.items()),
    ]


def fixed(channels: int = 26, longer: int = 10) -> list[str]:
    """Lines of a table: a file of 1 s, a longer one, and what of the first is neither start-up nor goes with length."""
    specan = str(Path(sys.executable).with_name("specan"))
    used: dict[str, list[float]] = {}
    with tempfile.TemporaryDirectory() as place:
        for seconds in (1, longer):
            Path(place, str(seconds)).mkdir()
            write(Path(place, str(seconds), "f.tdms"), channels, 1, seconds)
        for run in range(3):
            begin = cpu([sys.executable, "-c", "import specan.analysis.batch.run, specan.io.tdms"])
            used.setdefault("start-up", []).append(begin)
            for seconds in (1, longer):
                command = [
                    specan,
                    "batch",
                    f"{place}/{seconds}",
                    "-o",
                    f"{place}/{seconds}-{run}",
                    "--jobs",
                    "1",
                ]
                used.setdefault(f"{seconds} s", []).append(cpu(command))
    start, short, long = (min(runs) for runs in used.values())
    per_second = (long - short) / (longer - 1)
    rows = [*used.items(), ("per second of recording", [per_second]), ("fixed", [short - start - per_second])]
    return [
        f"| one file of {channels} channels | CPU s |",
        "|---|---|",
        *(f"| {name} | {min(runs):.2f} |" for name, runs in rows),
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--files", type=int)
    parser.add_argument("--channels", type=int, default=4)
    parser.add_argument("--jobs", action="store_true", help="one process beside two")
    parser.add_argument("--fixed", action="store_true", help="one file of 26 channels")
    asked = parser.parse_args()
    if asked.fixed:
        print("\n".join(fixed()))
    elif asked.jobs:
        print("\n".join(scaling(asked.files or 200, asked.channels)))
    else:
        print("\n".join(table(asked.files or 40, asked.channels)))


if __name__ == "__main__":
    main()
