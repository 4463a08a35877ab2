"""CPU seconds and memory of band levels, beside a plain transform of every channel in the same run.

``python benchmarks/bands.py [--seconds 60] [--rate 51200] [--channels 26]`` prints a table: the plain
transform, linear levels with A, B, C and Z totals, Fast histories; the memory over what numpy and scipy take.
Each task is divided by a plain transform of four channels right behind it.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import textwrap

# Each task in a process of its own: `samples()` yields consecutive blocks of one second.
PREPARE = """
import json, resource, sys, time
import numpy as np, scipy.fft, scipy.signal
seconds, rate, rows = float(sys.argv[1]), float(sys.argv[2]), int(sys.argv[3])
pool = np.random.default_rng(1).standard_normal((rows, 1 << 17))

def samples():
    left = round(seconds * rate)
    while left > 0:
        yield pool[:, : min(left, pool.shape[1])]
        left -= pool.shape[1]

def recorded(analysis):
    for block in samples():
        analysis.add(block)
    return analysis.result()

scale = 1 if sys.platform == "darwin" else 1024
start_memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
"""
REPORT = """
peak = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - start_memory) * scale / 1e6
# The yardstick right behind what is measured: other work on the machine changes from minute to minute.
channel = np.random.default_rng(1).standard_normal(round(seconds * rate))
scipy.fft.rfft(channel)
start = time.process_time()
for row in range(4):
    scipy.fft.rfft(channel)
plain = (time.process_time() - start) * rows / 4
print(json.dumps({"cpu": cpu, "peak": peak, "plain": plain}))
"""
LINEAR = """
from specan.dsp import bands
from specan.dsp.band_energy import BandEnergyAccumulator
from specan.dsp.weighting import power_weighting
start = time.process_time()
spectrum = recorded(BandEnergyAccumulator(rows, rate, round(seconds * rate)))
index = bands.band_range(20.0, 20000.0 if rate > 45000 else 0.4 * rate, {fraction})
levels = spectrum.band_mean_square(bands.Bands.octaves({fraction}, index))
totals = [spectrum.nodes @ power_weighting(spectrum.frequencies, w) for w in "ABC"]
cpu = time.process_time() - start
"""
HISTORY = """
from specan.dsp import bands
from specan.dsp.band_history import Average, BandHistoryAccumulator, Record
from specan.dsp.band_history import band_filter, weighting_filter
index = bands.band_range(20.0, 20000.0 if rate > 45000 else 0.4 * rate, {fraction})
filters = [band_filter(*bands.Bands.octaves({fraction}, int(k))) for k in index] + [weighting_filter(w) for w in "ABCZ"]
start = time.process_time()
n = round(seconds * rate)
recorded(BandHistoryAccumulator(Record(rows, rate, n), filters, Average(0.125, None, np.arange(1, seconds * 8) / 8)))
cpu = time.process_time() - start
"""
TASKS = {
    "plain transform of every channel": """
n = round(seconds * rate)
channel = np.random.default_rng(1).standard_normal(n)
scipy.fft.rfft(channel)
start = time.process_time()
for row in range(rows):
    scipy.fft.rfft(channel)
cpu = time.process_time() - start
""",
    "1/3 octave levels and A, B, C, Z": LINEAR.format(fraction=3),
    "1/24 octave levels and A, B, C, Z": LINEAR.format(fraction=24),
    "1/3 octave Fast histories and totals": HISTORY.format(fraction=3),
    "1/24 octave Fast histories and totals": HISTORY.format(fraction=24),
}


def measure(task: str, *arguments: str) -> dict[str, float]:
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    code = textwrap.dedent(PREPARE) + TASKS[task] + REPORT
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=True, env=environment
    )
    return dict(json.loads(done.stdout))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--rate", type=float, default=51200.0)
    parser.add_argument("--channels", type=int, default=26)
    parser.add_argument("--no-histories", action="store_true", help="They take a minute or more.")
    asked = parser.parse_args()
    print(f"{asked.channels} channels x {asked.seconds:g} s at {asked.rate:g} Hz")
    print("| task | CPU s | x transform | MB over start-up |")
    print("|---|---|---|---|")
    for task in TASKS:
        if "histories" in task and asked.no_histories:
            continue
        found = measure(task, str(asked.seconds), str(asked.rate), str(asked.channels))
        ratio = found["cpu"] / found["plain"]
        print(f"| {task} | {found['cpu']:.2f} | {ratio:.2f} | {found['peak']:.0f} |")


if __name__ == "__main__":
    main()
