"""What the bench tries on planetary gears: nulls, single effects, pairs, and a bearing that no effect describes."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from itertools import combinations
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from hidden_effects.cases import FIRST_DEVELOPMENT_SEED, FIRST_RESERVED_SEED
from truth import floating_set
from truth.planetary_gear import Gear, draw, write_case

CATALOGUE = (
    "planet-position-error", "unequal-load-sharing", "sun-runout", "planet-runout", "carrier-runout", "torque-ripple",
    "tooth-crack", "transmission-path", "pitch-errors", "tip-relief", "mesh-damping", "tooth-friction",
    "speed-fluctuation", "ring-flexibility",
)  # fmt: skip
SEEN = CATALOGUE[:9]
# What changes all lines about a harmonic by one factor, which the free gains take over.
UNSEEN = CATALOGUE[9:13]
OUTSIDE = ("bearing-defect",)
STRENGTHS = (0.3, 3.0)  # over the sizes that the simulator draws
FULL = {"null": 40, "single": 90, "unseen": 20, "pair": 20, "unknown": 10}
_STREAM = {"single": 14, "unseen": 18, "pair": 15, "unknown": 16}


@dataclass(frozen=True)
class Case:
    """Three recordings of a drawn set, and what is hidden in it."""

    kind: str
    seed: int
    effects: tuple[str, ...] = ()
    strength: float = 1.0

    engine: ClassVar[str] = "hidden_effects.gear_engine"
    seen: ClassVar[tuple[str, ...]] = SEEN
    unseen: ClassVar[tuple[str, ...]] = UNSEEN

    @property
    def key(self) -> str:
        """Name of the case in result files."""
        return f"{self.kind}/{self.seed}"

    @property
    def truth(self) -> tuple[str, ...]:
        """Catalogue names of what is hidden."""
        return tuple(sorted(name for name in self.effects if name in CATALOGUE))

    def simulate(self, cache: Path | None = None) -> Gear:
        """The drawn machine."""
        return draw(self.seed, *self.effects, strength=self.strength, drawn_set=True)

    def write(self, truth: Gear, folder: Path, cache: Path | None = None) -> None:
        """Recordings and the rig file."""
        write_case(truth, folder)

    def as_dict(self) -> dict[str, Any]:
        """For a result file."""
        return asdict(self)


@dataclass(frozen=True)
class FloatingCase(Case):
    """The same of sets that move in the plane, in elastic rings, with a path of its own for every harmonic.

    What changes lines of the ideal set alone, a path imitates.
    """

    seen: ClassVar[tuple[str, ...]] = tuple(
        n for n in SEEN if n not in ("carrier-runout", "transmission-path")
    )
    unseen: ClassVar[tuple[str, ...]] = (
        "carrier-runout", "transmission-path", "ring-flexibility", "mesh-damping", "speed-fluctuation",
    )  # fmt: skip

    def simulate(self, cache: Path | None = None) -> Any:
        """The drawn machine."""
        return floating_set.draw(self.seed, *self.effects, strength=self.strength)

    def write(self, truth: Any, folder: Path, cache: Path | None = None) -> None:
        """Recordings and the rig file."""
        floating_set.write_case(truth, folder)


def planned(
    kind: str,
    count: int,
    *,
    reserved: bool = False,
    only: tuple[str, ...] = (),
    case: type[Case] = Case,
) -> list[Case]:
    """The first `count` cases of a kind."""
    first = FIRST_RESERVED_SEED if reserved else FIRST_DEVELOPMENT_SEED
    return [_case(case, kind, number, first + number, only) for number in range(count)]


def _case(case: type[Case], kind: str, number: int, seed: int, only: tuple[str, ...]) -> Case:
    if kind == "null":
        return case(kind, seed)
    rng = np.random.default_rng([seed, _STREAM[kind]])
    strength = float(f"{np.exp(rng.uniform(*np.log(STRENGTHS))):.3g}")
    if kind == "pair":
        pairs = [p for p in combinations(case.seen, 2) if set(only) <= set(p)]
        return case(kind, seed, pairs[int(rng.integers(len(pairs)))], strength)
    kinds = {"single": case.seen, "unseen": case.unseen, "unknown": OUTSIDE}
    pool = [n for n in kinds[kind] if not only or n in only]
    return case(kind, seed, (pool[number % len(pool)],), strength)
