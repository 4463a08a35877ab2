"""Measurements that nobody of this project made, with the answer that was published, and what specan says.

    python benchmarks/real.py [--data DIRECTORY]

The worm drive stands in ``sample_data``. DIRECTORY may hold what is not shipped: ``worm_drive/lifting.csv`` with
``worm_drive/rig_for_worm_gear.toml`` (the same drive as a table for the built-in worm gear; bearings and pitch
diameter are guesses) and ``motor_octaves`` (Eomys/MoSQITo, validations/sound_level_meter/noct_spectrum, Apache-2.0). A
wrong name is never acceptable; an honest doubt is.
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
    from specan.study.create import begin

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
    """The built-in worm gear on the lifting half: it can imitate the rise only with impossible values."""
    study = specan.Study.new(
        work / "gear",
        "worm-gear",
        data / "lifting.csv",
        rig=data / "rig_for_worm_gear.toml",
        hold_out="speed_rpm=3.972,8,60",
    )
    found = study.diagnose()
    said = f"{found.verdict}: {found.reason}"
    yield Answer(
        "does the built-in worm gear fit?",
        DRIVE,
        "only with a coefficient of friction far above what is known",
        said,
        found.verdict in ("fits-only-if", "unknown-effect") or "known" in said,
    )


def motor_octaves(data: Path) -> Iterator[Answer]:
    """Third octaves beside an analyser of another maker."""
    lines = (
        (data / "electric_motor_vibration_3oct_oros.txt")
        .read_text(encoding="utf-8", errors="replace")
        .splitlines()
    )
    rows = np.array([[float(cell) for cell in line.split()] for line in lines[2:] if line.strip()])
    found = specan.octave(data / "electric_motor_vibration_signal.uff", fmin=25.0)
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path)
    data = parser.parse_args().data
    with tempfile.TemporaryDirectory() as folder:
        os.environ["SPECAN_CONFIG_DIR"] = folder
        answers = list(worm_drive_own(Path(folder)))
        if data is not None and (data / "worm_drive").is_dir():
            answers += worm_drive_built_in(Path(folder), data / "worm_drive")
        if data is not None and (data / "motor_octaves").is_dir():
            answers += motor_octaves(data / "motor_octaves")
    for answer in answers:
        print(f"{'right' if answer.right else 'WRONG'}: {answer.question}")
        print(f"  expected: {answer.expected}\n  found: {answer.found}\n  source: {answer.source}")
    print(f"{sum(a.right for a in answers)} of {len(answers)} right")


if __name__ == "__main__":
    main()
