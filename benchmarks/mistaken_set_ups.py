"""How often a mistake of the set-up is told from an effect: rooms with strong effects, with and without a mistake.

    python benchmarks/mistaken_set_ups.py --rooms 9 --seed 6100 --cache DIR

Every room of `room_search` is recorded once and described six times: rightly, with two microphones exchanged, with all
of them shuffled, with the loudspeaker in another wall, and with the vibrometer or one microphone of reversed sign.
Mistakes and places are drawn.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

import numpy as np
from room_search import drawn

from specan.models.catalogue import load_model
from specan.room.study.of_field import initial_fit, mistake_beside
from specan.room.study.open_recordings import open_data
from specan.study.estimation.fit import fit
from specan.study.estimation.problem import Problem
from specan.study.localisation.localise import MistakenSetUp, mistaken_set_up
from specan.study.observation import DataFile, MeasuredFiles
from specan.study.progress import unheard
from specan.study.selection.candidates import base_problem
from specan.study.selection.refits import Refit
from truth.room import RoomCase, simulate, write
from truth.room.box import WALLS

F_MAX_HZ = 400.0
KINDS = ("lining", "corner", "warm", "lining-warm", "box", "moved", "two-moved", "panel-delay", "null")


def described(made: RoomCase, rig: dict[str, Any], sign: np.ndarray, folder: Path) -> Problem:
    """The room model as a rig file describes it, over the recording with signs of its microphones."""
    path, _ = write(made, folder)
    model = load_model("room", rig)
    data = open_data(model, MeasuredFiles([DataFile("recording", path)]))
    problem = base_problem(model, data.fitted)
    return problem.over([replace(o, response=sign[:, None] * o.response) for o in problem.observations])


def looked_for(problem: Problem) -> MistakenSetUp:
    """As a diagnosis does: in the data as they are, then in what the effects of a first fit leave."""
    found = mistaken_set_up(problem)
    if found.text:
        return found
    start = Refit(frozenset(), problem, fit(problem))
    return mistake_beside(initial_fit(start, unheard), problem) if start.poor_fit else found


def mistakes(rig: dict[str, Any], seed: int) -> Iterator[tuple[str, str, dict[str, Any], np.ndarray]]:
    """Descriptions of one room: the kind of mistake, what has to be said of it, the rig file, signs of microphones."""
    rng = np.random.default_rng([seed, 99])
    places = rig["mics"]["position_m"]
    right = np.ones(len(places))
    yield "none", "", rig, right
    for kind in ("exchanged", "shuffled"):
        order = np.arange(len(places))
        if kind == "exchanged":
            first, second = sorted(rng.choice(len(places), 2, replace=False))
            order[[first, second]] = second, first
            said = f"Mic {first + 1} and Mic {second + 1} are exchanged"
        else:
            order = rng.permutation(len(places))
            said = "belong to other channels"
        wrong = deepcopy(rig)
        wrong["mics"]["position_m"] = [places[k] for k in order]
        yield kind, said, wrong, right
    wrong, dims = deepcopy(rig), np.array(rig["room"]["dims_m"])
    wall = str(rng.choice([w for w in WALLS if w != rig["piston"]["wall"]]))
    centre = rng.uniform(0.1, dims - 0.1)
    centre["xyz".index(wall[0])] = dims["xyz".index(wall[0])] if wall[1] == "1" else 0.0
    wrong["piston"] |= {"wall": wall, "centre_m": [float(c) for c in centre]}
    yield "other wall", f"in wall {rig['piston']['wall']} near", wrong, right
    yield "vibrometer reversed", "the vibrometer has reversed sign", rig, -right
    one = int(rng.integers(len(places)))
    turned = np.where(np.arange(len(places)) == one, -1.0, 1.0)
    yield "microphone reversed", f"Mic {one + 1} has reversed sign", rig, turned


def main() -> int:
    """Run and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rooms", type=int, default=9)
    parser.add_argument("--seed", type=int, default=6100)
    parser.add_argument("--mics", type=int, default=8)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS)
    parser.add_argument("--cache", type=Path)
    arguments = parser.parse_args()
    counts: dict[str, list[int]] = {}
    for number in range(arguments.rooms):
        seed, kind = arguments.seed + number, arguments.kinds[number % len(arguments.kinds)]
        made = simulate(seed, drawn(kind, seed, arguments.mics), n_mics=arguments.mics, cache=arguments.cache)
        made.rig["band"]["f_max_hz"] = F_MAX_HZ
        with tempfile.TemporaryDirectory() as folder:
            for mistake, said, rig, sign in mistakes(made.rig, seed):
                problem = described(made, rig, sign, Path(folder))
                start = time.process_time()
                found = looked_for(problem)
                right = said in found.text if said else not found.text
                outcome = 0 if right else 1 if not found.text else 2
                counts.setdefault(mistake, [0, 0, 0])[outcome] += 1
                print(f"{seed} {kind}, {mistake} ({said}): {found.text or '-'}; {found.before_percent:.3g} to "
                      f"{found.after_percent:.3g} %, {time.process_time() - start:.1f} CPU s", flush=True)  # fmt: skip
    print("| mistake | said rightly | not seen | said wrongly |\n|---|---|---|---|")
    for mistake, (right, silent, wrong) in counts.items():
        print(f"| {mistake} | {right} | {silent} | {wrong} |")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
