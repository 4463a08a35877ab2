"""Number formats of the result tables, and that a table is never half there."""

from functools import partial

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from specan.errors import RequestError
from specan.io.results_text import fixed, frequencies, phases, significant, table_lines, word, write_table


@given(st.floats(-1e6, 1e6))
@example(180.01)
@example(-180.0)
def test_phase_is_in_the_half_open_turn_after_rounding(angle: float) -> None:
    (text,) = phases(angle).texts
    value = float(text)
    assert -180.0 < value <= 180.0
    assert text != "-0.00"
    away = (value - angle + 180.0) % 360.0 - 180.0
    assert abs(away) <= 0.005 + 1e-6


@given(st.floats(-1e3, 1e3))
def test_level_is_rounded_to_a_thousandth_without_negative_zero(level: float) -> None:
    (text,) = fixed(level, 3).texts
    assert abs(float(text) - level) <= 0.0005 + 1e-9
    assert text.split(".")[1].isdigit()
    assert len(text.split(".")[1]) == 3
    assert not (text.startswith("-") and float(text) == 0.0)


def test_nothing_to_say_is_empty() -> None:
    nothing = [np.nan, np.inf, -np.inf]
    for form in (partial(fixed, decimals=3), phases, significant, frequencies):
        assert list(form(nothing).texts) == ["", "", ""]
    assert fixed(np.array([1.0]), 0).texts == ["1"]


def test_a_name_cannot_break_the_table() -> None:
    assert table_lines({"channel": "Mic\t1", "unit": [word("a\nb")]}) == "Mic\\t1\ta\\nb\n"


def test_a_percent_sign_in_a_name_is_printed_as_it_is() -> None:
    assert table_lines({"channel": "5 %d", "unit": ["%s"], "rms": [np.nan]}) == "5 %d\t%s\t\n"


def test_table_has_header_columns_and_line_feeds(tmp_path) -> None:
    path = tmp_path / "sine.txt"
    write_table(path, ["specan", "two\nlines"], ("file", "channel"), ["a\tb\n", "c\td\n"])
    assert path.read_bytes() == b"# specan\n# two lines\nfile\tchannel\na\tb\nc\td\n"
    assert [p.name for p in tmp_path.iterdir()] == ["sine.txt"]


def test_a_failure_leaves_the_old_table(tmp_path) -> None:
    path = tmp_path / "sine.txt"
    path.write_text("old")

    def blocks():
        yield "new\n"
        raise RuntimeError

    with pytest.raises(RuntimeError):
        write_table(path, [], (), blocks())
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["sine.txt"]


def test_a_place_that_is_gone_is_named(tmp_path) -> None:
    with pytest.raises(RequestError, match=r"sine\.txt cannot be written"):
        write_table(tmp_path / "gone" / "sine.txt", [], (), [])
