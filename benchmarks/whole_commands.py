"""Commands as a user starts them: start-up, the verbs of a study, a table of 2000 rows, a directory of 10 000 files.

``python benchmarks/whole_commands.py``: CPU seconds of whole processes, one thread, the smallest of three runs each,
beside the bar of each. Needs a Unix system: CPU times of children are read there.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from small_files import cpu, write

SPECAN = str(Path(sys.executable).with_name("specan"))
BENCH = Path(__file__).parents[1] / "sample_data" / "worm_gear" / "study" / "bench"
ROWS = ["--grid", "speed_rpm=500:2900:20", "--grid", "output_torque_Nm=5:95:10"]
ROWS += ["--grid", "oil_temperature_C=58", "--repeats", "10"]
HIDDEN = ["--effects", "windage", "--noise", "0.01"]
FILES = 10_000


def start_up(place: Path) -> dict[str, tuple[float, float]]:
    """CPU seconds and bar of commands on one second of four channels."""
    write(place / "one.tdms", 4, 1)
    told = [SPECAN, "--help"], [SPECAN, "octave", place / "one.tdms"], [SPECAN, "rms", place / "one.tdms"]
    bars = 0.1, 0.5, 0.5
    return {
        f"specan {command[1]}": (min(cpu(list(map(str, command))) for _ in range(3)), bar)
        for command, bar in zip(told, bars, strict=True)
    }


def study(place: Path, rig: Path, table: Path, bars: dict[str, float]) -> dict[str, tuple[float, float]]:
    """CPU seconds and bar of the verbs, one after the other, on new studies."""
    found: dict[str, list[float]] = {verb: [] for verb in bars}
    for run in range(3):
        one = str(place / f"{table.stem}-{run}")
        for verb in bars:
            asked = [verb.split()[0], one]
            if verb == "new":
                asked += ["--model", "worm-gear", "--rig", str(rig), "--measurement", str(table)]
            if verb == "report":
                asked += ["-o", f"{one}.html"]
            found[verb].append(cpu([SPECAN, "study", *asked]))
    return {verb: (min(runs), bars[verb]) for verb, runs in found.items()}


def first_result(place: Path) -> float:
    """CPU seconds that a batch of very many files has used when the first of them is analysed."""
    data = place / "many"
    data.mkdir()
    write(data / "f00000.tdms", 4, 1)
    for number in range(1, FILES):
        os.link(data / "f00000.tdms", data / f"f{number:05d}.tdms")
    out = place / "out"
    process = subprocess.Popen(
        [SPECAN, "batch", str(data), "-o", str(out), "--jobs", "1"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    while process.poll() is None and not any(out.glob(".specan/*.result")):
        time.sleep(0.02)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    process.kill()
    process.wait()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def table() -> list[str]:
    """Lines of a table: what, CPU seconds, bar."""
    found: dict[str, tuple[float, float]] = {}
    with tempfile.TemporaryDirectory() as name:
        place = Path(name)
        found |= start_up(place)
        verbs = {
            "new": 1.0,
            "compare": 1.0,
            "diagnose": 1.0,
            "diagnose again": 1.5,
            "next": 1.5,
            "report": 1.5,
        }
        small = study(place, BENCH / "rig.toml", BENCH / "measurement.csv", verbs)
        found |= {f"study {verb}, 180 rows": row for verb, row in small.items()}
        many = place / "rows.csv"
        make = [SPECAN, "simulate", "worm-gear", str(BENCH / "rig.toml"), *ROWS, *HIDDEN, "-o", str(many)]
        subprocess.run(make, check=True, capture_output=True)
        rows = sum(1 for _ in many.open()) - 1
        large = study(place, BENCH / "rig.toml", many, dict.fromkeys(("new", "compare", "diagnose"), 5.0))
        found |= {f"study {verb}, {rows} rows": row for verb, row in large.items()}
        found[f"batch of {FILES} files, until the first result"] = first_result(place), 1.0
    return [
        "| command | CPU s | bar |",
        "|---|---|---|",
        *(
            f"| {name} | {used:.2f} | {bar:g}{'' if used <= bar else ', missed'} |"
            for name, (used, bar) in found.items()
        ),
    ]


if __name__ == "__main__":
    print("\n".join(table()))
