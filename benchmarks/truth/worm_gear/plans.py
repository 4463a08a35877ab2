"""Test plans: which conditions are set, in which order, how often."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from truth.worm_gear.gear import Array

_TURN = 600.0  # s from one condition to the next


@dataclass(frozen=True)
class Plan:
    """A test plan.

    Parameters
    ----------
    torques, speeds, temperatures, levels : sequence of float
        Set values: Nm at the output, rpm, degC, percent. All combinations are run.
    idle : bool
        Also run every speed and temperature without the brake.
    setups : int
        How often each condition is set anew.
    readings : int
        Back-to-back readings at one setting.
    order : {"sorted", "random"}
        Sorted: by temperature, then torque, then speed, each round of set-ups after the other.
    time : bool
        Whether the table tells the elapsed time.
    columns : {"torques", "efficiency"}
        Measured values with instrument resolution, or a printed table of efficiencies in steps of 0.01 at the
        set values (idle rows carry the input torque instead).
    setting : {"measured", "exact"}
        Whether the brake, the drive and the heater miss their set values (the table then holds what was measured).
    """

    torques: Sequence[float]
    speeds: Sequence[float]
    temperatures: Sequence[float]
    levels: Sequence[float] = (100.0,)
    idle: bool = False
    setups: int = 2
    readings: int = 1
    order: str = "sorted"
    time: bool = False
    columns: str = "torques"
    setting: str = "measured"


@dataclass(frozen=True)
class Settings:
    """The plan as a list of rows; arrays of one length."""

    torque: Array
    speed: Array
    temperature: Array
    level: Array
    repeat: Array
    setup: Array
    elapsed_time: Array
    dwell: Array


_TORQUES = (5.0, 15.0, 30.0, 50.0, 80.0)
_SPEEDS = (600.0, 1000.0, 1400.0, 1800.0, 2300.0, 2800.0)
_TEMPERATURES = (45.0, 60.0, 75.0)

PLANS: dict[str, Plan] = {
    "grid": Plan(_TORQUES, _SPEEDS, _TEMPERATURES),
    "grid-3": Plan(_TORQUES, _SPEEDS, _TEMPERATURES, setups=3),
    "exact": Plan(_TORQUES, _SPEEDS, _TEMPERATURES, setting="exact"),
    "readings": Plan(_TORQUES, _SPEEDS, _TEMPERATURES, setups=2, readings=2),
    "idle": Plan(_TORQUES, _SPEEDS, _TEMPERATURES, idle=True),
    "levels": Plan(
        (5.0, 20.0, 50.0, 80.0), (800.0, 1400.0, 2000.0, 2800.0), (45.0, 65.0), levels=(100.0, 65.0)
    ),
    "campaign": Plan(_TORQUES, _SPEEDS, _TEMPERATURES, order="random", time=True),
    "campaign-sorted": Plan(_TORQUES, _SPEEDS, _TEMPERATURES, time=True),
    "small": Plan((5.0, 20.0, 50.0, 90.0), (800.0, 1500.0, 2800.0), (45.0, 70.0)),
    "article": Plan(
        (5.0, 15.0, 25.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0),
        (1200.0, 1500.0, 2000.0, 2400.0, 2800.0),
        (58.0,),
        idle=True,
        setups=1,
        columns="efficiency",
        setting="exact",
    ),
}


def draw_grid(plan: Plan, rng: np.random.Generator) -> Plan:
    """The same kind of plan on a grid of its own: other torques, speeds, temperatures, sometimes a third set-up."""
    torques = np.geomspace if rng.uniform() < 0.5 else np.linspace
    drawn = replace(
        plan,
        torques=tuple(
            np.round(torques(rng.uniform(4, 12), rng.uniform(55, 95), rng.integers(4, 8)), 0).tolist()
        ),
        speeds=tuple(
            (
                100 * np.round(np.linspace(rng.uniform(5, 12), rng.uniform(24, 29), rng.integers(4, 7)))
            ).tolist()
        ),
        temperatures=tuple(
            np.round(np.linspace(rng.uniform(35, 50), rng.uniform(65, 78), rng.integers(2, 4))).tolist()
        ),
    )
    return replace(drawn, setups=int(rng.integers(2, 4)) if plan.setups > 1 else 1)


def lay_out(plan: Plan, rng: np.random.Generator) -> Settings:
    """The rows of a plan in the order in which they are run."""
    torques = ((0.0,) if plan.idle else ()) + tuple(plan.torques)
    cells = [
        (level, temperature, torque, speed)
        for level in plan.levels
        for temperature in plan.temperatures
        for torque in torques
        for speed in plan.speeds
    ]
    runs = [(repeat, *cell) for repeat in range(1, plan.setups + 1) for cell in cells]
    if plan.order == "random":
        runs = [runs[i] for i in rng.permutation(len(runs))]
    start = np.arange(len(runs)) * _TURN
    rows = np.repeat(np.array(runs, float), plan.readings, axis=0)
    reading = np.tile(np.arange(plan.readings), len(runs))
    dwell = _TURN * (0.9 + 0.05 * reading / max(plan.readings, 1))
    repeat, level, temperature, torque, speed = rows.T
    return Settings(
        torque=torque,
        speed=speed,
        temperature=temperature,
        level=level,
        repeat=repeat,
        setup=np.repeat(np.arange(1, len(runs) + 1), plan.readings).astype(float),
        elapsed_time=np.repeat(start, plan.readings) + dwell,
        dwell=dwell,
    )
