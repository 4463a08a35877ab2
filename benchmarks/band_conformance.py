"""IEC 61260-1 class 1 of every band at every breakpoint, with tones through the public function.

``python benchmarks/band_conformance.py [--rate 51200 --rate 102400]`` takes some minutes a rate. The test suite
does the same with a part of the tones; the tones and the check are taken from there.
"""

from __future__ import annotations

import argparse
import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np

from specan.divisions import FRACTIONS
from specan.dsp import bands
from specan.dsp.bands import BREAKPOINTS, breakpoint_ratio

TEST = Path(__file__).parents[1] / "tests" / "reference" / "test_iec_61260_1.py"


def checks() -> ModuleType:
    spec = importlib.util.spec_from_file_location("class_1_checks", TEST)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rate", type=float, action="append", help="Sampling rate in Hz; repeatable.")
    check = checks()
    print("| rate Hz | fraction | bands | tones | smallest margin dB |")
    print("|---|---|---|---|---|")
    for rate in parser.parse_args().rate or [51200.0, 102400.0]:
        for fraction in FRACTIONS:
            index = bands.band_range(check.LOW, check.HIGH, fraction)
            mid = bands.mid_frequencies(index, fraction)[:, None]
            ratio = breakpoint_ratio(BREAKPOINTS, fraction)
            tones = np.concatenate([mid * ratio, mid / ratio[1:]], axis=1)
            bandwidth = np.broadcast_to(mid * check.RELATIVE_WIDTH[fraction], tones.shape)
            measurable = tones < 0.49 * rate
            excess = check.worst_excess(tones[measurable], bandwidth[measurable], rate, (fraction,))
            print(
                f"| {rate:g} | 1/{fraction} | {index.size} | {measurable.sum()} | {-excess:.2f} |", flush=True
            )


if __name__ == "__main__":
    main()
