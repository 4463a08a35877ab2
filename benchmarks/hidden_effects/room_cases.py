"""What the bench tries on rooms: nulls, single effects, pairs, effects outside the catalogue; fixed by kind and number.

Seeds below 50 000 are for development, those from 50 000 on are reserved, as for the worm gear. A seed is a room. Nulls
come back to a few dozen rooms and draw excitation, noise and the errors of the instruments anew (`take`); hidden
effects have a room of their own each.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from itertools import combinations
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from truth.rig_files import write_tdms
from truth.room import EFFECTS, RoomCase, simulate, write

FIRST_DEVELOPMENT_SEED = 1000
FIRST_RESERVED_SEED = 50_000
MOST_CASES = 20_000
NULL_ROOMS = 40
HELD_OUT = 2  # microphones

# About the least that a laboratory would care for; only spreads the cases over the classes of lambda. Errors of
# instruments leave a chi-square of 30 to 3000 there. Effects on the field leave 1e4 to 1e6 even so: modes are sharp and
# microphones quiet, and only strengths far below them come near the limit of what can be seen.
MIDDLE = {
    "wall-impedance": 0.01,
    "porous-absorber": 0.1,
    "panel-resonance": 0.06,
    "helmholtz-resonator": 3e-4,
    "leak": 3e-4,
    "air-absorption": 30.0,
    "temperature": 4.0,
    "dimension-error": 0.008,
    "microphone-position": 0.016,
    "microphone-delay": 1e-5,
    "microphone-gain": 1.0,
    "piston-size": 0.06,
    "piston-breakup": 0.1,
    "flanking-source": 0.02,
    "scatterer": 4e-4,
    "vibrometer-noise": 0.1,
    "extended-reaction": 0.03,
    "drifting-air": 0.15,
    "shaken-microphone": 2e-3,
}
SPREAD = {"single": (-1.0, 0.5), "unknown": (-0.3, 0.6), "pair": (-0.3, 0.4)}  # powers of ten
_STREAM = {"single": 4, "pair": 5, "unknown": 6, "left-out": 7}  # never changed: cases hang on it
KINDS = ("null", *_STREAM)
FULL = {"null": 160, "single": 144, "pair": 40, "unknown": 48, "left-out": 30}

CATALOGUE = tuple(name for name, effect in EFFECTS.items() if effect.candidate)
OUTSIDE = tuple(name for name, effect in EFFECTS.items() if not effect.candidate)
# What a certificate holds as a nuisance stays in the base and cannot be denied to the search.
_DENIED = tuple(n for n in CATALOGUE if n not in ("temperature", "dimension-error", "microphone-delay"))
_OF_ONE_MICROPHONE = ("microphone-position", "microphone-gain")
_OF_MICROPHONES = (*_OF_ONE_MICROPHONE, "microphone-delay")


@dataclass(frozen=True)
class Case:
    """One recording and what is hidden in it.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    seed, take : int
        The room; instruments, excitation and noise in it.
    effects : dict
        Hidden effects with their strengths.
    held_out : tuple of str
        Microphones that are held out, none of which has a hidden error of its own.
    validated : bool
        Whether a second recording with the same instruments takes their place: errors of microphones cannot be
        seen at others.
    without : tuple of str
        Candidates that the search is denied.
    n_mics, duration_s
        Size of the recording.
    rig : dict
        Values that the rig file gets instead.
    """

    kind: str
    seed: int
    take: int
    effects: dict[str, float]
    held_out: tuple[str, ...] = ()
    validated: bool = False
    without: tuple[str, ...] = ()
    n_mics: int = 12
    duration_s: float = 5.0
    rig: dict[str, float] = field(default_factory=dict)

    engine: ClassVar[str] = "hidden_effects.room_engine"

    def __hash__(self) -> int:
        return hash((self.key, *self.effects))

    @property
    def key(self) -> str:
        """Name of the case in result files."""
        return f"{self.kind}/{self.seed}/{self.take}"

    @property
    def truth(self) -> tuple[str, ...]:
        """Catalogue names of what is hidden."""
        return tuple(sorted({c for n in self.effects if (c := EFFECTS[n.partition("@")[0]].candidate)}))

    def simulate(
        self, cache: Path | None = None, *, repeat: int = 0, noise: bool = True, healthy: bool = False
    ) -> RoomCase:
        """The recording; with `repeat` another one in the same room with the same instruments."""
        made = simulate(
            self.seed,
            {} if healthy else self.effects,
            take=self.take,
            repeat=repeat,
            n_mics=self.n_mics,
            duration_s=self.duration_s,
            noise=noise,
            cache=cache,
        )
        for key, value in self.rig.items():
            table, _, name = key.partition(".")
            made.rig[table][name] = value
        return made

    def write(self, truth: RoomCase, folder: Path, cache: Path | None = None) -> None:
        """What the search gets, and what it could know: the same without noise, with and without the effects."""
        write(truth, folder)
        for name in ("quiet", "healthy") if self.effects else ("quiet",):
            made = self.simulate(cache, noise=False, healthy=name == "healthy")
            write_tdms(folder / f"{name}.tdms", made.hardware, made.take, samples="float32")
        if self.validated:
            second = self.simulate(cache, repeat=1)
            write_tdms(folder / "validation.tdms", second.hardware, second.take)

    def as_dict(self) -> dict[str, Any]:
        """For a result file."""
        return asdict(self)


def planned(kind: str, count: int, *, reserved: bool = False, only: tuple[str, ...] = ()) -> list[Case]:
    """The first `count` cases of a kind, see the worm gear's."""
    first = FIRST_RESERVED_SEED if reserved else FIRST_DEVELOPMENT_SEED
    if count > MOST_CASES:
        raise ValueError(f"{count} cases of a kind; at most {MOST_CASES} have seeds of their own")
    return [_case(kind, number, first, only) for number in range(count)]


def _case(kind: str, number: int, first: int, only: tuple[str, ...]) -> Case:
    if kind == "null":
        seed, take = first + number % NULL_ROOMS, number // NULL_ROOMS
        return Case(kind, seed, take, {}, _aside(np.random.default_rng([seed, take]), 12, None))
    seed = first + number
    rng = np.random.default_rng([seed, _STREAM[kind]])
    if kind == "pair":
        pairs = [p for p in combinations(CATALOGUE, 2) if set(only) <= set(p)]
        names = pairs[int(rng.integers(len(pairs)))]
    else:
        pool = {"single": CATALOGUE, "unknown": OUTSIDE, "left-out": _DENIED}[kind]
        pool = tuple(n for n in pool if not only or n in only)
        names = (pool[number % len(pool)],)
    spread = SPREAD["unknown" if kind == "left-out" else kind]
    effects, bad = {}, None
    for name in names:
        strength = _strength(name, spread, rng)
        if name in _OF_ONE_MICROPHONE:
            bad = int(rng.integers(12)) + 1 if bad is None else bad
            name = f"{name}@Mic {bad}"
        effects[name] = strength
    return Case(
        kind,
        seed,
        0,
        effects,
        _aside(rng, 12, bad),
        any(n in _OF_MICROPHONES for n in names),
        tuple(str(EFFECTS[n].candidate) for n in names) if kind == "left-out" else (),
    )


def _aside(rng: np.random.Generator, n: int, bad: int | None) -> tuple[str, ...]:
    """Microphones to hold out."""
    free = [m for m in range(1, n + 1) if m != bad]
    return tuple(f"Mic {m}" for m in sorted(rng.choice(free, HELD_OUT, replace=False).tolist()))


def _strength(name: str, spread: tuple[float, float], rng: np.random.Generator) -> float:
    """Drawn around the middle one, within what a real room would show."""
    effect = EFFECTS[name]
    sign = -1.0 if effect.both_signs and rng.uniform() < 0.5 else 1.0
    exponent = spread[0] + (spread[1] - spread[0]) * rng.uniform()
    return float(f"{sign * min(MIDDLE[name] * 10**exponent, effect.high):.3g}")
