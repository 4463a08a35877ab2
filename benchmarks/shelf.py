"""Effects of the shelf, planted one at a time in recordings of an oscillator: is each named?

    python benchmarks/shelf.py [--seeds 0:1] [--effects NAME ...] [--samples 2048]

The oscillator is driven by noise in a band. Its numbers, the size of the effect and the noise of the channel are drawn
by the seed. A case is visible where the effect changes the recording by more than the base takes up: `lambda` is the
chi-square that the refitted base leaves more than the noise that was drawn has itself.
"""

from __future__ import annotations

import argparse
import os
import time
from collections import Counter

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import numpy as np  # noqa: E402
from recorded_machines import oscillator  # noqa: E402
from scipy.integrate import solve_ivp  # noqa: E402
from scipy.interpolate import CubicSpline  # noqa: E402

from specan import shelf  # noqa: E402
from specan.models import Model  # noqa: E402
from specan.models.march import Program  # noqa: E402
from specan.study.diagnose import diagnose  # noqa: E402
from specan.study.estimation.fit import fit  # noqa: E402
from specan.study.observation.time import TimeObservation  # noqa: E402
from specan.study.selection.candidates import base_problem  # noqa: E402

NOISE = 0.05  # mm
RATE = 500.0
FINER = 8  # samples between two of the recording, from which the truth is integrated
VISIBLE = 100.0


def model(noise: float) -> Model:
    """The oscillator as a user writes it, with the whole shelf."""
    return oscillator(
        [
            *shelf.mechanics(force=("spring", 60, "N"), x=("x", 6e-3, "m"), v=("v", 0.6, "m/s")),
            *shelf.sensor(of=("x", 6, "mm"), input="force"), *shelf.actuator(of=("force", 30, "N")),
        ],
        noise,
    )  # fmt: skip


def by_scipy(known: Model, effects: tuple[str, ...], given: dict, values: dict) -> np.ndarray:
    """What the sensor shows, the same rates integrated by scipy's LSODA at 1e-9."""
    assembly = known.assemble(effects)
    program = Program(assembly, switched=False)
    space = dict(program.functions)
    exec(program.source, space)
    drives = assembly.evaluate(given, values, wanted=program.drives)
    clock, p = given["time"], [{**assembly.defaults, **values}[name] for name in program.parameters]

    smooth = CubicSpline(clock, np.stack([drives[name] for name in program.drives], axis=1))

    def rates(t: float, s: np.ndarray) -> tuple[float, ...]:
        return space["rates"](s, smooth(t), p, ())

    start = np.zeros(len(program.states))
    done = solve_ivp(rates, (0, clock[-1]), start, "LSODA", clock, rtol=1e-9, atol=1e-12, max_step=1 / RATE)
    states = dict(zip(program.states, done.y))
    return next(assembly.pointwise({**given, **states}, [values], ["x_measured"]))["x_measured"]


def recordings(
    known: Model, name: str, seed: int, samples: int, noise: float
) -> tuple[TimeObservation, float, float]:
    """A recording with one effect at a drawn size; the standard deviation of what it changes over the noise; and the
    chi-square of the noise.
    """
    rng = np.random.default_rng([seed, sum(map(ord, name))])
    clock = np.arange(samples * FINER) / (RATE * FINER)
    force = sum(np.cos(2 * np.pi * f * clock + rng.uniform(0, 2 * np.pi)) for f in np.arange(2, 40, 0.33))
    force *= 30 / np.std(force)
    truth = {
        "spring.stiffness": 1e4 * rng.uniform(0.8, 1.2),
        "damper.damping": 20 * rng.uniform(0.7, 1.3),
        "dv.mass": rng.uniform(0.9, 1.1),
    }
    own = known.effects[name]
    for part in own.neutral:
        p = own.parameters[part]
        grown = p.default * rng.uniform(1, 3)
        truth[f"{name}.{part}"] = min(grown, p.max)
    given = {"time": clock, "force_channel": force}
    read = {effects: by_scipy(known, effects, given, truth)[::FINER] for effects in ((), (name,))}
    drawn = rng.standard_normal(samples)
    measured = read[name,] + noise * drawn
    rows = np.arange(samples)
    given = {condition: values[::FINER] for condition, values in given.items()}
    observation = TimeObservation(
        name="planted", observable=np.full(samples, "x"), measured=measured, conditions=given,
        covariance=np.full(samples, noise**2), recordings=("planted",), recording=np.zeros(samples, dtype=np.intp),
        noise_dof=10.0, series=(given, np.zeros(samples, dtype=np.intp)), position=rows,
        lines=rows + 1,
    )  # fmt: skip
    return observation, float(np.std(read[name,] - read[()]) / noise), float(drawn @ drawn)


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", default="0:1", metavar="FIRST:END")
    parser.add_argument("--effects", nargs="+", default=[])
    parser.add_argument("--samples", type=int, default=2048)
    asked = parser.parse_args()
    known, counts, spent = model(NOISE), Counter(), []
    for seed in range(*map(int, asked.seeds.split(":"))):
        for name in asked.effects or known.effects:
            observation, size, of_noise = recordings(known, name, seed, asked.samples, NOISE)
            problem = base_problem(known, [observation])
            left = fit(problem, starts=2).chi2 - of_noise
            began = time.process_time()
            found = diagnose(problem)
            spent.append(time.process_time() - began)
            told = {one for names in found.alternatives for one in names}
            outcome = (
                "alone"
                if told == {name}
                else "in a group"
                if (name,) in found.alternatives
                else found.verdict
            )
            outcome = outcome if left > VISIBLE else f"not visible: {outcome}"
            counts[outcome] += 1
            print(f"{name:24} seed {seed}: {size:7.1f} sigma, lambda {left:9.0f}, {spent[-1]:5.1f} s  {outcome:16} "
                  f"{' | '.join('+'.join(names) for names in found.alternatives[:5])}", flush=True)  # fmt: skip
    print(dict(counts), f"CPU s: median {np.median(spent):.1f}, most {max(spent):.1f}")


if __name__ == "__main__":
    main()
