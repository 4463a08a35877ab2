"""A small fixed part of the fuzz: damaged files beside a good one."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

import fuzz


@pytest.mark.parametrize(
    "kind",
    [pytest.param(k, marks=pytest.mark.long if k == "mat" else ()) for k in fuzz.KINDS],  # a process a file
)
def test_no_damaged_file_costs_another_one_its_result(tmp_path, kind) -> None:
    total, faults = fuzz.fuzz(kind, 20, 7, 20, tmp_path)
    assert faults == []
    assert sum(total.values()) >= 21
    assert total["failed"] > 0


@pytest.mark.parametrize("verb", fuzz.VERBS)
def test_no_bad_channel_costs_another_one_its_result(verb) -> None:
    every = fuzz.bad_channels()
    assert (
        fuzz.beside_bad_channels(verb, {name: every[name] for name in ("constant", "one NaN", "2 samples")})
        == []
    )


def test_every_verb_answers_or_says_what_is_wrong(tmp_path) -> None:
    for kind in ("tdms", "wav"):
        for number, files in enumerate(fuzz.mutants(kind, 4, 11)):
            assert fuzz.through_verbs(files, tmp_path / f"{kind}{number}") == []


@pytest.mark.parametrize("rate", fuzz.RATES)
def test_conformance_says_which_rates_it_takes(rate) -> None:
    assert fuzz.by_command("conformance", "--sampling-rate", rate) == []


def test_the_fuzz_sees_a_batch_that_ends(tmp_path, monkeypatch) -> None:
    from specan.analysis.batch import run

    def ends(*_, **__):
        raise MemoryError

    good = fuzz.good_recordings()["noise.tdms"]
    monkeypatch.setattr(run, "analyse_unchanged", ends)
    faults: list[str] = []
    fuzz.run_together([], good, tmp_path, faults.append)
    assert faults == ["the batch ended: MemoryError: "]
