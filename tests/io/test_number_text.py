"""Numbers formatted together have the characters that `%` gives to each."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from specan.io.number_text import fixed_cells, lines, significant_cells, text_cells

ODD = [
    0.0,
    -0.0,
    np.nan,
    np.inf,
    -np.inf,
    5e-324,
    1e308,
    999999.5,
    9999995.0,
    9.9999995e-5,
    1 - 1e-16,
    0.5,
    2.5,
]
numbers = st.lists(st.floats(allow_nan=True) | st.floats(-1e7, 1e7) | st.sampled_from(ODD), min_size=1)


def printed(values: list[float], form: str) -> list[str]:
    return [form % (v + 0.0) if np.isfinite(v) else "" for v in values]


@given(numbers, st.integers(1, 7))
@example(ODD, 6)
@example([10.0**k for k in range(-20, 20)], 3)
@example([k / 8 for k in range(4000)], 2)
def test_significant_digits_are_those_of_g(values: list[float], digits: int) -> None:
    found = lines([significant_cells(np.array(values), digits)])
    assert found.split("\n")[:-1] == printed(values, f"%.{digits}g")


@given(numbers, st.integers(1, 5))
@example(ODD, 5)
@example([k / 8 - 250 for k in range(4000)], 2)
def test_decimals_are_those_of_f_after_rounding(values: list[float], decimals: int) -> None:
    rounded = np.array([np.round(v, decimals) if abs(v) < 1e9 else v for v in values])
    found = lines([fixed_cells(np.array(values), decimals)])
    assert found.split("\n")[:-1] == printed(rounded.tolist(), f"%.{decimals}f")


def test_all_of_a_long_column() -> None:
    values = np.random.default_rng(1).standard_normal(100_000) * 10.0 ** np.linspace(-12, 12, 100_000)
    assert lines([significant_cells(values, 6)]) == "".join(f"{v:.6g}\n" for v in values)


def test_lines_have_their_words_and_tabs() -> None:
    cells = [text_cells(["1", "20 %"]), fixed_cells(np.array([1.0, np.nan]), 1), text_cells(["", "µ"])]
    assert lines(cells, "a\tb\t") == "a\tb\t1\t1.0\t\na\tb\t20 %\t\tµ\n"
    assert lines([text_cells([])]) == ""


def test_nothing_else_is_printed() -> None:
    with pytest.raises(AssertionError):
        significant_cells(np.ones(1), 8)
