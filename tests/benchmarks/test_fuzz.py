"""A small fixed part of the fuzz: damaged files beside a good one."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

import fuzz


@pytest.mark.parametrize("kind", ["tdms", "text", "wav"])
def test_no_damaged_file_costs_another_one_its_result(tmp_path, kind) -> None:
    total, faults = fuzz.fuzz(kind, 20, 7, 20, tmp_path)
    assert faults == []
    assert sum(total.values()) >= 21
    assert total["failed"] > 0


def test_the_fuzz_sees_a_batch_that_ends(tmp_path, monkeypatch) -> None:
    from specan.analysis.batch import run

    def ends(*_, **__):
        raise MemoryError

    good = fuzz.good_recordings()["noise.tdms"]
    monkeypatch.setattr(run, "analyse_unchanged", ends)
    faults: list[str] = []
    fuzz.run_together([], good, tmp_path, faults.append)
    assert faults == ["the batch ended: MemoryError: "]
