"""Files that change or vanish while they are read; what a result hangs on."""

from pathlib import Path

import pytest

from specan.analysis.batch import one_file
from specan.analysis.batch.inputs import Input
from specan.analysis.batch.one_file import Task, analyse_file, analyse_unchanged
from specan.analysis.batch.settings import BatchSettings
from specan.analysis.batch.store import BLOCK, BLOCKS, Store, identify, program_identity
from specan.io.tdms_headers import metadata_of
from truth.rig import box_rig, sine_take
from truth.rig_files import write_tdms


@pytest.fixture
def entry(tmp_path: Path) -> Input:
    rig = box_rig()
    path = tmp_path / "a.tdms"
    write_tdms(path, rig, sine_take(rig, 250.0, 1.0, 4000, 8000.0, 1).only(("Mic 1", "Vibrometer")))
    return Input(str(path), "a.tdms", str(tmp_path), path.stat().st_size)


def analyse(entry: Input, monkeypatch: pytest.MonkeyPatch, meanwhile) -> one_file.Outcome:
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
    outcome = analyse(entry, monkeypatch, meanwhile)
    assert outcome.result.kind == "failed"
    assert outcome.result.reason.startswith(reason)
    assert outcome.identity is None


def test_a_file_that_stays_gives_its_result(entry: Input, monkeypatch) -> None:
    outcome = analyse(entry, monkeypatch, lambda path: None)
    assert outcome.result.kind == "done"
    assert outcome.identity is not None
    assert outcome.identity.untouched(entry.path)


def test_a_failure_is_not_kept(tmp_path: Path) -> None:
    (tmp_path / "b.tdms").write_bytes(b"no recording")
    outcome = analyse_unchanged(
        Task(Input(str(tmp_path / "b.tdms"), "b.tdms", str(tmp_path), 12), BatchSettings())
    )
    assert (outcome.result.kind, outcome.identity) == ("failed", None)


def test_a_kept_result_is_the_result(entry: Input, tmp_path: Path) -> None:
    outcome = analyse_unchanged(Task(entry, BatchSettings()))
    assert outcome.identity is not None
    store = Store(tmp_path / "store")
    kept = store.put(outcome.result, outcome.identity, "context")
    again = Store(tmp_path / "store").find("a.tdms")
    assert repr(again) == repr(kept)
    assert {table: kept.lines(table) for table in kept.places} == dict(outcome.result.blocks)
    # Every digit of the tone table, NaN and units included.
    assert repr(kept.result.tones) == repr(outcome.result.tones)
    assert kept.result.about == outcome.result.about
    assert kept.identity == outcome.identity
    assert store.find("b.tdms") is None


@pytest.mark.parametrize("place", ["first", "inside", "last"])
def test_the_spread_hash_sees_its_blocks(tmp_path: Path, place: str) -> None:
    path = tmp_path / "x.wav"
    size = 3 * BLOCK * BLOCKS
    path.write_bytes(bytes(size))
    before = identify(str(path))
    at = {"first": 0, "inside": (size - BLOCK) * 40 // (BLOCKS - 1) + 5, "last": size - 1}[place]
    with path.open("r+b") as file:
        file.seek(at)
        file.write(b"\x01")
    assert identify(str(path)).digest != before.digest


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
