"""Tables on a screen: what is in them stays whole, and they fit where they can."""

import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st

from specan_cli import output

LETTERS = st.text(st.characters(categories=("L", "N", "P", "S")), min_size=1, max_size=9)
CELLS = st.none() | st.lists(LETTERS, max_size=3).map(" ".join) | st.integers(-(10**6), 10**6)
TABLES = st.integers(1, 5).flatmap(
    lambda n: st.tuples(
        st.just("") | LETTERS,
        st.lists(LETTERS, min_size=n, max_size=n),
        st.lists(st.lists(CELLS, min_size=n, max_size=n), max_size=4),
    )
)


@pytest.fixture
def printed(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    monkeypatch.setenv("COLUMNS", "80")

    def lines(*table: object) -> list[str]:
        output.table(*table)
        return capsys.readouterr().out.splitlines()

    return lines


@given(TABLES)
def test_no_letter_is_lost(table: tuple) -> None:
    title, header, rows = table
    with pytest.MonkeyPatch.context() as patch:
        found: list[str] = []
        patch.setenv("COLUMNS", "80")
        patch.setattr(output.click, "echo", found.append)
        output.table(title, header, rows)
    columns = list(zip(*rows, strict=True)) or [["x"] for _ in header]
    heads = [
        head for head, column in zip(header, columns, strict=True) if any(c not in ("", None) for c in column)
    ]
    told = [title, *heads, *("" if cell is None else str(cell) for row in rows for cell in row)]
    assert sorted("".join("".join(found).split())) == sorted("".join("".join(told).split()))


def test_numbers_stand_to_the_right(printed) -> None:
    found = printed("", ["table", "rows"], [["noise.txt", 9600], ["sine.txt", None], ["x", 5]])
    assert found == ["table      rows", "noise.txt  9600", "sine.txt", "x             5"]


def test_wide_letters_take_two_places(printed) -> None:
    found = printed("", ["x", "y"], [["\u6d4b", "1"], ["ab", "2"]])
    assert found[1:] == ["\u6d4b  1", "ab  2"]
    assert unicodedata.east_asian_width("\u6d4b") == "W"


def test_a_table_wider_than_a_pipe_is_wrapped_and_nothing_is_cut(printed) -> None:
    name = "microphone-delay@card.delay-of-" + "x" * 69  # 100 letters
    row = [name, "-0.002492", "-0.003354", "-0.001631", "Pa*s/m", "outside, at its bound"]
    text = printed("", ["parameter", "value", "from", "to", "unit", ""], [row])
    assert any(name in line for line in text)
    assert "".join("".join(text).split()) == "".join(
        ["parametervaluefromtounit", *row[:5], "outside,", "atitsbound"]
    ).replace(" ", "")
    assert max(map(len, text)) < 100 + 9 + 9 + 9 + 6 + 21 + 10  # it gives way where it can
