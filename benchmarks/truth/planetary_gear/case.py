"""A test case: a drawn set, what is hidden in it, its recordings at several speeds and torques, its rig file."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from specan.io.write_tdms import write_tdms
from truth.planetary_gear.machine import Machine, contact_ratios
from truth.planetary_gear.recorded import RATE, Housing, Run, record

OUTSIDE = ("bearing-defect",)
ANGLES_DEG = (90.0, 0.0)
# Teeth of sun, planet and ring, number of planets: in phase, in phase, one after the other, counter-phased.
SETS = ((24, 21, 66, 3), (30, 24, 78, 3), (20, 25, 70, 3), (18, 24, 66, 4))
RUNS = (Run(30.0, 30.0, 8.0), Run(30.0, 60.0, 8.0), Run(24.0, 60.0, 10.0))
HELD_OUT = Run(30.0, 90.0, 8.0)


@dataclass(frozen=True)
class Gear:
    """A drawn case."""

    seed: int
    machine: Machine
    housing: Housing
    mount_deg: float
    runs: tuple[Run, ...] = RUNS
    held_out: Run = HELD_OUT


def draw(seed: int, *effects: str, strength: float = 1.0, drawn_set: bool = False) -> Gear:
    """A set with hidden effects; the form of each part is drawn among some that the model does not use.

    Parameters
    ----------
    strength : float
        Multiplies the drawn size of what is hidden.
    drawn_set : bool
        Draw teeth, speeds, torques and the form of the mesh stiffness too; else the article's set at three points.
    """
    rng = np.random.default_rng(seed)
    machine = Machine(
        pair_stiffness=7e7 * rng.uniform(0.7, 1.4),
        drop=rng.uniform(0.15, 0.45),
        ramp=rng.uniform(0.03, 0.12),
        contact_ratio=(1.586 + rng.normal(0, 0.02), 1.932 + rng.normal(0, 0.02)),
        lead=rng.normal(0, 0.02),
        damping_ratio=rng.uniform(0.03, 0.08),
        carrier_inertia=8e-3 * rng.uniform(0.7, 1.4),
    )
    # Both windows have a first Fourier coefficient near three quarters of their mean, as has the rig's assumption.
    form, middle = [("gauss", 0.76), ("arc", 1.85)][int(rng.integers(2))]
    modes = [
        [[rng.uniform(700, 2600), rng.uniform(0.04, 0.1), rng.normal(0, 1.0)] for _ in range(3)]
        for _ in ANGLES_DEG
    ]
    housing = Housing(
        ANGLES_DEG, form, middle * rng.uniform(0.96, 1.04), rng.normal(0, 0.03), np.array(modes),
        noise=10 ** rng.uniform(-1.3, -0.3),
    )  # fmt: skip
    mount = rng.normal(0, 1.0)
    runs, held_out = RUNS, HELD_OUT
    if drawn_set:
        rng_law = np.random.default_rng([seed, 17])
        machine, runs, held_out = _other_set(machine, np.random.default_rng([seed, 13]), rng_law)
    hidden = {
        name: _size(name, strength, np.random.default_rng([seed, 7, k]), machine.planets)
        for k, name in enumerate(effects)
    }
    if "transmission-path" in hidden:
        housing = replace(housing, width=housing.width * hidden["transmission-path"]["narrower"])
    return Gear(seed, replace(machine, hidden=hidden), housing, mount, runs, held_out)


def _other_set(
    machine: Machine, rng: np.random.Generator, rng_law: np.random.Generator
) -> tuple[Machine, tuple[Run, ...], Run]:
    """Another set of teeth, another form of the stiffness, and other speeds and torques."""
    z_sun, z_planet, z_ring, planets = SETS[int(rng.integers(len(SETS)))]
    form = str(rng.choice(["parabola", "trapezoid"]))
    ratios = contact_ratios(z_sun, z_planet, z_ring, machine.pressure_angle)
    # Linear springs; contact along a line; teeth that bend with contact at a point between them; contact at a point.
    exponent = float(rng_law.choice([1.0, 10 / 9, 1.25, 1.5]))
    machine = replace(
        machine,
        exponent=exponent,
        z_sun=z_sun,
        z_planet=z_planet,
        z_ring=z_ring,
        planets=planets,
        form=form,
        contact_ratio=ratios,
    )
    fast, top = round(rng.uniform(24, 34), 1), round(rng.uniform(50, 90))
    low = round(top * rng.uniform(0.2, 0.4))
    slow = round(fast * rng.uniform(0.7, 0.85), 1)
    runs = (Run(fast, low, 8.0), Run(fast, top, 8.0), Run(slow, top, 10.0))
    return machine, runs, Run(fast, round(1.4 * top), 8.0)


def _size(name: str, strength: float, rng: np.random.Generator, planets: int) -> dict[str, float]:
    """Size of a hidden effect: what a workshop would want to know about."""
    part = strength * 10 ** rng.uniform(-0.5, 0.0)
    sign = float(rng.choice([-1.0, 1.0]))
    planet = float(rng.integers(1, planets + 1))
    phase = rng.uniform(0, 2 * np.pi)
    return {
        "planet-position-error": {"planet": planet, "error_um": sign * 1.5 * part},
        "unequal-load-sharing": {"planet": planet, "share": sign * 0.2 * part},
        "carrier-runout": {"eccentricity_um": 1.0 * part, "phase": phase},
        "planet-runout": {"planet": planet, "eccentricity_um": 2.0 * part, "phase": phase},
        "sun-runout": {"eccentricity_um": 2.0 * part, "phase": phase},
        "torque-ripple": {"part": 0.05 * part, "phase": phase},
        "transmission-path": {"narrower": 1 - 0.35 * part if sign < 0 else 1 + 0.35 * part},
        "tooth-crack": {"softer": 0.3 * part, "place": rng.uniform(0, 1)},
        "pitch-errors": {"cumulative_um": 2.0 * part, "seed": float(rng.integers(1 << 30))},
        "mesh-damping": {"times": 3.0 if sign > 0 else 0.4},
        "tip-relief": {"longer": 1.0 + 4.0 * part},
        "tooth-friction": {"coefficient": 0.08 * part},
        "speed-fluctuation": {"rms_deg": 0.5 * part},
        "bearing-defect": {"order": 5.4318, "peak": 1.0 * part, "hz": rng.uniform(1500, 4000)},
    }[name]


def write_case(gear: Gear, folder: Path) -> tuple[list[Path], Path, Path]:
    """Recordings to fit, the one that is held out, and the rig file."""
    rng = np.random.default_rng([gear.seed, 11])
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for _number, run in enumerate((*gear.runs, gear.held_out)):
        name = f"run_{run.sun_hz:.0f}Hz_{run.torque:.0f}Nm.tdms"
        channels = record(gear.machine, gear.housing, run, gear.mount_deg, rng)
        volts = [s * 0.01 if c.startswith("Acc") else s for c, s in channels.items()]
        write_tdms(
            folder / name, list(channels), np.stack(volts), RATE, channels=[sensor(c) for c in channels],
            group={"SunSpeed_Hz": run.sun_hz, "Torque_Nm": run.torque, "SamplingRate": RATE}, samples="float32",
        )  # fmt: skip
        paths.append(folder / name)
    rig = folder / "rig.toml"
    m = gear.machine
    # Drawings tell the planets' inertia to 3 %, data sheets of coupling and brake that of all on the carrier to 10 %.
    known = np.exp(np.random.default_rng([gear.seed, 19]).normal(0, (0.1, 0.03)))
    rig.write_text(
        RIG.format(z_sun=m.z_sun, z_planet=m.z_planet, z_ring=m.z_ring, planets=m.planets,
                   carrier=m.carrier_inertia * known[0], planet=m.planet_inertia * known[1]), encoding="utf-8"
    )  # fmt: skip
    return paths[:-1], paths[-1], rig


def sensor(name: str) -> dict[str, object]:
    if name.startswith("Acc"):
        return {"QuantityUnit": "m/s^2", "Sensitivity": 10.0, "SensitivityUnit": "mV/(m/s^2)"}
    return {"QuantityUnit": "V", "PulsesPerRevolution": 1 if "carrier" in name else 32}


RIG = """[gear]
z_sun = {z_sun}
z_planet = {z_planet}
z_ring = {z_ring}
planets = {planets}
module_mm = 2.0
[sensors]
acc_angle_deg = [90.0, 0.0]
[rotors]
carrier_kg_m2 = {carrier:.3e}
planet_kg_m2 = {planet:.3e}
"""
