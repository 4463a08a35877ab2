"""Tables as laboratories write them."""

import numpy as np
import pytest

from specan.errors import InputError
from specan.study.data.table_file import printed_step, read_table


def written(tmp_path, text, name="t.csv"):
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


@pytest.mark.parametrize(
    "text",
    [
        "a,b\n1,2.5\n3,4.25\n",
        "a\tb\n1\t2.5\n3\t4.25\n",
        "a;b\n1;2,5\n3;4,25\n",
        "# a remark\na,b\n\n1,2.5\n3,4.25\n",
        "\ufeffa,b\r\n1,2.5\r\n3,4.25\r\n",
        "a,b,note by\n1,2.5,me\n3,4.25,you\n",
    ],
)
def test_the_same_numbers_whatever_the_dress(tmp_path, text):
    table = read_table(written(tmp_path, text))
    np.testing.assert_array_equal(table.frame["a"], [1, 3])
    np.testing.assert_array_equal(table.frame["b"], [2.5, 4.25])
    assert set(table.frame) == {"a", "b"}
    assert table.steps["b"] == 0.01


def test_utf_16_from_a_spreadsheet_is_read(tmp_path):
    path = written(tmp_path, "a;b\n1;2,5\n".encode("utf-16"))
    assert read_table(path).frame["b"].iloc[0] == 2.5


def test_an_empty_cell_is_not_a_number_and_rows_keep_their_line(tmp_path):
    table = read_table(written(tmp_path, "# one\na,b\n1,\n,2\n"))
    assert np.isnan(table.frame["b"].iloc[0])
    assert np.isnan(table.frame["a"].iloc[1])
    assert table.rows(np.array([False, True])) == "line 4"


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "no rows"),
        ("a,b\n", "no rows"),
        ("a,b\n1,x\n", "line 2: 'x' in the column 'b'"),
        ("a,b\n1,inf\n", "is not a number"),
        ("a,b\n1,2\n3,1e300\n", "line 3: '1e300' in the column 'b' is too large"),
        ("a,a\n1,2\n", "twice"),
        ("a,b\n1,5,2,5\n", "decimal comma"),
    ],
)
def test_faults_name_their_place(tmp_path, text, told):
    with pytest.raises(InputError, match=told):
        read_table(written(tmp_path, text))


def test_a_missing_or_binary_file_is_said(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        read_table(tmp_path / "none.csv")
    with pytest.raises(InputError, match="text file"):
        read_table(written(tmp_path, b"\x81\x8d\x00\xff"))


def test_the_printed_step_knows_exponents_and_empty_cells():
    assert printed_step(["1.20e-3", "", "nan"]) == pytest.approx(1e-5)
    assert printed_step(["", "-"]) == 0.0
