"""CPU seconds and memory of one batch over one long recording, beside a plain scipy pipeline.

``python benchmarks/batch.py [--seconds 60] [--rate 51200]`` makes a recording of 26 channels, runs
``specan batch --jobs 1`` and the plain pipeline on it in processes of their own, and prints a table.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import textwrap
from pathlib import Path

import numpy as np

CHANNELS = 26
PLAIN = textwrap.dedent(
    """
    import sys
    import numpy as np
    from nptdms import TdmsFile
    from scipy import signal

    group = TdmsFile.read(sys.argv[1])["Measurement"]
    data = {c.name: c[:] * (20.0 if c.name.startswith("Mic") else 0.05) for c in group.channels()}
    rate = float(sys.argv[2])
    v = data["Vibrometer"]
    block = dict(fs=rate, nperseg=8192)
    bands = 1000 * 10 ** (0.1 * np.arange(-17, 14))
    filters = [
        signal.butter(4, [f * 10 ** -0.05, f * 10 ** 0.05], "bandpass", fs=rate, output="sos") for f in bands
    ]
    _, vv = signal.welch(v, **block)
    for name, x in data.items():
        _, xx = signal.welch(x, **block)
        f, vx = signal.csd(v, x, **block)
        h, coherence = vx / vv, abs(vx) ** 2 / vv / xx
        levels = [10 * np.log10(np.mean(signal.sosfilt(sos, x) ** 2)) for sos in filters]
    """
)
# Runs a command and prints its CPU seconds and its peak memory; memory is that of the largest child.
MEASURE = textwrap.dedent(
    """
    import json, resource, subprocess, sys
    code = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL).returncode
    use = resource.getrusage(resource.RUSAGE_CHILDREN)
    scale = 1 if sys.platform == "darwin" else 1024
    print(json.dumps({"code": code, "cpu": use.ru_utime + use.ru_stime, "peak": use.ru_maxrss * scale / 1e6}))
    """
)


def measure(*command: str) -> dict[str, float]:
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-c", MEASURE, *command], capture_output=True, text=True, check=True, env=environment
    )
    result = json.loads(done.stdout)
    if result["code"] != 0:
        raise SystemExit(f"{command[:4]} ended with {result['code']}: {done.stderr}")
    return result


def make_recording(path: Path, seconds: int, rate: float) -> None:
    """Gaussian noise that is partly common to all channels, with the laboratory's properties."""
    from truth.rig import Take, box_rig
    from truth.rig_files import write_tdms

    rng = np.random.default_rng(1)
    n = int(seconds * rate)
    volts = np.empty((CHANNELS, n))
    common = rng.standard_normal(n, dtype=np.float32)
    for row in volts:
        row[:] = 0.05 * (common + 0.3 * rng.standard_normal(n, dtype=np.float32))
    names = (*(f"Mic {m}" for m in range(1, 25)), "Vibrometer", "Generator")
    properties: dict[str, object] = {"Excitation": "gaussian noise"}
    path.parent.mkdir(parents=True)
    write_tdms(path, box_rig(), Take(names, rate, volts, volts, properties))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=int, default=60)
    parser.add_argument("--rate", type=float, default=51200.0)
    parser.add_argument("--without-plain", action="store_true", help="leave the plain pipeline out")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        here = Path(place)
        long = here / "long" / "noise.tdms"
        make_recording(long, given.seconds, given.rate)
        batch = [sys.executable, "-m", "specan_cli", "batch", "--jobs", "1"]
        start = measure(sys.executable, "-c", "import specan.analysis.batch.run, specan_cli.batch")
        whole = measure(*batch, str(long.parent), "-o", str(here / "out"))
        rows = [("start-up", start), ("specan batch", whole)]
        over = {key: whole[key] - start[key] for key in ("cpu", "peak")}
        rows.append(("over start-up", over))
        if not given.without_plain:
            rows.append(
                ("plain npTDMS and scipy", measure(sys.executable, "-c", PLAIN, str(long), str(given.rate)))
            )
    print(f"{CHANNELS} channels, {given.seconds} s, {given.rate:g} Hz\n")
    print("| what | CPU s | peak MB |\n|---|---|---|")
    for name, row in rows:
        print(f"| {name} | {row['cpu']:.2f} | {row['peak']:.0f} |")


if __name__ == "__main__":
    main()
