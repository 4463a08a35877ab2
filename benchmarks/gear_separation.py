"""What order lines can tell apart: gains of the path, pins out of place, shares of the load, angle of the tacho.

    python benchmarks/gear_separation.py

For plans of torques and harmonics, on lines of the planetary-gear model itself: the numerical rank of the joint
Jacobian of all of them, the standard uncertainty of a position error and of a load share when the others are free, and
how much of the trace of a position error (in chi-square) load shares cannot take over. All beside the noise alone: what
a model is declared not to know is relative to lines that vanish here.
"""

from __future__ import annotations

import argparse
import json
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.models.model import Model
from specan.planetary_gear.model.build import build
from specan.planetary_gear.study.order_lines import OrderLinesObservation

RIG = Path(__file__).parents[1] / "sample_data" / "planetary_gear" / "rig.toml"
NOISE = 1e-4  # m/s^2, standard uncertainty of either part of a line
SPEED_HZ = 30.0
RANK = 1e-8  # singular value over the largest, columns at unit length, from which a direction counts
STEP = {"planet-position-error": 1e-9, "unequal-load-sharing": 1e-4, "tacho-angle": 1e-5}
SHARED = ("free", "shared")  # gains of each recording, or of all recordings of one speed

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Plan:
    """Torques in N m and harmonics of the mesh that are looked at."""

    torques: tuple[float, ...]
    harmonics: tuple[int, ...]


PLANS = (
    Plan((60.0,), (1,)),
    Plan((60.0,), (1, 2, 3)),
    Plan((30.0, 60.0), (1,)),
    Plan((30.0, 60.0), (1, 2, 3)),
    Plan((15.0, 60.0), (1, 2, 3)),
    Plan((10.0, 60.0), (1, 2, 3)),
    Plan((15.0, 30.0, 60.0), (1, 2, 3)),
)
UNKNOWNS = (
    *(f"planet-position-error@P{k}.error" for k in (1, 2, 3)),
    *(f"unequal-load-sharing@P{k}.share" for k in (1, 2, 3)),
    "tacho-angle.angle",
)


def observations(model: Model, plan: Plan, noise: float) -> list[OrderLinesObservation]:
    """Lines of the model at each torque, as a study would have them."""
    known = model.for_kinds["orders"]
    assert known is not None
    mine = np.isin(known.harmonic, plan.harmonics)
    of_lines = ("order", "harmonic", "passages", "mode", "family")
    known = replace(known, **{name: getattr(known, name)[mine] for name in of_lines})
    found = []
    for torque in plan.torques:
        point = {"sun_speed": SPEED_HZ, "carrier_torque": torque}
        conditions = {"order": known.order, **{c: np.full(mine.sum(), v) for c, v in point.items()}}
        lines = model.assemble().evaluate(conditions, wanted=["order_lines"])["order_lines"]
        sensors = tuple(model.axes["sensor"])
        found.append(
            OrderLinesObservation(
                name=f"{torque:g} N m", of_row=(f"{torque:g} N m",) * len(sensors), quantity="order_lines",
                channels=sensors, known=known, amplitude=lines,
                noise=np.full(lines.shape, noise), beyond=np.zeros(lines.shape, dtype=bool),
                path=np.arange(len(sensors)), kept=np.ones(lines.shape, dtype=bool),
                point={name: np.full(len(sensors), value) for name, value in point.items()},
            )
        )  # fmt: skip
    return found


def columns(model: Model, seen: Sequence[OrderLinesObservation]) -> tuple[list[Array], list[Array]]:
    """Whitened derivatives of every observation's lines, gains held, and their gains' columns."""
    assembly = model.assemble([name.rpartition(".")[0] for name in UNKNOWNS])
    values = {**assembly.defaults, **dict.fromkeys(UNKNOWNS, 0.0)}
    slopes, gains = [], []
    for one in seen:
        conditions = {
            "order": one.known.order,
            **{c: np.full(one.known.order.size, v[0]) for c, v in one.point.items()},
        }
        white = one._whitening(one.amplitude[one.kept])

        def rows(lines: Any, white: Any = white, one: OrderLinesObservation = one) -> Array:
            """Whitened with what the model is declared not to know, real parts and imaginary parts."""
            found = white(lines[one.kept])
            return np.concatenate([found.real, found.imag])

        def lines(conditions: Any = conditions, **changed: float) -> Any:
            return assembly.evaluate(conditions, {**values, **changed}, wanted=["order_lines"])["order_lines"]

        parts = []
        for name in UNKNOWNS:
            step = STEP[name.partition("@")[0].partition(".")[0]]
            ends = [lines(**{name: sign * step}) for sign in (-1, 1)]
            parts.append(rows((ends[1] - ends[0]) / (2 * step)))
        slopes.append(np.column_stack(parts))
        here = lines()
        own = [rows(np.where(group, turn * here, 0.0)) for group in one.of_one_gain for turn in (1, 1j)]
        gains.append(np.column_stack(own))
    return slopes, gains


def study(plan: Plan, kind: str, noise: float = NOISE) -> dict[str, Any]:
    """Rank and separation of one plan with one kind of gains."""
    model = build(tomllib.loads(RIG.read_text(encoding="utf-8")))
    seen = observations(model, plan, noise)
    slopes, gains = columns(model, seen)
    effect = np.concatenate(slopes)
    if kind == "shared":
        gain = np.concatenate(gains)
    else:
        count = sum(w.shape[1] for w in gains)
        gain = np.zeros((effect.shape[0], count))
        row = column = 0
        for w in gains:
            gain[row : row + w.shape[0], column : column + w.shape[1]] = w
            row, column = row + w.shape[0], column + w.shape[1]
    whole = np.column_stack([gain, effect])
    singular = np.linalg.svd(whole / np.linalg.norm(whole, axis=0), compute_uv=False)
    position, share = effect[:, 1], effect[:, 4]
    return {
        "torques": plan.torques, "harmonics": plan.harmonics, "gains": kind, "columns": whole.shape[1],
        "rank": int(np.sum(singular > RANK * singular[0])),
        "position_um": 1e6 / _left(position, np.column_stack([gain, effect[:, 6]])),
        "position_beside_share_um": 1e6 / _left(position, np.column_stack([gain, effect[:, 3:]])),
        "share_beside_position": 1.0 / _left(share, np.column_stack([gain, effect[:, :3], effect[:, 6]])),
        "own_part": (
            _left(position, np.column_stack([gain, effect[:, 3:]]))
            / _left(position, np.column_stack([gain, effect[:, 6]]))
        ) ** 2,
    }  # fmt: skip


def _left(column: Array, others: Array) -> float:
    """Length of what others cannot make of a column."""
    size = np.linalg.norm(others, axis=0)
    left, values, _ = np.linalg.svd(others[:, size > 0] / size[size > 0], full_matrices=False)
    basis = left[:, values > RANK * values[0]]
    return float(np.linalg.norm(column - basis @ (basis.T @ column)))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--noise", type=float, default=NOISE, metavar="M_PER_S2")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    rows = [study(plan, kind, arguments.noise) for plan in PLANS for kind in SHARED]
    if arguments.json:
        print(json.dumps(rows, indent=1))
        return
    print(
        f"{'torques / N m':16}{'h':8}{'gains':8}{'rank':>9}  {'position':>10}{'beside share':>14}{'share':>10}"
        f"{'own part':>10}"
    )
    for r in rows:
        rank = f"{r['rank']} of {r['columns']}"
        torques, number = " ".join(f"{t:g}" for t in r["torques"]), " ".join(map(str, r["harmonics"]))
        print(
            f"{torques:16}{number:8}{r['gains']:8}{rank:>9}  {r['position_um']:>7.2g} um"
            f"{r['position_beside_share_um']:>11.2g} um{r['share_beside_position']:>10.2g}{r['own_part']:>10.2g}"
        )


if __name__ == "__main__":
    main()
