"""Recordings of force and displacement of machines that lack one effect, or nothing: what does a diagnosis say?

    python benchmarks/recorded_machines.py [--cases hardening process ...] [--seeds 1:2] [--samples 4096]

A mass on a spring, at 1 kHz, from formulas of this file. The force is a sum of tones or a sweep in closed
form; scipy integrates (DOP853 at 1e-9) from event to event: an edge that is met, friction that turns round or sticks.
The displacement has noise of 1 % that the model is not told. What a user writes is a spring, a damper, a mass and one
line of the shelf: 34 effects, whose sizes the recording tells. The error is that on another recording with another
force.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import numpy as np  # noqa: E402
from nptdms import ChannelObject, TdmsWriter  # noqa: E402
from scipy.integrate import solve_ivp  # noqa: E402
from scipy.signal import butter, lfilter, sosfiltfilt  # noqa: E402

import specan  # noqa: E402
from specan import shelf  # noqa: E402
from specan.models import Model, Signal, State  # noqa: E402
from specan.models.catalogue import keep_in_memory  # noqa: E402
from specan.study.create import begin  # noqa: E402

RATE = 1000.0
USUAL = 4e-3  # m, of the displacement
# of each machine the names that are right: an effect, or a pair
LACKS: dict[str, set[tuple[str, ...]]] = {
    "hardening": {("cubic-spring",)}, "softening": {("cubic-spring",), ("saturating-spring",)},
    "quadratic": {("quadratic-spring",)}, "crack": {("one-sided-spring",)}, "drift": {("stiffness-drift",)},
    "coulomb": {("dry-friction",)}, "stribeck": {("dry-friction", "stribeck-friction"), ("lugre-friction",)},
    "lugre": {("lugre-friction",)}, "hysteresis": {("bouc-wen",)}, "drag": {("quadratic-drag",)},
    "backlash": {("backlash",)}, "stop": {("stop",)}, "two-stops": {("two-stops",)}, "mount": {("maxwell-element",)},
    "absorber": {("tuned-mass",)}, "delay": {("x-delay",)}, "lag": {("x-lag",)},
    "zero": {("x-zero",), ("constant-force",)}, "saturation": {("x-saturation",)},
}  # fmt: skip
FOLLOWS_ITSELF = {"coloured": 0.95, "memory-0.9": 0.9, "memory-0.99": 0.99}  # from one sample to the next
NOTHING = ("white", "strong", *FOLLOWS_ITSELF, "process", "slow-process", "heavy-tails", "rounded")

Law = Callable[[float, float, float, np.ndarray], float]  # of time, displacement, velocity, own states


def push(rng: np.random.Generator, form: int, end: float) -> Callable[[float], float]:
    """A force of 40 N RMS from 2 to 42 Hz that begins smoothly."""
    phase = rng.uniform(0, 2 * np.pi, 90)
    if form == 0:
        tones, sizes = np.linspace(2, 40, 90), np.ones(90)
    else:
        tones, sizes = rng.uniform(2, 42, 90), np.sqrt(rng.chisquare(2, 90))

    def force(t: float) -> float:
        begun = min(t / 0.05, 1.0)
        if form == 2:
            shape = np.sqrt(2) * np.sin(phase[0] + 2 * np.pi * (2 * t + 33 / end * t * t / 2))
        else:
            shape = np.sqrt(2 / np.sum(sizes**2)) * (sizes @ np.cos(2 * np.pi * tones * t + phase))
        return 40 * begun**2 * (3 - 2 * begun) * float(shape)

    return force


@dataclass
class Machine:
    """A mass that is pulled back: by `pull`, with `own` rates of states that it brings, and by dry friction."""

    mass: float
    damping: float
    pull: Law
    edges: tuple[float, ...] = ()
    friction: Callable[[float], float] | None = None
    own: Callable[[float, float, np.ndarray], list[float]] = lambda x, v, z: []
    states: int = 0

    def motion(self, force: Callable[[float], float], longest: float, clock: np.ndarray) -> np.ndarray:
        """Displacement in m at every sample."""
        found, state, now = np.zeros(clock.size), np.zeros(2 + self.states), 0.0
        way = 1 if self.friction is None else 0  # direction of sliding; 0 sticks
        while now < clock[-1]:
            done = solve_ivp(
                self._rates(force, way), (now, clock[-1]), state, "DOP853", dense_output=True,
                events=self._events(force, way), rtol=1e-9, atol=1e-12, max_step=longest,
            )  # fmt: skip
            inside = (now <= clock) & (done.t[-1] >= clock)
            if np.any(inside):
                found[inside] = done.sol(clock[inside])[0]
            now, state = float(done.t[-1]), done.y[:, -1].copy()
            if done.status != 1:
                break
            if self.friction:
                load, holds = self._load(force, now, state), self.friction(0.0)
                way = 0 if way and abs(load) <= holds else int(np.sign(load))
                state[1] = 0.0
            if way:  # off the edge
                state = state + 1e-8 * np.array(self._rates(force, way)(now, state))
                now += 1e-8
        return found

    def _load(self, force: Callable[[float], float], t: float, s: np.ndarray) -> float:
        return force(t) - self.pull(t, s[0], s[1], s[2:]) - self.damping * s[1]

    def _rates(self, force: Callable[[float], float], way: int) -> Callable[[float, np.ndarray], list[float]]:
        def rates(t: float, s: np.ndarray) -> list[float]:
            if not way:
                return [0.0] * s.size
            rubs = way * self.friction(s[1]) if self.friction else 0.0
            return [s[1], (self._load(force, t, s) - rubs) / self.mass, *self.own(s[0], s[1], s[2:])]

        return rates

    def _events(self, force: Callable[[float], float], way: int) -> list[Callable[..., float]]:
        def slips(t: float, s: np.ndarray) -> float:
            return abs(self._load(force, t, s)) - self.friction(0.0)  # type: ignore[misc]

        def turns(t: float, s: np.ndarray) -> float:
            return float(s[1])

        found: list[Callable[..., float]] = [lambda t, s, edge=edge: s[0] - edge for edge in self.edges]
        if self.friction:
            found = [turns if way else slips]
            found[0].direction = -way or 1  # type: ignore[attr-defined]
        for one in found:
            one.terminal = True  # type: ignore[attr-defined]
        return found


def machine(case: str, rng: np.random.Generator) -> Machine:
    """One with numbers that are drawn."""
    mass, damping, k = rng.uniform(1.1, 1.9), rng.uniform(12, 25), rng.uniform(0.9e4, 1.5e4)
    size = rng.uniform(0.7, 1.4)
    gap, stiff, tuned = 0.4e-3 * size, 1e5 * size, 2 * np.pi * 22
    pulls: dict[str, Law] = {
        "hardening": lambda t, x, v, z: k * x * (1 + 0.25 * size * (x / USUAL) ** 2),
        "softening": lambda t, x, v, z: k * x
        * (1 - 0.06 * size * (x / USUAL) ** 2 * np.exp(-((x / (3 * USUAL)) ** 4))),
        "quadratic": lambda t, x, v, z: k * x * (1 + 0.03 * size * x / USUAL),
        "crack": lambda t, x, v, z: k * x * (1 - 0.2 * size * (x > 0)),
        "drift": lambda t, x, v, z: k * x * (1 - 0.03 * size * t),
        "drag": lambda t, x, v, z: k * x + 30 * size * v * abs(v),
        "backlash": lambda t, x, v, z: k * (x - min(max(x, -gap), gap)),
        "stop": lambda t, x, v, z: k * x + stiff * max(x - 5e-3, 0.0),
        "two-stops": lambda t, x, v, z: k * x + stiff * (x - min(max(x, -5e-3), 5e-3)),
        "hysteresis": lambda t, x, v, z: k * x + 2.5e3 * size * z[0],
        "lugre": lambda t, x, v, z: k * x + 4e4 * size * z[0],
        "mount": lambda t, x, v, z: k * x + 3e3 * size * z[0],
        "absorber": lambda t, x, v, z: k * x
        + 0.12 * size * (tuned**2 * (x - z[0]) + 0.08 * tuned * (v - z[1])),
    }  # fmt: skip
    found = Machine(mass, damping, pulls.get(case, lambda t, x, v, z: k * x))
    found.edges = {"backlash": (-gap, gap), "stop": (5e-3,), "two-stops": (-5e-3, 5e-3), "crack": (0.0,)}.get(
        case, ()
    )
    owns = {
        "hysteresis": lambda x, v, z: [v - (0.6 * abs(v) * z[0] + 0.4 * v * abs(z[0])) / 0.8e-3],
        "lugre": lambda x, v, z: [v - 4e4 * abs(v) * z[0] / (3 + 2 * np.exp(-((v / 0.05) ** 2)))],
        "mount": lambda x, v, z: [v - z[0] / 0.02],
        "absorber": lambda x, v, z: [z[1], tuned**2 * (x - z[0]) + 0.08 * tuned * (v - z[1])],
    }
    if case in owns:
        found.own, found.states = owns[case], 2 if case == "absorber" else 1
    if case == "coulomb":
        found.friction = lambda v: 4 * size
    if case == "stribeck":
        found.friction = lambda v: size * (3 + 3 * np.exp(-((v / 0.06) ** 2)))
    return found


def record(path: Path, case: str, seed: int, again: bool, samples: int) -> None:
    """Write a recording of a machine that the seed draws; `again` with another force and noise."""
    known = machine(case, np.random.default_rng([seed, 77]))
    size = np.random.default_rng([seed, 78]).uniform(0.7, 1.4)
    rng = np.random.default_rng([seed, 79, again])
    clock = np.arange(samples) / RATE
    force = push(rng, (seed + again) % 3, clock[-1])
    kicks = 3 * size * rng.standard_normal(samples)
    if case == "slow-process":
        kicks = sosfiltfilt(butter(2, 80, fs=RATE, output="sos"), kicks)
    random = case in ("process", "slow-process")
    x = 1e3 * known.motion(
        (lambda t: force(t) + np.interp(t, clock, kicks)) if random else force,
        1e-3 if random else 2e-3,
        clock,
    )
    if case == "delay":
        x = np.interp(clock - 3e-3 * size, clock, x)
    if case == "lag":
        kept = np.exp(-1 / (RATE * 4e-3 * size))
        x = lfilter([1 - kept], [1, -kept], x)
    x += {"zero": 0.5 * size, "saturation": -0.02 * size * x**3 / 16}.get(case, 0.0)
    deviation, noise = 0.01 * np.std(x), rng.standard_normal(samples)
    if memory := FOLLOWS_ITSELF.get(case):
        begun = memory * rng.standard_normal(1)  # as if it had always gone on
        noise = 2 * lfilter([np.sqrt(1 - memory**2)], [1, -memory], noise, zi=begun)[0]
    if case == "heavy-tails":
        noise = rng.standard_t(4, samples) / np.sqrt(2)
    x = x + (5 if case == "strong" else 1) * deviation * noise
    if case == "rounded":
        x = 3 * deviation * np.round(x / (3 * deviation))
    told = {"wf_increment": 1 / RATE}
    given = np.array([force(t) for t in clock])
    with TdmsWriter(path) as writer:
        writer.write_segment(
            [ChannelObject("run", "Load cell", given / 1e3, told | {"unit_string": "kN"}),
             ChannelObject("run", "x", x, told | {"unit_string": "mm"})]
        )  # fmt: skip


def dx(v):
    return v


def dv(force, spring, damper, mass):
    return (force - spring - damper) / mass


def spring(x, stiffness):
    return stiffness * x


def damper(v, damping):
    return damping * v


def oscillator(effects: list, noise: float | None = None) -> Model:
    """What a user writes."""
    return Model.from_rates(
        dx, dv, spring, damper, states={"x": State("m"), "v": State("m/s")}, inputs={"force": "N"},
        observables={"x": Signal("mm", noise)}, units={"spring": "N", "damper": "N"}, effects=effects,
        parameters={"stiffness": (1e4, 1e3, 1e5, "N/m"), "damping": (20, 1, 200, "N*s/m"),
            "mass": (1.2, 0.1, 10, "kg")},
    )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", nargs="+", default=[*LACKS, *NOTHING], choices=[*LACKS, *NOTHING])
    parser.add_argument("--seeds", default="1:2", metavar="FIRST:END")
    parser.add_argument("--samples", type=int, default=4096)
    asked = parser.parse_args()
    model = oscillator(shelf.mechanics(force="spring", x="x", v="v") + shelf.sensor(of="x"))
    right = count = 0
    for case in asked.cases:
        for seed in range(*map(int, asked.seeds.split(":"))):
            with tempfile.TemporaryDirectory() as folder:
                place = Path(folder)
                record(place / "run.tdms", case, seed, False, asked.samples)
                unseen = [place / "again.tdms"] if case in LACKS else []
                for file in unseen:
                    record(file, case, seed, True, asked.samples)
                begin(
                    place / "study", keep_in_memory(model), None, [place / "run.tdms"],
                    validations=unseen, columns={"force": "Load cell"},
                )  # fmt: skip
                study, began = specan.Study(place / "study"), time.process_time()
                found = study.diagnose()
                spent, said = time.process_time() - began, [tuple(sorted(a)) for a in found.alternatives]
                good = bool(LACKS[case] & set(said)) if case in LACKS else found.verdict == "nothing-missing"
                fall = ""
                for name in found.alternatives[0] if found.alternatives and unseen else ():
                    rows = study.add(name).columns()
                    held = list(rows["data"]).index("held-out")
                    fall = f"{fall}{rows['before'][held]:.3g} -> {rows['after'][held]:.3g} mm "
                right, count = right + good, count + 1
                mark = "right" if good else "WRONG"
                names = " | ".join("+".join(one) for one in said)
                print(
                    f"{mark} {case} {seed}: {found.verdict}, {names or found.reason} {fall}{spent:.0f} s",
                    flush=True,
                )
    print(f"{right} of {count} right")


if __name__ == "__main__":
    main()
