"""A diagnosis is computed once; what is stale, damaged or of another program is never believed."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from specan.study import diagnose as module
from specan.study import history
from specan.study.create import begin
from specan.study.history import FOLDER, MOST_FILES, KeptResults
from specan.study.study import Study

BENCH = Path(__file__).parents[2] / "sample_data" / "worm_gear" / "study" / "bench"
FEW = Path(__file__).parent / "few.py"


@pytest.fixture(scope="module")
def diagnosed(tmp_path_factory):
    """A study that was diagnosed, and its diagnosis."""
    place = tmp_path_factory.mktemp("kept") / "gear"
    begin(place, FEW, BENCH / "rig.toml", [BENCH / "measurement.csv"], hold_out=["torque=50"])
    return place, Study(place).diagnose()


@pytest.fixture(autouse=True)
def own(diagnosed, computed_once, monkeypatch):
    """From here on each study keeps its own results."""
    for name, function in computed_once.items():
        monkeypatch.setattr(KeptResults, name, function)
    monkeypatch.setattr(history, "MOST_FILES", MOST_FILES)


@pytest.fixture
def study(diagnosed, tmp_path):
    """A copy of its directory."""
    return Path(shutil.copytree(diagnosed[0], tmp_path / "gear"))


@pytest.fixture
def computed(diagnosed, monkeypatch):
    """Counts the diagnoses that would be made."""
    calls = []

    def counting(*args, **options):
        calls.append(1)
        return diagnosed[1]

    monkeypatch.setattr(module, "diagnose", counting)
    return calls


def kept_diagnosis(directory: Path) -> Path:
    (found,) = (directory / FOLDER).glob("diagnosis-*.json")
    return found


@pytest.mark.long
def test_the_same_state_is_computed_once(diagnosed, study, computed):
    found = Study(study).diagnose()
    assert computed == []
    assert found == diagnosed[1]
    assert found.to_dict() == diagnosed[1].to_dict()


def test_a_fit_comes_back_to_the_last_bit(study):
    kept = Study(study).best
    (path,) = (study / FOLDER).glob("fit-*.json")
    path.unlink()
    fresh = Study(study).best
    for name, value in vars(fresh).items():
        np.testing.assert_equal(getattr(kept, name), value)
    assert type(kept.names[0]) is type(fresh.names[0])


def rig(directory: Path) -> None:
    # Beside the study: a copy of its own, with one more line.
    text = (directory / "study.toml").read_text(encoding="utf-8")
    old = next(line for line in text.splitlines() if line.startswith("rig = "))
    source = (directory / json.loads(old.removeprefix("rig = "))).resolve()
    source = source if source.exists() else BENCH / "rig.toml"
    (directory / "rig.toml").write_text(
        source.read_text(encoding="utf-8") + "\n# another\n", encoding="utf-8"
    )
    (directory / "study.toml").write_text(text.replace(old, 'rig = "rig.toml"'), encoding="utf-8")


def hold_out_less(directory: Path) -> None:
    path = directory / "study.toml"
    path.write_text(path.read_text(encoding="utf-8").replace("torque=50", "torque=80"), encoding="utf-8")


def cut_off(directory: Path) -> None:
    path = kept_diagnosis(directory)
    path.write_bytes(path.read_bytes()[:-200])


def another_verdict(directory: Path) -> None:
    path = kept_diagnosis(directory)
    text = path.read_text(encoding="utf-8")
    assert "windage" in text
    path.write_text(text.replace("windage", "starvation"), encoding="utf-8")


def of_another_study(directory: Path) -> None:
    path = kept_diagnosis(directory)
    envelope = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps(envelope | {"key": "0" * 64}), encoding="utf-8")


@pytest.mark.parametrize("change", [rig, hold_out_less, cut_off, another_verdict, of_another_study])
def test_what_was_changed_is_not_believed(study, computed, change):
    change(study)
    Study(study).diagnose()
    assert computed == [1]


def test_changed_data_are_computed_anew(study, computed):
    text = (study / "study.toml").read_text(encoding="utf-8")
    old = next(line for line in text.splitlines() if line.startswith("file = "))
    data = (BENCH / "measurement.csv").read_text(encoding="utf-8").splitlines()
    (study / "measurement.csv").write_text("\n".join(data[:-1]) + "\n", encoding="utf-8")
    (study / "study.toml").write_text(text.replace(old, 'file = "measurement.csv"'), encoding="utf-8")
    Study(study, accept_changes=True).diagnose()
    assert computed == [1]


def test_another_program_computes_anew(study, computed, monkeypatch):
    monkeypatch.setattr(history, "_programs", lambda: {"specan": "another"})
    Study(study).diagnose()
    assert computed == [1]


def test_the_oldest_go(tmp_path):
    for number in range(MOST_FILES + 5):
        KeptResults(tmp_path, {"n": number}).keep("number", float(number))
    assert len(list((tmp_path / FOLDER).iterdir())) == MOST_FILES


def test_nothing_is_kept_where_nothing_can_be_written(tmp_path):
    (tmp_path / FOLDER).write_text("a file in the place of the directory")
    kept = KeptResults(tmp_path, {})
    assert kept.keep("number", 1.0) == 1.0
    assert kept.find("number", float) is None
