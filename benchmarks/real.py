"""Measurements that nobody of this project made, with the answer that was published, and what specan says.

    python benchmarks/real.py [--data DIRECTORY]

The worm drive stands in ``sample_data``. DIRECTORY may hold what is not shipped: ``worm_drive/lifting.csv`` with
``worm_drive/rig_for_worm_gear.toml`` (the same drive as a table for the built-in worm gear; bearings and pitch
diameter are guesses), ``motor_octaves`` (Eomys/MoSQITo, validations/sound_level_meter/noct_spectrum, Apache-2.0), and
recordings for models of rates: ``cascaded_tanks``, ``pendulum``, ``silverbox``. A wrong name is never acceptable; an
honest doubt is.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import specan
from specan import shelf
from specan.models import Model, Parameter, Signal, State
from specan.models.catalogue import keep_in_memory
from specan.study.create import begin

SAMPLES = Path(__file__).parents[1] / "sample_data" / "worm_drive"
DRIVE = (
    "RViMLab/TRO2021-Dynamic-Modelling, experiments/driveNo3 (MIT); Mablekos-Alexiou, da Cruz, Bergeles, "
    "IEEE Transactions on Robotics 37(4), 2021"
)
HELD_OUT = "speed=-2,-5.9,-13,-40,-90,-140,2.1,6,13,40,90,140"


@dataclass(frozen=True)
class Answer:
    """A question put to real data."""

    question: str
    source: str
    expected: str
    found: str
    right: bool


def worm_drive_own(work: Path) -> Iterator[Answer]:
    """A model of the user's own with three candidates, and laws without any."""
    columns = {"speed": "rpm [rpm]", "torque": "torque_Nm [N*m]"}
    table = SAMPLES / "steady_runs.csv"
    begin(work / "own", str(SAMPLES / "worm_drive.py"), None, [table], hold_out=[HELD_OUT], columns=columns)
    study = specan.Study(work / "own")
    found = study.diagnose()
    named = {name for names in found.alternatives for name in names}
    yield Answer(
        "which friction does the drive's model lack?",
        DRIVE,
        "Stribeck friction at slow speeds",
        f"{found.verdict}: {', '.join(sorted(named)) or 'no name'}; first of the ranking: {found.ranking[0].effects}",
        all(name.startswith("stribeck") for name in found.ranking[0].effects)
        and all(name.startswith("stribeck") for name in named),
    )
    laws = study.propose()
    slow = {"gaussian", "exponential", "hyperbola", "lorentzian", "saturation", "power"}
    families = [law.name for law in laws.laws]
    yield Answer(
        "which law does it follow, without candidates?",
        DRIVE,
        "a rise of friction at slow speeds",
        ", ".join(families),
        bool(families)
        and all(any(f"law-{kind}" in name or "signed" in name for kind in slow) for name in families),
    )
    change = study.add(found.ranking[0].effects[0])
    rows = change.columns()
    falls = dict(zip(rows["data"], zip(rows["before"], rows["after"])))
    yield Answer(
        "does the error fall on speeds that were never fitted?",
        DRIVE,
        "it falls",
        f"{falls['held-out'][0]:.3g} -> {falls['held-out'][1]:.3g}",
        falls["held-out"][1] < falls["held-out"][0],
    )


def worm_drive_built_in(work: Path, data: Path) -> Iterator[Answer]:
    """The built-in worm gear on the lifting half: its flanks' friction falls with the speed in one of its effects."""
    study = specan.Study.new(
        work / "gear",
        "worm-gear",
        data / "lifting.csv",
        rig=data / "rig_for_worm_gear.toml",
        hold_out="speed_rpm=3.972,8,60",
    )
    found = study.diagnose()
    named = {name for names in found.alternatives for name in names}
    yield Answer(
        "what does the built-in worm gear lack?",
        DRIVE,
        "friction that is larger at slow speeds (Stribeck), or nothing that is known",
        f"{found.verdict}: {', '.join(sorted(named)) or found.reason}",
        named == {"speed-dependent-friction"} or found.verdict in ("fits-only-if", "unknown-effect"),
    )


def motor_octaves(data: Path) -> Iterator[Answer]:
    """Third octaves beside an analyser of another maker, which leaves out the ends of the record."""
    lines = (
        (data / "electric_motor_vibration_3oct_oros.txt")
        .read_text(encoding="utf-8", errors="replace")
        .splitlines()
    )
    rows = np.array([[float(cell) for cell in line.split()] for line in lines[2:] if line.strip()])
    found = specan.octave(data / "electric_motor_vibration_signal.uff", fmin=25.0, settling="left-out")
    theirs = {frequency: 20 * np.log10(value) for frequency, value in rows}
    wanted = [k for k, f in enumerate(found.nominal_hz) if f in theirs and 25 <= f <= 800]
    difference = np.array([found.level_dB[0, k] - theirs[found.nominal_hz[k]] for k in wanted])
    difference -= np.median(difference)  # the file says volts; the scale is not at issue
    rms = float(np.sqrt(np.mean(difference**2)))
    yield Answer(
        "third octaves of a motor's vibration, 25 to 800 Hz, beside an OROS",
        "Eomys/MoSQITo, validations/sound_level_meter/noct_spectrum (Apache-2.0)",
        "0.3 dB rms at most",
        f"{rms:.2f} dB rms over {len(wanted)} bands",
        rms <= 0.3,
    )


def recorded(work: Path, name: str, rate: float, units: dict, rows: np.ndarray) -> Path:
    """Columns as a file with a column of time."""
    header = ",".join(["time [s]", *(f"{n} [{u}]" for n, u in units.items())])
    table = np.column_stack([np.arange(len(rows)) / rate, rows])
    np.savetxt(work / f"{name}.csv", table, "%.12g", ",", header=header, comments="")
    return work / f"{name}.csv"


def steps_of(study: specan.Study, most: int = 2) -> tuple[list[tuple[str, ...]], list[float]]:
    """What diagnoses name one after the other, and the error on what was never fitted, before and after each."""
    names, errors = [], []
    for _ in range(most):
        found = study.diagnose()
        if not found.alternatives:
            names.append((found.verdict,))
            break
        names.append(found.alternatives[0])
        for effect in found.alternatives[0]:
            rows = study.add(effect).columns()
            held = list(rows["data"]).index("held-out")
            errors += [rows["before"][held]] if not errors else []
            errors.append(rows["after"][held])
    return names, errors


def written(names: list[tuple[str, ...]], errors: list[float], unit: str) -> str:
    said = ", then ".join(" with ".join(one) for one in names)
    return f"{said}; other record {' -> '.join(f'{e:.3g}' for e in errors)} {unit}"


def tanks(work: Path, data: Path) -> Iterator[Answer]:
    """Two tanks in cascade: Torricelli's law for both, in volts of the sensor."""

    def dupper(pump, upper_out, gain):
        return gain * pump - upper_out

    def dlower(upper_out, lower_out, share):
        return share * upper_out - lower_out

    def upper_out(upper, opening):
        return opening * np.sqrt(np.maximum(upper, 1e-6))

    def lower_out(lower, drain):
        return drain * np.sqrt(np.maximum(lower, 1e-6))

    rate = "V^0.5/s"
    first = Parameter(5.0, "V", min=0.5, max=15, lower=0.0, per="recording")
    model = Model.from_rates(
        dupper, dlower, upper_out, lower_out,
        states={"upper": State("V", start=first), "lower": State("V", start="measured")},
        inputs={"pump": "V"}, observables={"lower": Signal("V")}, units={"upper_out": "V/s", "lower_out": "V/s"},
        parameters={"gain": (0.04, 0.005, 0.3, "1/s"), "share": (1.0, 0.2, 5),
            "opening": (0.05, 0.005, 0.5, rate), "drain": (0.05, 0.005, 0.5, rate)},
        effects=[
            *shelf.tank(outflow="upper_out", level="upper", prefix="upper-"),
            *shelf.tank(outflow="lower_out", level="lower", prefix="lower-"),
        ],
    )  # fmt: skip
    table = np.genfromtxt(data / "dataBenchmark.csv", delimiter=",", skip_header=1)
    units = {"pump": "V", "lower": "V"}
    files = [recorded(work, f"tanks_{k}", 0.25, units, table[:, [k, k + 2]]) for k in (0, 1)]
    begin(work / "tanks", keep_in_memory(model), None, files[:1], validations=files[1:])
    names, errors = steps_of(specan.Study(work / "tanks"))
    yield Answer(
        "what does Torricelli's law lack?",
        "Schoukens and Noel 2016, cascaded tanks (forgi86/sysid-neural-structures-fitting, MIT)",
        "the overflow; other record 0.669 -> 0.520 V",
        written(names, errors, "V"),
        any("overflow" in name for one in names for name in one) and errors[-1] < 0.53,
    )


def pendulum(work: Path, data: Path) -> Iterator[Answer]:
    """A driven pendulum without friction; the second half is never fitted."""

    def dangle(rate):
        return rate

    def drate(torque, weight, inertia):
        return (torque - weight) / inertia

    def weight(angle, moment):
        return moment * np.sin(angle)

    model = Model.from_rates(
        dangle, drate, weight, states={"angle": State("rad", start="measured"), "rate": State("rad/s")},
        inputs={"torque": "N*m"}, observables={"angle": Signal("rad")}, units={"weight": "N*m"},
        parameters={"moment": (2.5, 0.5, 10, "N*m"), "inertia": (0.15, 0.02, 1, "kg*m^2")},
        effects=shelf.mechanics(force="weight", x="angle", v="rate"),
    )  # fmt: skip
    table = np.genfromtxt(data / "measured.csv", delimiter=",", skip_header=1)
    clock = np.linspace(table[0, 0], table[-1, 0], len(table))
    rows = np.stack([np.interp(clock, table[:, 0], table[:, k]) for k in (1, 3)], axis=1)
    file = recorded(work, "pendulum", 1 / (clock[1] - clock[0]), {"angle": "rad", "torque": "N*m"}, rows)
    unseen = f"time={clock[len(clock) // 2]:.4f}..{clock[-1] + 1:.4f}"
    begin(work / "pendulum", keep_in_memory(model), None, [file], hold_out=[unseen])
    names, errors = steps_of(specan.Study(work / "pendulum"))
    frictions = {"dry-friction", "stribeck-friction", "lugre-friction", "dahl-friction", "root-friction"}
    yield Answer(
        "which friction does the pendulum have?",
        "dfki-ric-underactuated-lab/torque_limited_simple_pendulum (BSD-3-Clause)",
        "Coulomb; unseen half 0.046 rad with it, 0.126 with a viscous one, 0.388 with a quadratic one",
        written(names, errors, "rad"),
        bool(frictions & {name for one in names for name in one}) and errors[-1] < 0.1,
    )


def silverbox(work: Path, data: Path) -> Iterator[Answer]:
    """An electronic oscillator with a cubic spring: 4 096 samples of the multisine, and others."""

    def dout(pace):
        return pace

    def dpace(drive, spring, damper, gain):
        return gain * drive - spring - damper

    def spring(out, stiffness):
        return stiffness * out

    def damper(pace, damping):
        return damping * pace

    starts = [
        Parameter(0.0, unit, min=-size, max=size, per="recording")
        for unit, size in (("V", 0.5), ("V/s", 300))
    ]
    model = Model.from_rates(
        dout, dpace, spring, damper, states={"out": State("V", start=starts[0]), "pace": State("V/s", start=starts[1])},
        inputs={"drive": "V"}, observables={"out": Signal("V")}, units={"spring": "V/s^2", "damper": "V/s^2"},
        parameters={"stiffness": (2e5, 5e4, 1e6, "1/s^2"), "damping": (20, 2, 200, "1/s"),
            "gain": (1e5, 1e4, 1e6, "1/s^2")},
        effects=shelf.mechanics(force="spring", x="out", v="pace") + shelf.sensor(of="out"),
    )  # fmt: skip
    table = np.genfromtxt(data / "SNLS80mV.csv", delimiter=",", skip_header=1)[:, :2]
    units = {"drive": "V", "out": "V"}
    files = [recorded(work, f"box_{k}", 610.35, units, table[k : k + 4096]) for k in (50_000, 60_000)]
    begin(work / "box", keep_in_memory(model), None, files[:1], validations=files[1:])
    names, errors = steps_of(specan.Study(work / "box"), most=1)
    yield Answer(
        "what does a linear oscillator lack?",
        "Wigren and Schoukens 2013, Silverbox (forgi86/pytorch-ident, MIT)",
        "a cubic spring; with 8 192 samples 6.77 -> 0.911 mV on others",
        written(names, [1e3 * e for e in errors], "mV"),
        "cubic-spring" in {name for one in names for name in one},
    )


RECORDINGS = {"cascaded_tanks": tanks, "pendulum": pendulum, "silverbox": silverbox}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path)
    parser.add_argument("--only", nargs="+", choices=RECORDINGS, help="these recordings alone")
    data, only = parser.parse_args().data, parser.parse_args().only
    with tempfile.TemporaryDirectory() as folder:
        os.environ["SPECAN_CONFIG_DIR"] = folder
        answers = [] if only else list(worm_drive_own(Path(folder)))
        if not only and data is not None and (data / "worm_drive").is_dir():
            answers += worm_drive_built_in(Path(folder), data / "worm_drive")
        if not only and data is not None and (data / "motor_octaves").is_dir():
            answers += motor_octaves(data / "motor_octaves")
        for name, ask in RECORDINGS.items():
            if data is not None and (data / name).is_dir() and name in (only or RECORDINGS):
                answers += ask(Path(folder), data / name)
    for answer in answers:
        print(f"{'right' if answer.right else 'WRONG'}: {answer.question}")
        print(f"  expected: {answer.expected}\n  found: {answer.found}\n  source: {answer.source}")
    print(f"{sum(a.right for a in answers)} of {len(answers)} right")


if __name__ == "__main__":
    main()
