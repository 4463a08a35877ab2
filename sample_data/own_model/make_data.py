"""Make the table of pump.py and the recordings of oscillator.py, from models with an effect that the files lack.

``python sample_data/own_model/make_data.py``; the same bytes every time.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from specan import load_model
from specan.io.write_tdms import write_tdms
from specan.models.chosen_model import ChosenModel, grid, simulated_table

HERE = Path(__file__).parent
FLOWS, SPEEDS = (6, 12, 18, 24, 30, 36, 42, 48, 54, 60), (2000, 2450, 2900)
PUMP = {"cavitation.size": 0.02, "cavitation.onset": 38.0, "head.shutoff": 33.5, "loss.friction": 0.0035}
OSCILLATOR = {
    "spring.stiffness": 1.1e4, "damper.damping": 15.0, "dv.mass": 1.2, "cubic-spring.size": 1.5e6,
}  # fmt: skip
SAMPLES, RATE_HZ, NOISE_MM, FORCE_N = 2048, 500.0, 0.05, 30.0
LINES_HZ = np.arange(2.0, 40.0, 0.4)


def write_table() -> None:
    """Readings of a pump that cavitates, two of each condition; they scatter by 0.1 m."""
    model = load_model(HERE / "pump.py")
    rows = simulated_table(
        ChosenModel(model.assemble(["cavitation"]), PUMP), grid(model, {"flow": FLOWS, "speed": SPEEDS}),
        noise=0.1, repeats=2, seed=7,
    )  # fmt: skip
    with (HERE / "pump.csv").open("w", encoding="utf-8", newline="") as file:
        sheet = csv.writer(file, lineterminator="\n")
        sheet.writerow(["flow [m3/h]", "speed [1/min]", "head [m]", "repeat"])
        for flow, speed, head, repeat in zip(*rows.values(), strict=True):
            sheet.writerow([f"{flow:g}", f"{speed:g}", f"{head:.2f}", f"{repeat:g}"])


def write_recording(name: str, seed: int) -> None:
    """Force and displacement of an oscillator whose spring hardens."""
    random = np.random.default_rng(seed)
    time = np.arange(SAMPLES) / RATE_HZ
    turns = random.uniform(0, 2 * np.pi, LINES_HZ.size)
    force = np.cos(2 * np.pi * np.outer(time, LINES_HZ) + turns).sum(axis=1)
    force *= FORCE_N / np.std(force)
    found = load_model(HERE / "oscillator.py").assemble(["cubic-spring"])
    x = found.evaluate({"time": time, "force_channel": force}, OSCILLATOR)["x_measured"]
    x = x + NOISE_MM * random.standard_normal(SAMPLES)
    described = [{"unit_string": "N"}, {"unit_string": "mm"}]
    write_tdms(
        HERE / name, ["force", "x"], np.stack([force, x]), RATE_HZ, channels=described,
        group={"SamplingRate": RATE_HZ, "Description": "simulated"}, samples="float32",
    )  # fmt: skip


if __name__ == "__main__":
    write_table()
    write_recording("oscillator.tdms", 1)
    write_recording("oscillator_again.tdms", 2)
