"""Files that change or vanish while they are read; what a result hangs on."""

import os
from dataclasses import replace
from pathlib import Path

import pytest

from specan.analysis.batch import one_file
from specan.analysis.batch.inputs import Input
from specan.analysis.batch.one_file import Task, analyse_file, analyse_unchanged
from specan.analysis.batch.result import FileResult
from specan.analysis.batch.settings import BatchSettings
from specan.analysis.batch.store import Store, keys_of, program_identity
from specan.io.tdms_headers import metadata_of
from truth.rig import box_rig, sine_take
from truth.rig_files import write_tdms


@pytest.fixture
def entry(tmp_path: Path) -> Input:
    rig = box_rig()
    path = tmp_path / "a.tdms"
    write_tdms(path, rig, sine_take(rig, 250.0, 1.0, 4000, 8000.0, 1).only(("Mic 1", "Vibrometer")))
    return Input(str(path), "a.tdms", str(tmp_path), path.stat().st_size)


def analyse(entry: Input, monkeypatch: pytest.MonkeyPatch, meanwhile) -> FileResult:
    def slow(*args):
        result = analyse_file(*args)
        meanwhile(Path(entry.path))
        return result

    monkeypatch.setattr(one_file, "analyse_file", slow)
    return analyse_unchanged(Task(entry, BatchSettings()))


def grow(path: Path) -> None:
    with path.open("ab") as file:
        file.write(b"TDSm")


@pytest.mark.parametrize(
    ("meanwhile", "reason"),
    [(grow, "it changed while it was read (from "), (Path.unlink, "it vanished while it was read")],
)
def test_a_file_that_changes_gives_no_result(entry: Input, monkeypatch, meanwhile, reason: str) -> None:
    found = analyse(entry, monkeypatch, meanwhile)
    assert found.kind == "failed"
    assert found.reason.startswith(reason)


def test_a_file_that_stays_gives_its_result(entry: Input, monkeypatch) -> None:
    assert analyse(entry, monkeypatch, lambda path: None).kind == "done"


def test_a_kept_result_is_the_result(entry: Input, tmp_path: Path) -> None:
    result = analyse_unchanged(Task(entry, BatchSettings()))
    store = Store(tmp_path / "store")
    kept = store.put(result, "a")
    assert repr(Store(tmp_path / "store").find("a")) == repr(kept)
    assert {table: kept.lines(table) for table in kept.places} == dict(result.blocks)
    # Every digit of the tone table, NaN and units included.
    assert repr(kept.tones) == repr(result.tones)
    assert kept.about == result.about
    assert store.find("b") is None


def test_a_result_is_known_by_all_that_it_was_made_from(entry: Input, tmp_path: Path) -> None:
    names = {keys_of(BatchSettings())(entry), keys_of(BatchSettings(reference="Mic 1"))(entry)}
    names.add(keys_of(BatchSettings())(replace(entry, label="b.tdms")))
    (tmp_path / "calibration.toml").write_text("schema = 1\n")
    calibrated = replace(entry, calibration=str(tmp_path / "calibration.toml"))
    names.add(keys_of(BatchSettings())(calibrated))
    (tmp_path / "calibration.toml").write_text("schema = 1 \n")
    names.add(keys_of(BatchSettings())(calibrated))
    os.utime(entry.path, ns=(0, 0))
    names.add(keys_of(BatchSettings())(entry))
    assert len(names) == 6
    assert keys_of(BatchSettings())(entry) in names


def test_the_metadata_of_every_segment_counts(tmp_path: Path) -> None:
    rig = box_rig()
    path = tmp_path / "a.tdms"
    write_tdms(path, rig, sine_take(rig, 250.0, 1.0, 40_000, 8000.0, 1).only(("Mic 1", "Vibrometer")))
    parts = list(metadata_of(path))
    assert len(parts) > 1
    assert b"Vibrometer" in parts[0]
    assert sum(map(len, parts)) < path.stat().st_size / 10
    path.write_bytes(path.read_bytes()[:-10])  # a cut in the samples, not in what describes them
    assert list(metadata_of(path)) == parts


def test_the_program_is_named_with_its_libraries() -> None:
    import numpy

    assert numpy.__version__ in program_identity()
