"""Tables into a file or a pipe are those of rich, whether it is loaded or not."""

import io

import pytest
from hypothesis import given
from hypothesis import strategies as st

from specan_cli import output

letters = st.text(st.characters(codec="ascii", categories=("L", "N", "P", "S", "Z")), max_size=12)
words = st.text("ab c[.-%", min_size=1, max_size=12).filter(str.strip)
cells = st.none() | words | letters | st.integers(-(10**6), 10**6) | st.floats(allow_nan=False)
tables = st.integers(1, 5).flatmap(
    lambda n: st.tuples(
        st.just("") | st.text("ABC xyz", max_size=8),
        st.lists(st.text("abc_ []", min_size=1, max_size=9), min_size=n, max_size=n),
        st.lists(st.lists(cells, min_size=n, max_size=n), max_size=4),
    )
)


def printed(monkeypatch: pytest.MonkeyPatch, *table: object) -> str:
    stream = io.StringIO()
    with monkeypatch.context() as patch:
        patch.setattr("sys.stdout", stream)
        for name in output._OF_A_TERMINAL:
            patch.delenv(name, raising=False)
        output.table(*table)
    return stream.getvalue()


@given(tables)
def test_tables_in_a_pipe_are_those_of_rich(table: tuple) -> None:
    with pytest.MonkeyPatch.context() as patch:
        ours = printed(patch, *table)
        patch.setattr(output, "plain_lines", lambda *_: None)
        assert ours == printed(patch, *table)


def test_a_usual_table_does_not_need_rich(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in output._OF_A_TERMINAL:
        monkeypatch.delenv(name, raising=False)
    found = output.plain_lines("", ["table", "rows"], [["noise.txt", 9600], ["sine.txt", ""]])
    assert found == ["table      rows", "noise.txt  9600", "sine.txt       "]
    assert output.plain_lines("", ["x"], [["\u00e4"]]) is None
    assert output.plain_lines("", ["x"], [["y" * 81]]) is None


def test_a_table_wider_than_a_pipe_is_wrapped_and_nothing_is_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    name = "microphone-delay@card.delay-of-" + "x" * 17  # 48 letters
    row = [name, "-0.002492", "-0.003354", "-0.001631", "Pa*s/m", "outside, at its bound"]
    text = printed(monkeypatch, "", ["parameter", "value", "from", "to", "unit", ""], [row])
    assert name in text
    assert "".join(text.split()) == "".join(
        ["parametervaluefromtounit", *row[:5], "outside,", "atitsbound"]
    ).replace(" ", "")
    assert len(max(text.splitlines(), key=len)) < 48 + 9 + 9 + 9 + 6 + 21 + 10  # it gives way where it can
