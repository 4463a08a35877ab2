"""Do the intervals of `specan study impedance` cover the truth? Counted on simulated rooms with one soft wall.

    python benchmarks/impedance_coverage.py --rooms 12 --cache ~/.cache/rooms --out coverage.jsonl
    python benchmarks/impedance_coverage.py --report coverage.jsonl

Rooms, positions, instruments, noise, the soft wall, what it is lined with and how soft it is are drawn; the
estimate sees the recording and the rig file. Results are appended to a file as they come, and a run that was broken
off goes on where it stopped. The bar: 90 to 98 % of at least 200 wall-band intervals.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from specan.models.catalogue import load_model
from specan.room.model.places import wall_areas
from specan.room.study.open_recordings import open_data
from specan.room.wall_impedance.surface_impedance import FUNCTIONS, Impedance, impedance
from specan.room.wall_impedance.wall_admittance import wall_fit
from specan.schema import read_toml
from specan.study.observation import DataFile, MeasuredFiles
from specan.study.selection.candidates import base_problem
from truth.room import Truth, simulate, write
from truth.room.box import WALLS
from truth.room.branch import Lining

FIRST_SEED = 3000
SOFT = {"wall-impedance": (0.03, 0.2), "porous-absorber": (0.3, 1.0)}  # strengths


def true_admittance(truth: Truth, frequency_hz: np.ndarray) -> np.ndarray:
    """rho c / Z of every wall, array (walls, frequencies)."""
    room, omega = truth.room, 2 * np.pi * frequency_hz
    found = np.repeat(np.array(room.admittance, dtype=complex)[:, None], len(frequency_hz), axis=1)
    for part in room.parts:
        assert isinstance(part, Lining)
        m = part.motion
        impedance = m.resistance + 1j * (omega * m.mass - m.stiffness / omega)
        found[WALLS.index(part.wall)] += room.density * room.sound_speed / impedance
    return found


def hidden(seed: int) -> dict[str, float]:
    """What is hidden in the room of a seed: one soft wall."""
    rng = np.random.default_rng([seed, 77])
    name = sorted(SOFT)[seed % len(SOFT)]
    return {name: float(rng.uniform(*SOFT[name]))}


def one_room(
    seed: int, cache: Path | None, n_mics: int = 12, duration_s: float = 5.0
) -> Iterator[dict[str, Any]]:
    """Simulate a room, estimate its walls, and hold every interval against the truth."""
    effects = hidden(seed)
    case = simulate(seed, effects, n_mics=n_mics, duration_s=duration_s, cache=cache)
    with TemporaryDirectory() as folder:
        recording, rig = write(case, folder)
        model = load_model("room", read_toml(rig))
        data = open_data(model, MeasuredFiles([DataFile("recording", recording)]))
    begun = time.process_time()
    fit = wall_fit(base_problem(model, data.fitted))
    band = model.settings["rig"]["band"]
    areas = wall_areas(model.settings["rig"]["room"]["dims_m"])
    found = impedance(fit, areas, (band["f_min_hz"], band["f_max_hz"]))
    soft = next(iter(case.truth.details.values()))["wall"]
    spent = time.process_time() - begun
    for row in compare(found, case.truth, areas):
        yield {
            "seed": seed,
            "effects": effects,
            "soft": soft,
            "cpu_s": spent,
            "chi2": fit.reduced_chi2,
            **row,
        }


def compare(found: Impedance, truth: Truth, areas: Any) -> Iterator[dict[str, Any]]:
    """For every wall-band whether each interval holds the truth."""
    share = np.array([areas[wall] for wall in WALLS])
    for row in found.table.itertuples():
        beta = true_admittance(truth, np.array([row.mid_hz]))
        walls = dict(zip(WALLS, beta, strict=True)) | {"all": share @ beta / share.sum()}
        true = {n: float(f(walls[row.wall])[0]) for n, f in FUNCTIONS.items()}
        held = {
            n: getattr(row, f"{n}_low") <= value <= getattr(row, f"{n}_high") for n, value in true.items()
        }
        yield {
            "wall": row.wall, "third_octave_hz": row.third_octave_hz, "determined": row.determined, "held": held,
            "z": float((row.admittance - walls[row.wall][0]).real / row.standard_error),
        }  # fmt: skip


def table(rows: Iterable[dict[str, Any]]) -> str:
    """Share of intervals that hold the truth, with its 95 % interval (Wilson)."""
    rows = list(rows)
    groups = {
        "determined, any wall": [r for r in rows if r["determined"] and r["wall"] != "all"],
        "determined, the soft wall": [r for r in rows if r["determined"] and r["wall"] == r["soft"]],
        "mean over the walls": [r for r in rows if r["wall"] == "all"],
        "not determined": [r for r in rows if not r["determined"]],
    }
    lines = [f"{len({r['seed'] for r in rows})} rooms"]
    for name, some in groups.items():
        lines.append(f"{name}: {len(some)} wall-bands")
        for quantity in FUNCTIONS:
            held = sum(r["held"][quantity] for r in some)
            if some:
                low, high = wilson(held, len(some))
                lines.append(
                    f"  {quantity:20s} {held:5d} = {100 * held / len(some):5.1f} %  ({low:.1f} to {high:.1f} %)"
                )
    return "\n".join(lines)


def wilson(held: int, n: int) -> tuple[float, float]:
    """95 % interval of a share, percent (Wilson 1927)."""
    p, z = held / n, 1.96
    middle = (p + z**2 / (2 * n)) / (1 + z**2 / n)
    half = z / (1 + z**2 / n) * np.sqrt(p * (1 - p) / n + z**2 / (4 * n**2))
    return 100 * (middle - half), 100 * (middle + half)


def read(path: Path) -> list[dict[str, Any]]:
    """Results that stand in a file."""
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rooms", type=int, default=12)
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED)
    parser.add_argument("--cache", type=Path, help="directory of impulse responses")
    parser.add_argument("--out", type=Path, default=Path("impedance_coverage.jsonl"))
    parser.add_argument("--report", type=Path, help="only count what stands in this file")
    arguments = parser.parse_args()
    if arguments.report is None:
        done = {r["seed"] for r in read(arguments.out)}
        for seed in range(arguments.first_seed, arguments.first_seed + arguments.rooms):
            if seed not in done:
                rows = list(one_room(seed, arguments.cache))
                with arguments.out.open("a") as file:
                    file.writelines(json.dumps(row) + "\n" for row in rows)
    print(table(read(arguments.report or arguments.out)))


if __name__ == "__main__":
    main()
