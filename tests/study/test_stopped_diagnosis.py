"""A diagnosis that is interrupted: what it had found is told and kept, and the next one begins anew."""

import json
import shutil
from pathlib import Path

import pytest

from specan.models.catalogue import load_model
from specan.study.create import begin
from specan.study.diagnose import Stopped, diagnose
from specan.study.evidence.explanations import Explanations
from specan.study.selection.candidates import base_problem
from specan.study.selection.refits import Refits
from specan.study.study import STOPPED, Study
from specan_cli.main import run
from tests.study.test_coarse import RIG, recorded

BENCH = Path(__file__).parents[2] / "sample_data" / "worm_gear" / "study" / "bench"


@pytest.fixture
def bench(tmp_path):
    shutil.copytree(BENCH, tmp_path / "bench")
    table = tmp_path / "bench" / "measurement.csv"
    return begin(tmp_path / "gear", "worm-gear", tmp_path / "bench" / "rig.toml", [table]).study


def interrupt_after(monkeypatch, refits):
    """Ctrl-C while the next set of effects is refitted."""
    whole, count = Refits.fit, 0

    def fit(self, start, uses, starts, again=False):
        nonlocal count
        count += 1
        if count > refits:
            raise KeyboardInterrupt
        return whole(self, start, uses, starts, again)

    monkeypatch.setattr(Refits, "fit", fit)


def interrupt_explanations_after(monkeypatch, fits):
    """Ctrl-C while the next set of effects is fitted to a table."""
    whole, count = Explanations._add, 0

    def add(self, form, uses, starts):
        nonlocal count
        count += 1
        if count > fits:
            raise KeyboardInterrupt
        return whole(self, form, uses, starts)

    monkeypatch.setattr(Explanations, "_add", add)


def test_what_was_refitted_is_kept_and_goes_with_the_next_verdict(bench, monkeypatch):
    with monkeypatch.context() as stopping:
        interrupt_explanations_after(stopping, 3)
        with pytest.raises(Stopped):
            Study(bench.directory).diagnose()
    kept = json.loads((bench.directory / STOPPED).read_text(encoding="utf-8"))
    assert kept["finished"] is False
    assert len(kept["refitted"]) == 3
    whole = bench.diagnose()
    assert not (bench.directory / STOPPED).exists()
    (best,) = [row for row in whole.ranking if row.effects == ("windage",)]
    (early,) = [row for row in kept["refitted"] if row["effects"] == ["windage"]]
    assert early["error_after"] == pytest.approx(best.error_after, rel=1e-6)


def test_the_command_says_so_and_ends_as_interrupted(bench, monkeypatch, capsys):
    interrupt_explanations_after(monkeypatch, 2)
    monkeypatch.setattr("sys.argv", ["specan", "study", "diagnose", str(bench.directory)])
    with pytest.raises(SystemExit) as ended:
        run()
    assert ended.value.code == 130
    said = capsys.readouterr().err
    assert "Stopped before the end: no verdict. 2 sets of effects were refitted" in said
    assert "error 0.0" in said
    assert STOPPED in said


def test_progress_has_a_share_that_never_falls(bench):
    shares = []
    bench.diagnose(progress=lambda text, share=None: shares.append(share))
    told = [s for s in shares if s is not None]
    assert len(told) > 3
    assert told[0] >= 0.0
    assert told[-1] <= 1.0
    assert told == sorted(told)


@pytest.mark.long
def test_what_was_found_near_the_field_is_kept_before_a_search_begins(monkeypatch):
    model = load_model("room", RIG)
    lining = {"wall-impedance@y1.conductance": 0.4, "wall-impedance@y1.mass": 0.2}
    problem = base_problem(model, [recorded(model, ["wall-impedance@y1"], lining)])
    begun = []
    interrupt_after(monkeypatch, 1)
    with pytest.raises(KeyboardInterrupt):
        diagnose(problem, begun=begun)
    kept = Stopped(tuple(begun)).content
    assert kept["rough"]
    assert [row["effects"] for row in kept["refitted"]] == [["wall-impedance@y1"]]
    conductance = kept["refitted"][0]["parameters"]["wall-impedance@y1.conductance"]
    assert conductance["value"] == pytest.approx(0.4, abs=0.05)
