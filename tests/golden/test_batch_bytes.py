"""The batch over all of sample_data, byte for byte, on any number of processes.

When a result changes on purpose, look at the difference and renew the expected tables with
``specan batch sample_data -o tests/golden/sample_data --lines 200``.
"""

import difflib
from pathlib import Path

import pytest

EXPECTED = Path(__file__).parent / "sample_data"
NAMES = ["bands.txt", "calibration.toml", "noise.txt", "other.txt", "sine.txt", "skipped.txt"]


@pytest.mark.parametrize("jobs", [1, 2])
def test_batch_gives_the_expected_bytes(batch, tmp_path: Path, jobs: int) -> None:
    done = batch("sample_data", "-o", str(tmp_path), "--lines", "200", "--jobs", str(jobs))
    assert done.returncode == 1, done.stderr  # because of sample_data/broken
    assert "Failed: broken/no_recording.tdms: no_recording.tdms is a Git-LFS pointer" in done.stderr
    assert sorted(p.name for p in tmp_path.iterdir() if not p.name.startswith(".")) == NAMES
    for name in NAMES:
        found, expected = (folder / name for folder in (tmp_path, EXPECTED))
        if found.read_bytes() != expected.read_bytes():
            lines = [path.read_text(encoding="utf-8").splitlines() for path in (expected, found)]
            change = list(difflib.unified_diff(*lines, "expected", "found", lineterm="", n=0))
            pytest.fail(f"{name} differs in {len(change)} lines:\n" + "\n".join(change[:20]))


def test_headers_say_what_was_done_and_nothing_of_the_machine() -> None:
    for name in NAMES:
        if not name.endswith(".txt"):
            continue
        text = (EXPECTED / name).read_text(encoding="utf-8")
        header = [line for line in text.splitlines() if line.startswith("# ")]
        assert header[0].startswith("# specan ")
        assert any(line.startswith("# settings ") and '"lines":200' in line for line in header)
        assert any("calibration.toml (sha256 " in line for line in header)
        assert any("units:" in line for line in header)
        assert "-0.00\t" not in text
        assert str(EXPECTED.parents[2]) not in text
        assert "\r" not in text
