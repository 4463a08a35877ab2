"""How often a diagnosis of a room finds its way from far away: cases far from the base, and the minimum at the truth.

    python benchmarks/room_search.py --cases 20 --seed 3000 --cache DIR --out results.jsonl
    python benchmarks/room_search.py --report results.jsonl

Each case hides something in a simulated room, nothing in some, asks for a verdict, and starts a fit at the truth
besides. A search has missed the minimum where none of the first sets that it ranks comes as low as that fit. Strengths,
walls, places and frequencies are drawn; intervals of what is named are compared with the truth.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
import traceback
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

import numpy as np

from hidden_effects.run import fingerprint
from specan.study.create import begin
from specan.study.estimation.continuation import about
from specan.study.estimation.levenberg_marquardt import descend_steps
from specan.study.estimation.problem import Problem
from specan.study.study import Study
from truth.room import EFFECTS, RoomCase, simulate, write
from truth.room.box import Box, Disc
from truth.room.field import _step

JACOBIANS = 8  # from the truth, and from where a search has ended
MISSED = 1.1, 12.0  # times the chi-square at the truth, and beyond it, above which a search has missed it
HELD_OUT = 2
SHORTEST = 60.0  # wave number times radius up to which modes are summed; what is beyond is 3e-4 of the sum
COMPARED = 2  # sets of the ranking, with the fit from the truth
SINGLE = {
    "panel": "panel-resonance",
    "leak": "leak",
    "resonator": "helmholtz-resonator",
    "edge": "dimension-error",
    "gain": "microphone-gain",
    "breakup": "piston-breakup",
    "object": "scatterer",
    "second-source": "flanking-source",
}
OUTSIDE = ("extended-reaction", "drifting-air", "shaken-microphone")
OF_A_MICROPHONE = ("microphone-position", "microphone-gain")

Values = dict[str, dict[str, float]]


def drawn(kind: str, seed: int, n_mics: int) -> dict[str, float]:
    """What is hidden in a case, with strengths and places that are drawn."""
    rng = np.random.default_rng([seed, 40])
    sign = float(rng.choice([-1.0, 1.0]))
    first, second = (int(m) + 1 for m in rng.choice(n_mics, 2, replace=False))
    lining = {"wall-impedance": float(np.exp(rng.uniform(*np.log([0.3, 1.0]))))}
    warm = {"temperature": sign * rng.uniform(10.0, 14.0)}
    if kind in SINGLE or kind == "outside":
        name = SINGLE.get(kind) or str(rng.choice(OUTSIDE))
        effect = EFFECTS[name]
        strength = float(np.exp(rng.uniform(*np.log([effect.low, effect.high]))))
        at = f"@Mic {first}" if name in OF_A_MICROPHONE else ""
        return {name + at: sign * strength if effect.both_signs else strength}
    return {
        "null": {},
        "lining": lining,
        "corner": {"helmholtz-resonator@corner": float(np.exp(rng.uniform(*np.log([1e-3, 4e-3]))))},
        "warm": warm,
        "lining-warm": lining | warm,
        "box": {"scatterer@floor": float(np.exp(rng.uniform(*np.log([2e-3, 5e-3]))))},
        "moved": {f"microphone-position@Mic {first}": rng.uniform(0.025, 0.045)},
        "two-moved": {
            f"microphone-position@Mic {first}": rng.uniform(0.025, 0.045),
            f"microphone-position@Mic {second}": sign * rng.uniform(0.02, 0.04),
        },
        "delay": {
            "microphone-delay": sign * rng.uniform(3e-5, 1.5e-4)
        },  # one card: beside the vibrometer's 1e-5 s
        "leak-moved": {
            "leak": float(np.exp(rng.uniform(*np.log([3e-4, 5e-3])))),
            f"microphone-position@Mic {first}": rng.uniform(0.01, 0.04),
        },
        "panel-delay": {
            "panel-resonance": float(np.exp(rng.uniform(*np.log([0.1, 0.5])))),
            "microphone-delay": sign * rng.uniform(5e-5, 1.5e-4),
        },
    }[kind]


# In an order that any beginning of is balanced.
KINDS = (
    "null", "lining", "delay", "leak", "lining-warm", "null", "object", "panel", "outside", "null", "corner", "edge",
    "two-moved", "null", "warm", "resonator", "gain", "panel-delay", "null", "box", "second-source", "breakup", "moved",
    "leak-moved",
)  # fmt: skip


def at_truth(made: RoomCase) -> dict[str, Values]:
    """What was hidden as effects of the catalogue, by their use, with SI values as near to the truth as it has them."""
    found: dict[str, Any] = {}
    dims = np.array(made.truth.room.dims_m)  # places are parts of the edges as they are
    delay = made.truth.delay_s
    for full, strength in made.effects.items():
        kind, _, _ = full.partition("@")
        details = made.truth.details[full]
        if kind in ("wall-impedance", "panel-resonance"):
            omega = 2 * np.pi * float(details["frequency_hz"])
            mass = float(details["mass_kg_m2"])
            values = {"conductance": strength, "mass": mass, "stiffness": mass * omega**2}
            if kind == "panel-resonance":
                values = {
                    "coverage": 5.0 / mass,
                    "resonance": omega / 2 / np.pi,
                    "loss_factor": 1 / float(details["quality"]),
                }
            found[f"{kind}@{details['wall']}"] = values
        elif kind == "helmholtz-resonator":
            wall = str(details["wall"])
            place = np.delete(_place(details["place_m"]) / dims, "xyz".index(wall[0]))
            radius, plug = float(details["neck_radius_m"]), float(details["length_m"])
            longer = (plug + _end(made, wall, _place(details["place_m"]), radius)) / plug
            found[f"{kind}@{wall}"] = {
                "neck_area": np.pi * radius**2,
                "resonance": float(details["frequency_hz"]) / np.sqrt(longer),
                "quality": float(details["quality"]) * np.sqrt(longer),
                "across": place[0],
                "along": place[1],
            }
        elif kind == "leak":
            wall = str(details["wall"])
            place = np.delete(_place(details["place_m"]) / dims, "xyz".index(wall[0]))
            plug, radius = float(details["length_m"]), float(np.sqrt(strength / np.pi))
            plug += _end(made, wall, _place(details["place_m"]), radius)
            found[f"{kind}@{wall}"] = {
                "area": strength,
                "length": plug,
                "across": place[0],
                "along": place[1],
            }
        elif kind == "flanking-source":
            wall = str(details["wall"])
            place = np.delete(_place(details["place_m"]) / dims, "xyz".index(wall[0]))
            found[f"{kind}@{wall}"] = {
                "ratio": strength,
                "delay": _in_steps(made, float(details["delay_s"])),
                "across": place[0],
                "along": place[1],
            }
        elif kind == "dimension-error":
            edge = "xyz".index(str(details["edge"]))
            found[f"{kind}@{details['edge']}"] = {"error": dims[edge] / made.truth.layout.dims_m[edge] - 1}
        elif kind == "microphone-gain":
            mic = round(float(details["microphone"]))
            found[f"{kind}@Mic {mic}"] = {"gain": 10 ** (float(made.truth.gain_dB[mic - 1]) / 20) - 1}
        elif kind == "piston-breakup":
            # The truth changes the velocity, 1 + s x^2 / (1 - x^2 + j d x); the model divides by the same.
            rest = 1 - strength
            found[kind] = {
                "strength": -strength / rest,
                "resonance": float(details["frequency_hz"]) / np.sqrt(rest),
                "loss_factor": float(details["loss_factor"]) / np.sqrt(rest),
            }
        elif kind == "temperature":
            found[kind] = {"offset": made.truth.temperature_C - 20.0}
        elif kind == "scatterer":
            edges = _place(details["edges_m"]) / strength ** (1 / 3)
            found[kind] = {"volume": strength, **dict(zip("xyz", _place(details["place_m"]) / dims)),
                           "length_x": edges[0], "length_y": edges[1]}  # fmt: skip
        elif kind == "microphone-position":  # the error of every place included
            mic = round(float(details["microphone"]))
            moved = np.subtract(made.truth.room.position_m[mic - 1], made.truth.layout.position_m[mic - 1])
            found[f"{kind}@Mic {mic}"] = dict(zip(("dx", "dy", "dz"), map(float, moved)))
        elif kind == "microphone-delay":
            card = made.truth.layout.cards[round(float(details["card"])) - 1]
            late = float(np.mean(delay[card[0] - 1 : card[1]]))
            found[f"{kind}@card {details['card']:.0f}"] = {"delay": late}
    return found


def _end(made: RoomCase, wall: str, place: np.ndarray, radius: float) -> float:
    """Air on the room's side that moves with a plug of the truth, as a length: what its grid resolves of 0.85 radii.

    That of the grid, less what the room gives a disc beyond a baffle's 8 / (3 pi) radii: the static sum over the modes
    of the box, along the normal in closed form.
    """
    from scipy.special import j1

    room, axis = made.truth.room, "xyz".index(wall[0])
    disc, box = Disc(wall, (place[0], place[1], place[2]), radius), Box(room.dims_m)
    nodes, _ = box.face(wall)
    basis, weights = box.disc(disc)
    load = np.zeros(box.volume.size)
    load[nodes] = weights @ basis / disc.area_m2
    deep = room.dims_m[axis]
    wide = [(place[i], room.dims_m[i]) for i in range(3) if i != axis]
    numbers = [np.arange(int(SHORTEST / radius * edge / np.pi)) for _, edge in wide]
    shapes = [
        np.where(n > 0, 2, 1) * np.cos(np.pi * n * x / edge) ** 2
        for n, (x, edge) in zip(numbers, wide, strict=True)
    ]
    first, second = (np.pi * n / edge for n, (_, edge) in zip(numbers, wide, strict=True))
    along = np.hypot(first[:, None], second)
    along[0, 0] = 1.0
    each = (2 * j1(along * radius) / (along * radius)) ** 2 / np.tanh(along * deep) / along
    each[0, 0] = deep / 3
    exact = float(shapes[0] @ each @ shapes[1]) / (wide[0][1] * wide[1][1])
    grid = box.yield_of(load.reshape(box.shape))
    return float(disc.area_m2 * (grid - exact) + 8 * radius / (3 * np.pi))


def _in_steps(made: RoomCase, late_s: float) -> float:
    """A delay of the truth as its steps of time have it."""
    step, _ = _step(Box(made.truth.room.dims_m), made.truth.room)
    return step * round(late_s / step)


def _place(text: object) -> np.ndarray:
    return np.array([float(v) for v in str(text).strip("()").split(",")])


def run(kind: str, seed: int, arguments: argparse.Namespace) -> dict[str, Any]:
    """One case: verdict, time, the chi-square at the truth and the lowest that the search reached."""
    hidden = drawn(kind, seed, arguments.mics)
    uneven = tuple(arguments.uneven) if arguments.uneven else None
    made = simulate(seed, hidden, n_mics=arguments.mics, cache=arguments.cache, uneven_percent=uneven)
    made.rig["band"]["f_max_hz"] = arguments.f_max
    if uneven and not arguments.undeclared:
        made.rig["uncertainty"] |= {"mode_frequency_percent": uneven[0], "mode_damping_percent": uneven[1]}
    record: dict[str, Any] = {"kind": kind, "seed": seed, "effects": hidden, "at_truth": at_truth(made)}
    bad = {full.split()[-1] for full in hidden if full.startswith(OF_A_MICROPHONE)}
    aside = [m for m in range(arguments.mics, 0, -1) if str(m) not in bad][:HELD_OUT]
    with tempfile.TemporaryDirectory() as folder:
        write(made, folder)
        place = Path(folder)
        start = time.process_time()
        hold_out = ["channel=" + ",".join(f"Mic {m}" for m in aside)]
        begin(place / "study", "room", place / "rig.toml", [place / "recording.tdms"], hold_out=hold_out)
        study = Study(place / "study")
        said = study.diagnose().to_dict()
        record["cpu_s"] = round(time.process_time() - start, 1)
        record["verdict"] = {**said, "ranking": said["ranking"][:6]}
        record["values"] = study.problem.n_data
        record["chi2"] = _compared(study.problem, record["at_truth"], said)
    return record


def _compared(problem: Problem, true: Mapping[str, Any], said: Mapping[str, Any]) -> dict[str, float]:
    """Chi-square over the number of values from the truth, and from every set of the search, with the same covariance.

    Rows out of the ranking are started at their values; what they leave to the base is fitted again.
    """
    seen = about(problem, *_extended(problem, true))
    found = {"truth": _lowest(seen, true)}
    for row in said["ranking"][:COMPARED]:
        owners = sorted({name.rpartition(".")[0] for name in row["parameters"]})
        values: dict[str, dict[str, float]] = {use: {} for use in owners}
        extended = problem.with_uses(owners)
        for name, entry in row["parameters"].items():
            use, _, own = name.rpartition(".")
            values[use][own] = extended.assembly.parameters[name.split("[")[0]].to_si(entry["value"])
        found[" + ".join(owners)] = _lowest(seen, values)
    return found


def _extended(problem: Problem, values: Mapping[str, Any]) -> tuple[Any, dict[str, float]]:
    """The assembly with some uses, and where it is near the field: the base fitted beside them."""
    whole = problem.with_uses(sorted(values))
    theta = descend_steps(whole, whole.start(_flat(values)), JACOBIANS)
    return whole.assembly, whole.values_at(theta)


def _flat(values: Mapping[str, Any]) -> dict[str, float]:
    return {f"{use}.{own}": value for use, table in values.items() for own, value in table.items()}


def _lowest(seen: Problem, values: Mapping[str, Any]) -> float:
    whole = seen.with_uses(sorted(values))
    theta = descend_steps(whole, whole.start(_flat(values)), JACOBIANS)
    return float(np.sum(whole.residual(theta) ** 2)) / whole.n_data


def missed(record: Mapping[str, Any]) -> bool:
    """Whether no set of the search came down to the fit that was started at the truth."""
    true = record["chi2"]["truth"]
    values = record.get("values", 1e4)
    least = min((c for name, c in record["chi2"].items() if name != "truth"), default=np.inf)
    return bool(record["at_truth"]) and least > MISSED[0] * true + MISSED[1] / values


def right(record: Mapping[str, Any]) -> str:
    """``right`` where exactly what is hidden is named, ``group`` where it is one of the alternatives."""
    wanted = sorted({use.partition("@")[0] for use in record["at_truth"]})
    named = record["verdict"]["alternatives"]
    if record.get("kind") == "outside":
        return "right" if record["verdict"]["verdict"] == "unknown-effect" else "wrong"
    if not wanted:
        return "right" if record["verdict"]["verdict"] in ("nothing-missing",) else "wrong"
    if named and named[0] == wanted and len(named) == 1:
        return "right"
    return "group" if wanted in named else "wrong"


def covered(record: Mapping[str, Any]) -> list[bool]:
    """Whether 95 % intervals of what is named first hold the truth, where that is what is hidden, at its place."""
    rows = record["verdict"]["ranking"] if record["verdict"]["alternatives"] else []
    own = {} if not rows else rows[0]["parameters"]
    true = {
        f"{use}.{name}": value for use, table in record["at_truth"].items() for name, value in table.items()
    }
    if {name.rpartition(".")[0] for name in own} != set(record["at_truth"]):
        return []
    return [entry["low"] <= true[name] <= entry["high"] for name, entry in own.items() if name in true]


def table(records: Sequence[Mapping[str, Any]]) -> str:
    """One line a kind: how many, right, in the group, minimum missed, CPU seconds."""
    lines = [
        "| kind | rooms | right alone | in the group | 'unknown' | minimum missed | intervals that hold the truth "
        "| CPU s (middle, most) |"
    ]
    lines.append("|---|---|---|---|---|---|---|---|")
    for kind in dict.fromkeys(KINDS):
        own = [r for r in records if r["kind"] == kind and "error" not in r]
        if own:
            said = [right(r) for r in own]
            cpu = [r["cpu_s"] for r in own]
            inside = [held for r in own for held in covered(r)]
            unknown = sum(r["verdict"]["verdict"] == "unknown-effect" for r in own)
            lines.append(
                f"| {kind} | {len(own)} | {said.count('right')} | {said.count('group')} | {unknown} "
                f"| {sum(map(missed, own))} | {sum(inside)} of {len(inside)} | {np.median(cpu):.0f}, {max(cpu):.0f} |"
            )
    return "\n".join(lines)


def brief(record: Mapping[str, Any]) -> str:
    """One line of a record."""
    if "error" in record:
        return f"{record['kind']} {record['seed']}: {record['error'].strip().splitlines()[-1]}"
    said = record["verdict"]
    return (
        f"{record['kind']} {record['seed']} {right(record)}{' MISSED' if missed(record) else ''} "
        f"{record['cpu_s']} s: {said['verdict']} {said['alternatives']} {said['at']}; truth {record['at_truth']}; chi2 "
        + ", ".join(f"{name} {value:.4g}" for name, value in record["chi2"].items())
        + f"; {said['reason']}"
    )


def main() -> int:
    """Run and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cases", type=int, default=len(KINDS))
    parser.add_argument("--kinds", nargs="+", choices=sorted({*KINDS}), default=KINDS)
    parser.add_argument("--seed", type=int, default=3000)
    parser.add_argument("--mics", type=int, default=8)
    parser.add_argument("--f-max", type=float, default=450.0)
    parser.add_argument(
        "--uneven",
        type=float,
        nargs=2,
        metavar=("FREQUENCY", "DAMPING"),
        help="per cent RMS that each mode's natural frequency and damping are off",
    )
    parser.add_argument("--undeclared", action="store_true", help="the rig file says nothing of --uneven")
    parser.add_argument("--cache", type=Path)
    parser.add_argument("--out", type=Path, default=Path("room_search.jsonl"))
    parser.add_argument("--report", type=Path)
    arguments = parser.parse_args()
    if arguments.report:
        records = [json.loads(line) for line in arguments.report.read_text(encoding="utf-8").splitlines()]
        print(*map(brief, records), table(records), sep="\n")
        return 0
    code = fingerprint()
    for number in range(arguments.cases):
        kind = arguments.kinds[number % len(arguments.kinds)]
        seed = arguments.seed + number
        try:
            record = run(kind, seed, arguments)
        except Exception:  # what breaks in one case is counted, the others go on
            record = {"kind": kind, "seed": seed, "error": traceback.format_exc(limit=-4)}
        record["code"] = code
        with arguments.out.open("a", encoding="utf-8", newline="\n") as file:
            file.write(json.dumps(record) + "\n")
        print(brief(record), flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
