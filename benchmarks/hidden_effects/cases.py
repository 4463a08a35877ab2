"""What the bench tries: nulls, single effects, pairs, effects outside the catalogue; fixed by kind and seed.

Seeds below 50 000 are for development: look at them, learn from them. Those from 50 000 on are reserved: they
are run once, at the end, and nothing is changed because of what they show.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from itertools import combinations
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from truth.worm_gear import EFFECTS, TruthCase, simulate, write

FIRST_DEVELOPMENT_SEED = 1000
FIRST_RESERVED_SEED = 50_000
MOST_CASES = 20_000  # of one kind, so that kinds never share seeds across the border

# Strength that leaves a chi-square of about 30 on the standard grid; only spreads the cases over the classes.
# An effect that its physical range keeps below that takes the range.
MIDDLE = {
    "seal-drag": 0.45,
    "windage": 3.6,
    "speed-dependent-friction": 0.02,
    "viscosity-dependent-friction": 0.18,
    "load-dependent-friction": 0.13,
    "oil-heating": 0.011,
    "bearing-preload": 0.0025,
    "inlet-shear-heating": 2.0,
    "starvation": 0.9,
    "running-in": 0.02,
    "thermal-lag": 1.1,
    "idle-lag": 0.95,
    "shear-thinning": 0.0125,
    "mesh-pocketing": 8.2,
    "misalignment": 0.16,
    "belt-slip": 0.09,
    "speed-bump": 3.9,
    "quadratic-friction": 0.081,
    "foaming": 0.03,
    "swelling": 0.035,
    "coupling-hysteresis": 7.4,
}
# Strength over the middle one, as powers of ten: chi-square goes with the square.
SPREAD = {"single": (-0.5, 0.9), "unknown": (0.2, 1.1), "pair": (0.0, 0.7)}
NULL_DESIGNS = {
    "null-exact": "exact", "null": "grid", "null-idle": "idle", "null-time": "campaign",
    "null-readings": "readings", "null-levels": "levels", "null-small": "small",
}  # fmt: skip
_STREAM = {"single": 4, "pair": 5, "unknown": 6, "left-out": 7}  # never changed: cases hang on it
KINDS = (*NULL_DESIGNS, *_STREAM)
FULL = {
    "null-exact": 240, "null": 240, "null-idle": 100, "null-time": 80,
    "null-readings": 60, "null-levels": 40, "null-small": 40,
    "single": 340, "pair": 80, "unknown": 84, "left-out": 60,
}  # fmt: skip

CATALOGUE = tuple(name for name, effect in EFFECTS.items() if effect.candidate)
OUTSIDE = tuple(name for name, effect in EFFECTS.items() if not effect.candidate)
# Instrument errors within their certificates are invisible by construction; they take part as single effects only.
_PAIRED = tuple(n for n in CATALOGUE if n in MIDDLE and n not in ("inlet-shear-heating", "starvation"))


@dataclass(frozen=True)
class Case:
    """One data set and what is hidden in it.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    seed : int
        Of the simulator and of the choice of effects and strengths.
    design : str
        Test plan.
    effects : dict
        Hidden effects with their strengths.
    without : tuple of str
        Candidates that the search is denied.
    rig : dict
        Values that the rig file gets instead: ``{"oil.vogel_constant_C": 145.0}``.
    noise_percent : float, optional
        Noise of the input torque in percent of the reading, instead of the rig's.
    drawn : bool
        A truth whose parts each have a published form drawn by the seed.
    """

    kind: str
    seed: int
    design: str
    effects: dict[str, float]
    without: tuple[str, ...] = ()
    rig: dict[str, float] = field(default_factory=dict)
    noise_percent: float | None = None
    drawn: bool = False

    engine: ClassVar[str] = "hidden_effects.engine"

    @property
    def key(self) -> str:
        """Name of the case in result files."""
        return f"{self.kind}/{self.seed}"

    @property
    def truth(self) -> tuple[str, ...]:
        """Catalogue names of what is hidden; empty where nothing of the catalogue is."""
        return tuple(sorted({c for n in self.effects if (c := EFFECTS[n].candidate)}))

    def simulate(self, cache: Path | None = None) -> TruthCase:
        """The data; a gear is simulated so quickly that nothing is kept."""
        case = simulate(self.seed, self.effects, self.design, self.noise_percent, self.drawn)
        for key, value in self.rig.items():
            table, _, name = key.partition(".")
            case.rig[table][name] = value
        return case

    def write(self, truth: TruthCase, folder: Path, cache: Path | None = None) -> None:
        """What the search gets."""
        write(truth, folder)

    def as_dict(self) -> dict[str, Any]:
        """For a result file."""
        return asdict(self)


def planned(kind: str, count: int, *, reserved: bool = False, only: tuple[str, ...] = ()) -> list[Case]:
    """The first `count` cases of a kind.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    count : int
        How many.
    reserved : bool
        From the reserved seeds.
    only : tuple of str
        Effects to choose from, instead of all that fit the kind.
    """
    first = FIRST_RESERVED_SEED if reserved else FIRST_DEVELOPMENT_SEED
    if count > MOST_CASES:
        raise ValueError(f"{count} cases of a kind; at most {MOST_CASES} have seeds of their own")
    return [_case(kind, number, first + number, only) for number in range(count)]


def _case(kind: str, number: int, seed: int, only: tuple[str, ...]) -> Case:
    if kind in NULL_DESIGNS:
        return Case(kind, seed, NULL_DESIGNS[kind], {})
    rng = np.random.default_rng([seed, _STREAM[kind]])
    if kind == "pair":
        pairs = [p for p in combinations(_PAIRED, 2) if not _indistinct(*p) and set(only) <= set(p)]
        names = pairs[int(rng.integers(len(pairs)))]
    else:
        pool = {"single": CATALOGUE, "unknown": OUTSIDE, "left-out": _PAIRED}[kind]
        pool = tuple(n for n in pool if not only or n in only)
        names = (pool[number % len(pool)],)
    spread = SPREAD["unknown" if kind == "left-out" else kind]
    effects = {name: _strength(name, spread, rng) for name in names}
    without = tuple(str(EFFECTS[n].candidate) for n in names) if kind == "left-out" else ()
    return Case(kind, seed, _design(names, rng), effects, without)


def _indistinct(first: str, second: str) -> bool:
    """Two forms of one candidate, or two that need different plans."""
    a, b = EFFECTS[first], EFFECTS[second]
    return a.candidate == b.candidate or {a.needs, b.needs} >= {"elapsed_time", "idle"}


def _strength(name: str, spread: tuple[float, float], rng: np.random.Generator) -> float:
    effect, place = EFFECTS[name], rng.uniform()
    sign = -1.0 if effect.low < 0 and rng.uniform() < 0.5 else 1.0
    top = -effect.low if sign < 0 else effect.high
    if name not in MIDDLE or MIDDLE[name] > top:
        bottom = abs(effect.low)
        return float(f"{sign * bottom * (top / bottom) ** place:.3g}")
    exponent = spread[0] + (spread[1] - spread[0]) * place
    return float(f"{sign * min(MIDDLE[name] * 10**exponent, top):.3g}")


def _design(names: tuple[str, ...], rng: np.random.Generator) -> str:
    needs = {EFFECTS[n].needs for n in names}
    if "elapsed_time" in needs:
        return "campaign"
    if "idle" in needs:
        return "idle"
    return str(rng.choice(["grid", "idle"]))
