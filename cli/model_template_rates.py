"""What ``specan model new --rates`` writes: a differential equation, and two recordings to try it on."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from specan.models.model import Model

TEMPLATE = '''"""A mass on a spring.

Change names, units and formulas into those of your own machine.
"""

from specan import shelf
from specan.models import Model, Signal, State

# The function dx gives the rate of the state x, per second. Arguments are states, recorded inputs, time, parameters,
# or other functions. Terms that an effect may change are functions of their own: spring, damper.


def spring(x, stiffness):
    """Force of the spring."""
    return stiffness * x


def damper(v, damping):
    """Force of the damper."""
    return damping * v


def dx(v):
    """Velocity."""
    return v


def dv(force, spring, damper, mass):
    """Acceleration."""
    return (force - spring - damper) / mass


model = Model.from_rates(
    dx, dv, spring, damper,
    states={"x": State("m"), "v": State("m/s")},
    inputs={"force": "N"},  # channels of the recording
    observables={"x": Signal("mm", 0.05)},  # unit, standard deviation of the noise (may be left out)
    parameters={
        "stiffness": (1e4, 1e3, 1e5, "N/m"),  # start, lowest, highest plausible
        "damping": (20, 1, 200, "N*s/m"),
        "mass": (1, 0.1, 10, "kg"),
    },
    units={"spring": "N", "damper": "N"},
    # what may be missing: of each name its usual size in your recordings
    effects=[
        *shelf.mechanics(force=("spring", 60, "N"), x=("x", 6e-3, "m"), v=("v", 0.6, "m/s")),
        *shelf.sensor(of=("x", 6, "mm")),
    ],
)
'''

# What was "measured": the model with a hardening spring, sampled with the stated noise.
TRUTH = {
    "spring.stiffness": 1.1e4, "damper.damping": 15.0, "dv.mass": 1.2, "cubic-spring.size": 1.5e6,
}  # fmt: skip
SAMPLES, RATE_HZ, NOISE_MM, FORCE_N = 2048, 500.0, 0.05, 30.0
LINES_HZ = np.arange(2.0, 40.0, 0.4)


def recording_to_try(model: Model, path: Path, seed: int) -> None:
    """A recording of force and displacement, with an effect in it that the model lacks."""
    from specan.io.output_file import whole_file
    from specan.io.write_tdms import write_tdms

    random = np.random.default_rng(seed)
    time = np.arange(SAMPLES) / RATE_HZ
    turns = random.uniform(0, 2 * np.pi, LINES_HZ.size)
    force = np.cos(2 * np.pi * np.outer(time, LINES_HZ) + turns).sum(axis=1)
    force *= FORCE_N / np.std(force)
    found: Any = model.assemble(["cubic-spring"]).evaluate({"time": time, "force_channel": force}, TRUTH)
    x = found["x_measured"] + NOISE_MM * random.standard_normal(SAMPLES)
    described = [{"unit_string": "N"}, {"unit_string": "mm"}]
    with whole_file(path) as half:
        write_tdms(
            half, ["force", "x"], np.stack([force, x]), RATE_HZ, channels=described,
            group={"SamplingRate": RATE_HZ, "Description": "simulated"}, samples="float32",
        )  # fmt: skip
