"""Start-up time counts: no verb loads a large library for a small part of it."""

import subprocess
import sys
from pathlib import Path

import pytest

NOISE = next(Path("sample_data/recordings/noise").glob("*.tdms")).as_posix()
GEAR = "sample_data/worm_gear/study/bench"
LARGE = ["scipy.signal", "scipy.stats", "acoustics", "pandas", "matplotlib", "pint", "bokeh"]
SCIPY = ["scipy.optimize", "scipy.interpolate", "scipy.linalg", "scipy.sparse"]
VERBS = [
    (["--help"], [*LARGE, *SCIPY, "numpy", "pydantic"]),
    (["octave", NOISE], [*LARGE, *SCIPY]),
    (["octave", NOISE, "--averaging", "fast"], [*LARGE, *SCIPY]),
    (["rms", NOISE], [*LARGE, *SCIPY]),
    (["info", NOISE], [*LARGE, *SCIPY]),
    (["fft", NOISE], LARGE),
    (["frf", NOISE], [*LARGE, *SCIPY]),
    (
        [
            "study",
            "new",
            "{place}",
            "--model",
            "worm-gear",
            "--rig",
            f"{GEAR}/rig.toml",
            "--measurement",
            f"{GEAR}/measurement.csv",
        ],
        [name for name in LARGE if name != "pandas"],  # tables are data frames
    ),
    (
        ["batch", "sample_data/recordings/noise", "-o", "{place}", "--jobs", "1"],
        [*LARGE, *SCIPY, "multiprocessing", "specan.analysis.calibration"],
    ),
]
CODE = """
import sys
from specan_cli.main import run
try:
    run()
except SystemExit as end:
    code = end.code
print("LOADED", *sys.modules)
sys.exit(code)
"""


@pytest.mark.parametrize(("verb", "unwanted"), VERBS, ids=lambda value: value[0])
def test_a_verb_loads_no_library_that_it_does_not_need(verb, unwanted, tmp_path) -> None:
    words = [word.format(place=tmp_path / "results") for word in verb]
    done = subprocess.run([sys.executable, "-c", CODE, *words], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    loaded = done.stdout.rpartition("LOADED ")[2].split()
    assert "specan_cli.main" in loaded
    assert [name for name in unwanted if name in loaded] == []
