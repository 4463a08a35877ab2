"""Changes of a study: one at a time, whole or not at all; a broken effect file costs nothing."""

import contextlib
import json
import os
import shutil
import subprocess
import sys
import tracemalloc

import numpy as np
import pytest

from specan.errors import RequestError
from specan.study import history
from specan.study.create import begin
from specan.study.edit import _on_errors, add_effect, drop_effect, drop_effect_file
from specan.study.history import LOCK, PENDING, History, Step, changing, commit, recover
from specan.study.observation.window_leakage import fold
from specan.study.study import Study
from specan.study.study_file import read_study_file

OWN = '''import numpy as np

from specan.models import Parameter, effect


@effect("my-drag", adds_to="no_load_loss", neutral={{"torque": 0.0}})
def my_drag(worm_speed, *, torque=Parameter(0.1, "N*m", min=0.0, max=1.0)):
    """A brake that drags."""
    return {body}
'''


@pytest.fixture(autouse=True)
def own_machine(tmp_path, monkeypatch):
    monkeypatch.setenv("SPECAN_CONFIG_DIR", str(tmp_path / "config"))


@pytest.fixture(scope="module")
def begun(tables, tmp_path_factory):
    place = tmp_path_factory.mktemp("begun")
    table = tables.write_table(place / "table.csv", tables.bench(effects={"seal-drag.torque": 0.3}))
    rig = tables.write_rig(place / "rig.toml", torque_setting_percent=5.0)
    begin(place / "study", "worm-gear", rig, [table])
    return place


@pytest.fixture
def study(begun, tmp_path):
    shutil.copytree(begun, tmp_path, dirs_exist_ok=True)
    return Study(tmp_path / "study")


def files_of(directory):
    return {p.name: p.read_bytes() for p in directory.iterdir() if p.is_file()}


def effects_of(directory):
    return [str(e.use) for e in read_study_file(directory).effect if e.role == "model"]


def consistent(directory):
    """Study file and history tell of the same model, and every step has its own number."""
    steps = History(directory).steps
    assert [s.step for s in steps] == list(range(len(steps)))
    assert list(steps[-1].model_effects) == effects_of(directory)


class Crash(BaseException):
    """The process ends here."""


@pytest.mark.parametrize("after", [1, 4, 7, *(pytest.param(n, marks=pytest.mark.long) for n in (2, 3, 5, 6))])
def test_a_process_that_ends_in_the_middle_leaves_either_state(study, monkeypatch, after):
    """Every call that reaches the disk is counted; the process ends before the one with the given number."""
    before = files_of(study.directory)
    left = after

    def counted(call):
        def wrapper(*given, **more):
            nonlocal left
            left -= 1
            if left == 0:
                raise Crash
            return call(*given, **more)

        return wrapper

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", counted(os.fsync))
        patch.setattr(type(study.directory), "replace", counted(type(study.directory).replace))
        patch.setattr(type(study.directory), "unlink", counted(type(study.directory).unlink))
        with contextlib.suppress(Crash):
            add_effect(study, "seal-drag")
    again = Study(study.directory)
    consistent(study.directory)
    if "seal-drag" not in again.model_effects:
        now = files_of(study.directory)
        assert {n: now[n] for n in ("study.toml", "history.jsonl")} == {
            n: before[n] for n in ("study.toml", "history.jsonl")
        }
        again = add_effect(again, "seal-drag").study
    assert "seal-drag" in again.model_effects
    assert not (study.directory / PENDING).exists()
    consistent(study.directory)


def test_finishing_twice_appends_once(study):
    line = (study.directory / "history.jsonl").read_text(encoding="utf-8")
    with changing(study.directory):
        commit(study.directory, None, line.replace('"step": 0', '"step": 1'))
    pending = {
        "study": None,
        "history_size": len(line.encode()),
        "history": line.replace('"step": 0', '"step": 1'),
    }
    (study.directory / PENDING).write_text(json.dumps(pending), encoding="utf-8")
    recover(study.directory)
    recover(study.directory)
    assert [s.step for s in History(study.directory).steps] == [0, 1]


HOLDER = """
import pathlib, sys, time
from specan.study.history import changing
with changing(pathlib.Path(sys.argv[1])):
    print("ready", flush=True)
    time.sleep(600)
"""


def test_a_second_process_is_refused_while_one_changes_the_study(study):
    with subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(study.directory)], stdout=subprocess.PIPE, text=True
    ) as other:
        try:
            assert other.stdout.readline() == "ready\n"
            with pytest.raises(RequestError, match="another command is changing"):
                add_effect(study, "seal-drag")
        finally:
            other.kill()  # its lock ends with it
    assert "seal-drag" in add_effect(study, "seal-drag").study.model_effects
    assert not (study.directory / LOCK).exists()


@pytest.mark.long
def test_two_that_opened_the_same_state_both_keep_their_effect(study):
    one, two = Study(study.directory), Study(study.directory)
    add_effect(one, "seal-drag")
    assert {"seal-drag", "windage"} <= set(add_effect(two, "windage").study.model_effects)
    consistent(study.directory)
    drop_effect(one, "windage")  # opened long ago
    assert effects_of(study.directory)[-1] == "seal-drag"
    consistent(study.directory)


@pytest.mark.long
def test_a_failed_change_is_forgotten_by_the_study_that_was_open(study, monkeypatch):
    opened = add_effect(study, "seal-drag").study
    with monkeypatch.context() as patch:
        patch.setattr(history, "_finish", lambda directory: (_ for _ in ()).throw(Crash))
        patch.setattr(history, "text_file", lambda *given, **how: (_ for _ in ()).throw(Crash))
        with pytest.raises(Crash):
            add_effect(opened, "windage")
    assert "windage" not in drop_effect(opened, "seal-drag").study.model_effects
    consistent(study.directory)


@pytest.mark.parametrize(
    ("body", "told"),
    [
        (
            "torque * worm_sped",
            r"mine\.py, line 9: 'my-drag' fails \(NameError: name 'worm_sped' is not defined",
        ),
        ("torque * worm_speed / 0", r"mine\.py, line 9: 'my-drag' fails|not finite"),
        (
            "torque * np.log(worm_speed - 200.0)",
            r"'my-drag' makes no_load_loss not finite .* first in row \d+",
        ),
    ],
)
def test_a_broken_effect_file_is_told_with_its_line_and_not_taken_in(study, tmp_path, body, told):
    own = tmp_path / "mine.py"
    own.write_text(OWN.format(body=body), encoding="utf-8")
    before = files_of(study.directory)
    with pytest.raises(RequestError, match=told), np.errstate(all="ignore"):
        Study(study.directory, effects=[own])
    assert files_of(study.directory) == before
    assert not (study.directory / "effects").exists()
    Study(study.directory)


def test_an_effect_file_that_fails_later_can_be_taken_out_and_replaced(study, tmp_path):
    own = tmp_path / "mine.py"
    own.write_text(OWN.format(body="torque * worm_speed"), encoding="utf-8")
    Study(study.directory, effects=[own])
    inside = study.directory / "effects" / "mine.py"
    inside.write_text("import nothing_of_that_name\n", encoding="utf-8")
    with pytest.raises(RequestError, match=r"mine\.py was changed"):
        Study(study.directory)
    assert drop_effect_file(study.directory, "mine.py") == "effects/mine.py"
    assert Study(study.directory).content.effect_file == ()
    Study(study.directory, effects=[own])
    with pytest.raises(RequestError, match="not an effect file"):
        drop_effect_file(study.directory, "another.py")


def test_memory_of_the_window_matrix_grows_with_the_length_not_with_its_square():
    rate, lines = 4096, np.arange(40, 80)
    peaks = []
    for seconds in (8, 32):
        signal_ = np.random.default_rng(0).standard_normal(rate * seconds)
        tracemalloc.start()
        fold(signal_, rate, rate, rate, lines)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 5 * peaks[0]


@pytest.mark.parametrize(
    ("after", "n", "expected"),
    [
        (
            1.005,
            281,
            "the error on held-out data does not fall",
        ),  # chance moves the RMS of 281 values by 4.2 %
        (1.15, 281, "the error on held-out data rises"),
        (1.15, 20, "the error on held-out data does not fall"),  # and that of 20 values by 16 %
        (2.67, 20, "the error on held-out data rises"),
        (0.9, 281, None),
    ],
)
def test_an_error_rises_where_it_does_by_more_than_chance(after, n, expected):
    def step(value):
        error = {"observable": "x", "rms": value, "unit": "m", "n": n}
        none: dict = {}
        return Step(0, "add", (), none, none, None, None, none, none, errors={"held_out": [error]})

    assert _on_errors(step(1.0), step(after), expected_to_fall=True) == [expected] * (expected is not None)
