"""How often the 95 % intervals of a calibration hold the truth, in simulated campaigns.

    python benchmarks/calibration_coverage.py --campaigns 300

Each campaign draws the calibrator's true level, how every microphone sits in every insertion, and white noise;
`specan.analysis.calibration` then gives sensitivities and phases with standard uncertainties u, and an interval
holds the truth where the error is within 1.96 u.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from specan.analysis.calibration import calibrate
from specan.analysis.insertion import CalibrationSettings
from specan.data.recording import ArraySource, Channel, Recording

RATE, HZ, SAMPLES, AMPLITUDE_V = 8000.0, 1000.0, 2400, 0.07
Plan = Sequence[tuple[int, ...]]
STAR: Plan = [(1, 2, 3, 4, 5, 6), (1, 7, 8, 9, 10, 11)]  # nothing but Mic 1 is inserted again
TWICE: Plan = [(1, 2, 3, 4), (3, 4, 5, 6), (5, 6, 1, 2), (1, 3, 5, 7), (2, 4, 6, 8)]


@dataclass(frozen=True)
class Campaign:
    """Recordings of the insertions, and the truth in mV/Pa and degrees by number of the microphone."""

    recordings: list[Recording]
    sensitivity: dict[str, float]
    phase_deg: dict[str, float]


@dataclass(frozen=True)
class Coverage:
    """Shares of intervals that hold the truth, and the mean standard uncertainties."""

    sensitivity: float
    phase: float
    u_percent: float
    u_deg: float


def recording(
    rng: np.random.Generator,
    label: str,
    names: Sequence[str],
    phase_deg: Sequence[float],
    gain: Sequence[float],
    noise: float,
) -> Recording:
    """Microphones in a calibrator; `noise` in V on tones of 0.07 V."""
    time = np.arange(SAMPLES) / RATE
    start = rng.uniform(0, 2 * np.pi)
    volts = [
        g * AMPLITUDE_V * np.cos(2 * np.pi * HZ * 1.00002 * time + start + math.radians(p))
        + noise * AMPLITUDE_V * rng.standard_normal(SAMPLES)
        for p, g in zip(phase_deg, gain, strict=True)
    ]
    channels = tuple(Channel(n, "g", "V", "microphone", RATE, SAMPLES, raw_unit="V") for n in names)
    stated = {"g": {"CalibratorLevel_dB": 94.0, "CalibratorFrequency_Hz": HZ}}
    return Recording(label, channels, ArraySource(volts), group_properties=stated)


def campaign(
    rng: np.random.Generator,
    plan: Plan,
    *,
    seat_deg: float,
    seat_dB: float,
    noise: float,
    level_dB: float = 0.0,
) -> Campaign:
    """Insertions of microphones of unequal sensitivity and phase; `noise` relative to the tone.

    `seat_deg` and `seat_dB` are standard deviations of one microphone in one insertion, `level_dB` that of the
    calibrator's true level from 94 dB.
    """
    names = [f"Mic {m}" for m in sorted({m for mics in plan for m in mics})]
    pascals = math.sqrt(2) * 20e-6 * 10 ** (94 / 20)
    gain = dict(zip(names, 10 ** (rng.normal(0, 0.3, len(names)) / 20), strict=True))
    phase = dict(zip(names, rng.normal(0, 2.0, len(names)), strict=True))
    level = 10 ** (rng.normal(0, level_dB) / 20)
    recordings = []
    for k, mics in enumerate(plan):
        inserted = [f"Mic {m}" for m in mics]
        recordings.append(
            recording(
                rng,
                f"insertion {k}",
                inserted,
                [phase[n] + rng.normal(0, seat_deg) for n in inserted],
                [gain[n] * level * 10 ** (rng.normal(0, seat_dB) / 20) for n in inserted],
                noise,
            )
        )
    first = phase[names[0]]
    return Campaign(
        recordings,
        {n: 1000 * AMPLITUDE_V * g / pascals for n, g in gain.items()},
        {n: p - first for n, p in phase.items()},
    )


def coverage(
    campaigns: int,
    plan: Plan,
    *,
    seat_deg: float,
    seat_dB: float,
    noise: float,
    level_dB: float = 0.1,
    declared: tuple[float, float] | None = None,
    seed: int = 1,
) -> Coverage:
    """Run campaigns and count; `declared` (dB, degrees) replaces the default repeatability."""
    given = {} if declared is None else {"u_insertion_dB": declared[0], "u_insertion_deg": declared[1]}
    # A level that is known exactly is also taken as known.
    settings = CalibrationSettings(u_level_dB=level_dB, **given)
    rng = np.random.default_rng(seed)
    held: dict[str, list[bool]] = {"sensitivity": [], "phase": []}
    u: dict[str, list[float]] = {"sensitivity": [], "phase": []}
    for _ in range(campaigns):
        drawn = campaign(rng, plan, seat_deg=seat_deg, seat_dB=seat_dB, noise=noise, level_dB=level_dB)
        for c in calibrate(drawn.recordings, settings).channels:
            true = drawn.sensitivity[c.channel]
            error = 100 * (c.sensitivity / true - 1)
            held["sensitivity"].append(abs(error) <= 1.96 * c.u_sensitivity_percent)
            u["sensitivity"].append(c.u_sensitivity_percent)
            if c.phase is not None and c.channel != c.phase.group:
                off = c.phase.phase_deg[0] - drawn.phase_deg[c.channel]
                held["phase"].append(abs(off) <= 1.96 * c.phase.u_phase_deg[0])
                u["phase"].append(c.phase.u_phase_deg[0])
    return Coverage(
        float(np.mean(held["sensitivity"])),
        float(np.mean(held["phase"])),
        float(np.mean(u["sensitivity"])),
        float(np.mean(u["phase"])),
    )


def main() -> None:
    """Print a table of coverages."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--campaigns", type=int, default=300)
    count = parser.parse_args().campaigns
    five = [(1, *range(first, first + 5)) for first in range(2, 22, 5)] + [(1, 22, 23, 24)]
    cases = {
        "five insertions, shared Mic 1, repeat as declared": (five, 0.12 / math.sqrt(2), 0.05, 1e-3, None),
        "five insertions, 0.1 deg between microphones, 0.5 %": (five, 0.1 / math.sqrt(2), 0.0433, 1e-3, None),
        "five insertions, 0.1 deg each microphone, 0.5 %": (five, 0.1, 0.0433, 1e-3, None),
        "five insertions, no repeatability noise, none declared": (five, 0.0, 0.0, 1e-2, (0.0, 0.0)),
        "every microphone twice, 0.05 deg, 0.02 dB": (TWICE, 0.05, 0.02, 1e-3, None),
        "every microphone twice, 0.5 deg, 0.1 dB": (TWICE, 0.5, 0.1, 1e-3, None),
        "every microphone twice, no repeatability noise": (TWICE, 0.0, 0.0, 1e-2, None),
    }
    print(f"{'case':56} {'sensitivity':>11} {'phase':>6} {'u %':>6} {'u deg':>7}")
    for name, (plan, deg, dB, noise, declared) in cases.items():
        c = coverage(count, plan, seat_deg=deg, seat_dB=dB, noise=noise, declared=declared)
        print(f"{name:56} {c.sensitivity:11.3f} {c.phase:6.3f} {c.u_percent:6.2f} {c.u_deg:7.4f}")


if __name__ == "__main__":
    main()
