"""A small fixed part of the fuzz of pages; and that the fuzz sees what goes wrong."""

import sys
from contextlib import chdir
from functools import partial
from pathlib import Path

import pytest

pytest.importorskip("bokeh")
sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

import fuzz_commands
import fuzz_pages

import specan
from specan.inspect.opened import Opened, watched
from specan.inspect.recording_page import RecordingPage

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    place = tmp_path_factory.mktemp("good")
    with chdir(place):
        fuzz_commands.made(place)
    return place


@pytest.fixture
def fill(place):
    path = place / "noise.tdms"
    return partial(RecordingPage, opened=Opened((watched(specan.read(path), path),), ()))


@pytest.mark.parametrize(
    ("address", "chosen"),
    [
        ({"tab": [b"orders"], "speed": [b"1e300"]}, {}),
        ({"tab": [b"fft"]}, {"reference": "x", "lines": 1_000_000}),
        ({"stop": [b"1e-300"]}, {"fmin": "nan"}),
        ({"channel": [b"\xff"]}, {"tab": "info"}),
    ],
)
def test_an_odd_address_or_choice_shows_a_result_or_a_sentence(fill, address, chosen):
    assert fuzz_pages.of_page(fill, address, chosen) == []


def test_the_fuzz_sees_an_error_of_a_page(fill, monkeypatch):
    def fails(*_):
        raise KeyError("x")

    monkeypatch.setattr("specan.inspect.tab.Tab.compute", fails)
    (text,) = fuzz_pages.of_page(fill, {}, {})
    assert "internal error on the page: KeyError('x')" in text


def test_no_page_of_a_study_ends_in_an_error(place):
    assert list(fuzz_pages.studies(place)) == []
