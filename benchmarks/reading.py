"""Reading 26 channels in blocks: specan beside numpy.fromfile with one conversion, and npTDMS.

    python benchmarks/reading.py [--seconds 60] [--rate 51200] [--directory DIR] [--with-nptdms]

Each figure is taken in a process of its own, with the file in the page cache; CPU seconds include
the system's, memory is the peak above what the process had after its imports. npTDMS reads channel
by channel from an open file; on interleaved and DAQmx files that takes minutes and is left out
unless asked for.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "io"))
from tdms_bytes import (
    DAQMX,
    INTERLEAVED,
    META,
    NEW_LIST,
    NO_DATA,
    daqmx,
    linear,
    path,
    plain,
    segment,
    wave,
)

CHANNELS = 26
SLOPE = 10.0 / 2**23
LAYOUTS = ("contiguous", "1000 segments", "interleaved", "DAQmx")


def write(file: Path, layout: str, rate: int, seconds: float) -> None:
    """A rig's file: 24 bits in int32, linear scale, the same noise in every second of it."""
    n = int(rate * seconds)
    block = np.random.default_rng(1).integers(-(2**22), 2**22, (CHANNELS, rate), dtype=np.int32)
    pieces = 1000 if layout == "1000 segments" else 1
    each = n // pieces
    names = [f"Mic {k + 1}" for k in range(CHANNELS - 2)] + ["Vibrometer", "Generator"]
    scale = linear(SLOPE, number=1, source=0) if layout == "DAQmx" else linear(SLOPE)
    flags = META | NEW_LIST
    flags |= INTERLEAVED if layout == "interleaved" else DAQMX if layout == "DAQmx" else 0
    objects = [("/", NO_DATA, {}), (path("Measurement"), NO_DATA, {})]
    for k, name in enumerate(names):
        index = plain("i4", each)
        if layout == "DAQmx":
            index = daqmx(each, [("i4", 0, 4 * k, 0)], [4 * CHANNELS])
        objects.append((path("Measurement", name), index, {**wave(rate), **scale}))
    with file.open("wb") as out:
        for number in range(pieces):
            if number == 1:  # LabVIEW repeats what has changed, that is nothing
                objects = [(name, index, {}) for name, index, _ in objects]
            head = segment(objects, b"x", flags=flags)[:-1]
            size = each * CHANNELS * 4
            # The header was made for one byte of data: say how many there are.
            head = (
                head[:12] + (int.from_bytes(head[20:28], "little") + size).to_bytes(8, "little") + head[20:]
            )
            out.write(head)
            first = number * each
            if layout in ("interleaved", "DAQmx"):
                rows = np.ascontiguousarray(block.T)
                for start in range(first, first + each, rate):
                    out.write(rows[: min(rate, first + each - start)].tobytes())
            else:
                for k in range(CHANNELS):
                    for start in range(first, first + each, rate):
                        out.write(block[k, : min(rate, first + each - start)].tobytes())


def by_specan(file: Path, rate: int) -> int:
    from specan.io.open import open_recording

    recording = open_recording(file)
    return sum(b.size for b in recording.blocks(recording.channels, rate))


def by_fromfile(file: Path, rate: int) -> int:
    done, store = 0, np.empty(CHANNELS * rate)
    with file.open("rb") as source:
        while (raw := np.fromfile(source, dtype=np.int32, count=CHANNELS * rate)).size:
            np.multiply(raw, SLOPE, out=store[: raw.size])
            done += raw.size
    return done


def by_nptdms(file: Path, rate: int) -> int:
    from nptdms import TdmsFile

    with TdmsFile.open(file) as opened:
        return sum(len(c[:]) for c in opened["Measurement"].channels())


def by_headers(file: Path, rate: int) -> int:
    from specan.io.open import open_recording

    return len(open_recording(file).channels)


WAYS = {"specan": by_specan, "fromfile": by_fromfile, "npTDMS": by_nptdms, "headers": by_headers}


def resident() -> float:
    """Resident memory in MB."""
    with open("/proc/self/statm") as statm:
        return int(statm.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def measure(way: str, file: Path, rate: int) -> None:
    """In a process of its own: CPU seconds, wall seconds and peak memory of one way."""
    import nptdms  # noqa: F401  # imports are not what is measured

    import specan.io.open
    import specan.io.tdms  # noqa: F401

    before, peak, done = resident(), [0.0], threading.Event()

    def watch() -> None:
        while not done.wait(0.005):
            peak[0] = max(peak[0], resident())

    watcher = threading.Thread(target=watch)
    watcher.start()
    wall, cpu = time.perf_counter(), time.thread_time()
    WAYS[way](file, rate)
    wall, cpu = time.perf_counter() - wall, time.thread_time() - cpu
    done.set()
    watcher.join()
    print(json.dumps({"cpu": cpu, "wall": wall, "peak_mb": max(peak[0], resident()) - before}))


def run(way: str, file: Path, rate: int, repeats: int) -> dict[str, float]:
    results = []
    for _ in range(repeats):
        command = [sys.executable, __file__, "--measure", way, "--file", str(file), "--rate", str(rate)]
        results.append(json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout))
    return min(results, key=lambda r: r["cpu"])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--rate", type=int, default=51200)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--directory", type=Path, default=None)
    parser.add_argument("--with-nptdms", action="store_true", help="also where it takes minutes")
    parser.add_argument("--measure", choices=WAYS, help=argparse.SUPPRESS)
    parser.add_argument("--file", type=Path, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.measure:
        measure(args.measure, args.file, args.rate)
        return
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    size = CHANNELS * args.rate * args.seconds * 4 / 1e6
    print(f"{CHANNELS} channels x {args.seconds:g} s x {args.rate} Hz, int32, {size:.0f} MB; blocks of 1 s")
    print("| layout | headers s | specan CPU s | peak MB | x fromfile | x npTDMS |")
    print("|---|---|---|---|---|---|")
    for layout in LAYOUTS:
        with tempfile.TemporaryDirectory(dir=args.directory) as place:
            file = Path(place) / "recording.tdms"
            write(file, layout, args.rate, args.seconds)
            ours = run("specan", file, args.rate, args.repeats)
            limit = run("fromfile", file, args.rate, args.repeats)
            headers = run("headers", file, args.rate, args.repeats)
            peer = "-"
            if args.with_nptdms or layout in ("contiguous", "1000 segments"):
                peer = f"{ours['cpu'] / run('npTDMS', file, args.rate, 1)['cpu']:.3f}"
            print(
                f"| {layout} | {headers['wall']:.3f} | {ours['cpu']:.2f} | {ours['peak_mb']:.0f} "
                f"| {ours['cpu'] / limit['cpu']:.2f} | {peer} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
