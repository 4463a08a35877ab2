"""A small fixed part of the fuzz of options and of studies."""

import sys
from contextlib import chdir
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

import fuzz_commands


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    place = tmp_path_factory.mktemp("good")
    with chdir(place):
        fuzz_commands.made(place)
    return place


def test_every_command_has_a_line_to_begin_with() -> None:
    from specan_cli.main import main

    assert {path for path, _ in fuzz_commands.commands(main)} == set(fuzz_commands.ARGUMENTS)


@pytest.mark.long
def test_an_odd_value_of_an_option_is_answered_or_refused(good) -> None:
    lines = [words for words in fuzz_commands.tried(1, np.random.default_rng(1)) if words[0] != "simulate"]
    assert [fault for words in lines[::16] for fault in fuzz_commands.on_copies(good, words)] == []


@pytest.mark.long
def test_no_option_of_any_command_has_a_victim(good) -> None:
    lines = list(fuzz_commands.tried(1, np.random.default_rng(2)))[1::5]
    assert [fault for words in lines for fault in fuzz_commands.on_copies(good, words)] == []


@pytest.mark.long
@pytest.mark.long
def test_damaged_studies_are_answered_or_refused(good) -> None:
    assert list(fuzz_commands.studies(good, 6, 4)) == []


def test_the_fuzz_sees_a_file_that_is_changed_and_an_internal_error(good, monkeypatch) -> None:
    def ends(*words):
        Path("t.csv").write_text("")
        return [f"{words[0]}: KeyError: 1"]

    monkeypatch.setattr(fuzz_commands.fuzz, "by_command", ends)
    assert fuzz_commands.on_copies(good, ("info", "noise.tdms")) == [
        "info: KeyError: 1",
        "info noise.tdms: t.csv was changed",
    ]


@pytest.mark.parametrize(
    "words",
    [
        "simulate worm-gear worm-gear.toml -o a.csv --seed -1",
        "simulate planetary-gear planetary-gear.toml -o a.tdms --duration 0.1 --noise 1e300",
        "study next s --effect /",
        f"study propose s --effect {400 * '9'}",
        "study report s -o /",
        "export noise.tdms -o out.csv --stop inf",
        "impulse noise.tdms --length 1e300 -o a.csv",
        "decay noise.tdms --sampling-rate 3",
        "calibrate calibrator.tdms --u-level 1e300",
        "calibrate calibrator.tdms --level 1e5",
        "rms noise.tdms --sampling-rate 3",
        "orders timed.tdms --speed 1e300",
        "orders timed.tdms --speed 5010",
        f"study new --model spring.py --rig rig.toml --measurement {400 * '9'} n",
    ],
)
def test_what_a_fuzz_has_found_stays_mended(good, words) -> None:
    assert fuzz_commands.on_copies(good, tuple(words.split())) == []
