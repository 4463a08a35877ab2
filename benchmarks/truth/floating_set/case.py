"""A test case: a drawn set, its housing, what is hidden in it, its recordings and its rig file."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from specan.io.write_tdms import write_tdms
from truth.floating_set.housing import HARMONICS, PULSES, RATE, Housing, Run, record
from truth.floating_set.machine import Machine, with_hidden
from truth.planetary_gear.case import RIG, SETS, sensor
from truth.planetary_gear.machine import contact_ratios

ANGLES_DEG = (90.0, 0.0)


@dataclass(frozen=True)
class Gear:
    """A drawn case."""

    seed: int
    machine: Machine
    housing: Housing
    mount_deg: float
    runs: tuple[Run, ...]
    held_out: Run


def draw(seed: int, *effects: str, strength: float = 1.0) -> Gear:
    """A set with hidden effects; its teeth, springs, housing and operating points are drawn."""
    rng = np.random.default_rng([seed, 101])
    z_sun, z_planet, z_ring, planets = SETS[int(rng.choice(len(SETS), p=[0.4, 0.2, 0.2, 0.2]))]
    fast, top = round(rng.uniform(24, 34), 1), round(rng.uniform(45, 110))
    low, slow = round(top * rng.uniform(0.3, 0.5)), round(fast * rng.uniform(0.7, 0.85), 1)
    runs = (Run(fast, low, 8.0), Run(fast, top, 8.0), Run(slow, top, 10.0))
    held_out = Run(fast, round(0.75 * top), 8.0)
    hidden = {
        name: _size(name, strength, np.random.default_rng([seed, 102, k]), planets)
        for k, name in enumerate(effects)
    }
    flanks = tuple(
        tuple(complex(*rng.normal(0, 0.25e-6 / h, 2)) for h in range(1, 5)) for _ in ("sun", "ring")
    )
    machine = Machine(
        z_sun=z_sun,
        z_planet=z_planet,
        z_ring=z_ring,
        planets=planets,
        pair_stiffness=8e7 * rng.uniform(0.7, 1.4),
        roundness=rng.uniform(1.0, 4.0),
        ramp=rng.uniform(0.03, 0.15),
        contact_ratio=contact_ratios(z_sun, z_planet, z_ring, math.radians(20.0)),
        profile=flanks,  # type: ignore[arg-type]
        damping_ratio=rng.uniform(0.03, 0.1),
        sun_bearing=10 ** rng.uniform(7.3, 8.3),
        pin=3e8 * rng.uniform(0.7, 1.5),
        drive_inertia=10 ** rng.uniform(-2.3, -1.7),
        carrier_inertia=8e-3 * rng.uniform(0.7, 1.4),
    )
    return Gear(seed, with_hidden(machine, hidden), _housing(rng, hidden), rng.normal(0, 1.0), runs, held_out)


def _housing(rng: np.random.Generator, hidden: dict[str, dict[str, float]]) -> Housing:
    """A path that differs by a factor of two from harmonic to harmonic, and hears planets over other parts."""
    shape = (len(ANGLES_DEG), HARMONICS)
    modes = [
        [[rng.uniform(500, 3000), rng.uniform(0.02, 0.08), rng.normal(0, 1.0)] for _ in range(3)]
        for _ in ANGLES_DEG
    ]
    narrower = hidden.get("transmission-path", {}).get("narrower", 1.0)
    tones = [[50.0 * k, rng.uniform(0, 0.02), rng.uniform(0, 1)] for k in (1, 2, 3, 6)]
    tones += [[rng.uniform(100, 3000), 10 ** rng.uniform(-3, -1.5), rng.uniform(0, 1)] for _ in range(3)]
    disc = 0.03 * rng.rayleigh() * np.cos(2 * np.pi * (np.arange(PULSES) / PULSES + rng.uniform(0, 1)))
    return Housing(
        ANGLES_DEG,
        gain=np.exp(rng.normal(0, 0.7, shape) + 2j * np.pi * rng.uniform(0, 1, shape)),
        narrow=1.7 * narrower * np.exp(rng.normal(0, 0.4, shape)),
        skew=rng.normal(0, 0.15, shape),
        floor=rng.uniform(0, 0.1, shape),
        modes=np.array(modes),
        noise=10 ** rng.uniform(-2.0, -1.0),
        tones=np.array(tones),
        disc_deg=disc + rng.normal(0, 0.02, PULSES),
    )


def _size(name: str, strength: float, rng: np.random.Generator, planets: int) -> dict[str, float]:
    """Size of a hidden effect: what a workshop would want to know about."""
    part = strength * 10 ** rng.uniform(-0.5, 0.0)
    sign = float(rng.choice([-1.0, 1.0]))
    planet, phase = float(rng.integers(1, planets + 1)), rng.uniform(0, 2 * np.pi)
    return {
        "planet-position-error": {"planet": planet, "error_um": sign * 3.0 * part},
        "unequal-load-sharing": {"planet": planet, "softer": 1.5 * part},
        "carrier-runout": {"eccentricity_um": 2.0 * part, "phase": phase},
        "planet-runout": {"planet": planet, "eccentricity_um": 3.0 * part, "phase": phase},
        "sun-runout": {"eccentricity_um": 4.0 * part, "phase": phase},
        "torque-ripple": {"part": 0.1 * part, "phase": phase},
        "transmission-path": {"narrower": 1 - 0.5 * min(part, 1.2) if sign < 0 else 1 + part},
        "tooth-crack": {"softer": min(0.4 * part, 0.9), "place": rng.uniform(0, 1)},
        "pitch-errors": {"cumulative_um": 5.0 * part, "seed": float(rng.integers(1 << 30))},
        "ring-flexibility": {"thinner": 12.0 * part},
        "mesh-damping": {"stiffness": 0.3 if sign > 0 else -0.2, "damping": 3.0 if sign > 0 else 0.4},
        "speed-fluctuation": {"part": 0.01 * part},
        "bearing-defect": {"order": 5.4318, "peak": 3.0 * part, "hz": rng.uniform(1500, 4000)},
    }[name]


def write_case(gear: Gear, folder: Path) -> tuple[list[Path], Path, Path]:
    """Recordings to fit, the one that is held out, and the rig file."""
    rng = np.random.default_rng([gear.seed, 103])
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for run in (*gear.runs, gear.held_out):
        name = f"run_{run.sun_hz:.0f}Hz_{run.torque:.0f}Nm.tdms"
        channels = record(gear.machine, gear.housing, run, gear.mount_deg, rng)
        volts = [s * 0.01 if c.startswith("Acc") else s for c, s in channels.items()]
        write_tdms(
            folder / name, list(channels), np.stack(volts), RATE, channels=[sensor(c) for c in channels],
            group={"SunSpeed_Hz": run.sun_hz, "Torque_Nm": run.torque, "SamplingRate": RATE}, samples="float32",
        )  # fmt: skip
        paths.append(folder / name)
    rig, m = folder / "rig.toml", gear.machine
    known = np.exp(np.random.default_rng([gear.seed, 104]).normal(0, (0.1, 0.03)))
    rig.write_text(
        RIG.format(z_sun=m.z_sun, z_planet=m.z_planet, z_ring=m.z_ring, planets=m.planets,
                   carrier=m.carrier_inertia * known[0], planet=m.planet_inertia * known[1]), encoding="utf-8"
    )  # fmt: skip
    return paths[:-1], paths[-1], rig
