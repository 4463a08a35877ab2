"""Make the sample recordings and the truth behind them: ``python sample_data/make_sample_data.py``.

A rig of 24 microphones, a laser vibrometer on a loudspeaker and a generator channel, simulated by
`truth.rig`; the same bytes every time.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))

from truth.rig import (
    Rig,
    Take,
    box_rig,
    calibrator_take,
    knock_take,
    noise_take,
    pressure_per_velocity,
    sine_take,
)
from truth.rig_files import write_tdms
from truth.three_masses import ThreeMasses, as_text, simulate

RATE = 8000.0
FEW = ("Mic 1", "Mic 8", "Mic 15", "Mic 22", "Vibrometer", "Generator")
SINES = {125.3: 1.0, 250.7: 1.0, 500.0: 1.5, 1000.9: 2.0}  # frequency in Hz: generator amplitude in V
# Five insertions share microphone 1; the last has room for two microphones that were there before.
INSERTIONS = [(1, 2, 3, 4, 5, 6), (1, 7, 8, 9, 10, 11), (1, 12, 13, 14, 15, 16), (1, 17, 18, 19, 20, 21),
              (1, 22, 23, 24, 2, 3)]  # fmt: skip
FOUR_GROUPS = [tuple(range(first, first + 6)) for first in (1, 7, 13, 19)]
NO_RECORDING = """version https://git-lfs.github.com/spec/v1
oid sha256:4d7a214614ab2935c943f9e0ff69d22eadbb8f32b1258daaa5e2ca24d17e2393
size 33280000
"""


def takes(rig: Rig) -> dict[str, Take]:
    """Every good recording by its path, without the suffix."""
    made = {}
    for number, mics in enumerate(INSERTIONS, 1):
        made[f"calibration/insertion_{number}"] = calibrator_take(rig, mics, 40000, RATE, 100 + number)
    for number, mics in enumerate(FOUR_GROUPS, 1):
        made[f"calibration_four_groups/group_{number}"] = calibrator_take(
            rig, mics, 12000, RATE, 200 + number
        )
    for number, (frequency, volts) in enumerate(SINES.items()):
        made[f"sine/sine_{frequency:06.1f}Hz"] = sine_take(rig, frequency, volts, 4000, RATE, 300 + number)
    made["noise/noise_24_microphones"] = noise_take(rig, 2.0, 28000, RATE, 400)
    made["noise/noise_4_microphones_float32"] = noise_take(rig, 2.0, 20000, RATE, 401).only(FEW)
    made["knock"] = knock_take(rig, 4.0, 8000, RATE, 500).only(FEW)
    return made


def write_recordings(out: Path, rig: Rig) -> None:
    """Good recordings below `recordings`, bad ones below `broken`."""
    for name, take in takes(rig).items():
        bare = name.endswith("float32")
        write_tdms(
            out / "recordings" / f"{name}.tdms",
            rig,
            take,
            description="" if bare else DESCRIPTIONS[name.split("/")[0]],
            samples="float32" if bare else "int32",
            with_excitation=not bare,
        )
    cut = out / "broken" / "truncated.tdms"
    take = sine_take(rig, 333.3, 1.0, 12000, RATE, 600).only(FEW)
    write_tdms(cut, rig, take, description="The power failed in the second second")
    cut.write_bytes(cut.read_bytes()[:-40_000])
    (out / "broken" / "no_recording.tdms").write_bytes(NO_RECORDING.encode())


DESCRIPTIONS = {
    "calibration": "Calibrator with the six-way adapter, five insertions that share microphone 1",
    "calibration_four_groups": "Calibrator with the six-way adapter, four groups that share no microphone",
    "sine": "Simulated box, stepped sine",
    "noise": "Simulated box, Gaussian noise, all microphones",
    "knock": "Simulated box, a knock: neither sine nor noise",
}


def write_truth(out: Path, rig: Rig) -> None:
    """What the analyses should find: microphones, tones, transfer function, realised RMS."""
    names = [f"Mic {m}" for m in range(1, rig.n_mics + 1)]
    write_csv(
        out / "microphones.csv",
        ["channel", "x_m", "y_m", "z_m", "sensitivity_mV_per_Pa", "phase_deg_at_1kHz"],
        [
            [name, *place, f"{1000 * s:.6f}", phase]
            for name, place, s, phase in zip(
                names, rig.mic_position_m, rig.sensitivity_V_per_Pa, rig.phase_deg, strict=True
            )
        ],
    )
    tones, realised = [], []
    for name, take in takes(rig).items():
        if name.startswith("calibration"):
            continue
        rms = np.sqrt(np.mean(take.truth**2, axis=1))
        realised += [[f"{name}.tdms", c, f"{value:.9e}"] for c, value in zip(take.names, rms, strict=True)]
        if name.startswith("sine"):
            tones += sine_truth(f"{name}.tdms", rig, take)
    write_csv(out / "realised_rms.csv", ["file", "channel", "rms"], realised)
    write_csv(out / "sine.csv", ["file", "channel", "frequency_hz", "magnitude", "phase_deg"], tones)
    f = np.round(np.geomspace(60.0, 3000.0, 60), 2)
    response = pressure_per_velocity(rig, f)
    write_csv(
        out / "transfer_function.csv",
        ["channel", "frequency_hz", "magnitude_Pa_s_per_m", "phase_deg"],
        [
            [name, fi, f"{abs(h):.9e}", f"{np.degrees(np.angle(h)):.6f}"]
            for name, row in zip(names, response, strict=True)
            for fi, h in zip(f, row, strict=True)
        ],
    )


def sine_truth(file: str, rig: Rig, take: Take) -> list[list[object]]:
    """Sound pressure over diaphragm velocity at the tone."""
    frequency = float(str(take.properties["ExcitationFrequency_Hz"]))
    response = pressure_per_velocity(rig, np.array([frequency]))[:, 0]
    return [
        [file, name, frequency, f"{abs(h):.9e}", f"{np.degrees(np.angle(h)):.6f}"]
        for name, h in zip(take.names, response, strict=False)  # the microphones come first
    ]


def write_csv(path: Path, header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """A table with plain line ends."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(rows)


def write_two_mass(out: Path) -> None:
    """Two recordings of two masses, with a small tuned mass on the second that their model does not know."""
    for name, seed in (("run", 1), ("again", 2)):
        text = as_text(simulate(ThreeMasses(), seed=seed))
        (out / f"{name}.csv").write_text(text, encoding="utf-8", newline="\n")


def main(out: Path) -> None:
    """Write everything below `out`."""
    write_two_mass(out / "two_mass")
    rig = box_rig()
    write_recordings(out, rig)
    write_truth(out / "truth", rig)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
