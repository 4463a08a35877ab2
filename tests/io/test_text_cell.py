"""Names as cells: other readers get every name back, whatever it holds."""

import csv
import io
import re

import numpy as np
import pandas as pd
from hypothesis import example, given
from hypothesis import strategies as st

from specan.data.recording import ArraySource, Channel, Recording
from specan.io.export_file import Excerpt, write_csv
from specan.io.results_text import cells, harmless, table_lines, word, write_table

HOSTILE = [
    "Mic #1", "Mic #2", '"quoted', 'a "b" c', "Mic\t1", "Mic 1", "Mic  1", " lead", "trail ", "#2 run.tdms",
    "=cmd|'/c calc'!A0", "+1", "-20 dB.tdms", "@SUM(A1)", "'apostrophe", "''", "bad\udcff.tdms", "\\t", "\\",
    "a\nb", "a\r\nb", "\u2028", "x\x00y", "a,b;c", "wz\u00f3r", "\U0001f600", "\ufeff", "a\\x41",
]  # fmt: skip
names = st.lists(
    st.one_of(st.sampled_from(HOSTILE), st.text(st.characters(), min_size=1)), min_size=1, unique=True
)


ESCAPE = re.compile(r"\\(x[0-9a-f]{2}|u[0-9a-f]{4}|U[0-9a-f]{8}|.)")
LETTERS = {"t": "\t", "n": "\n", "r": "\r", "\\": "\\"}


def plain(cell: str) -> str:
    """The name that a cell stands for."""
    found = cell[1:] if len(cell) > 1 and cell.startswith("'") else cell
    return ESCAPE.sub(lambda m: LETTERS.get(m[1], chr(int(m[1][1:], 16)) if len(m[1]) > 1 else m[0]), found)


@given(names)
@example(HOSTILE)
def test_pandas_as_the_readme_says_and_csv_readers_give_every_name_back(
    tmp_path_factory, given_names
) -> None:
    path = tmp_path_factory.mktemp("t") / "t.txt"
    block = table_lines(
        {"name": [word(n) for n in given_names], "number": [str(k) for k in range(len(given_names))]}
    )
    write_table(path, [f"specan 1.0 {given_names[0]}"], ("file", "number"), [block])
    # As the README says; names such as "NA" and "1" need what pandas wants for them.
    found = pd.read_csv(path, sep="\t", comment="#", keep_default_na=False, dtype={"file": str})
    assert [plain(cell) for cell in found["file"]] == given_names
    assert found["number"].tolist() == list(range(len(given_names)))
    assert found["file"].nunique() == len(given_names)
    text = path.read_text(encoding="utf-8").split("\n", 2)[2]
    for read in (csv.reader(io.StringIO(text), delimiter="\t"), map(cells, text.split("\n")[:-1])):
        assert [plain(row[0]) for row in read] == given_names


@given(st.text(st.characters(), min_size=2))
@example("=1+1")
@example("-2+3")
def test_no_spreadsheet_sees_a_formula(name) -> None:
    assert not harmless(name).startswith(("=", "+", "-", "@", "\t", "\r"))
    assert not cells(word(name))[0].startswith(("=", "+", "-", "@", "\t", "\r"))


def test_ordinary_names_stand_as_they_are() -> None:
    for name in ("Mic 1", "recs/a b.tdms", "Wibrometr \u0105", "m/s^2", "-", "10 %", "it's"):
        assert word(name) == name


@given(names)
@example(HOSTILE)
def test_an_exported_csv_holds_every_name(tmp_path_factory, given_names) -> None:
    path = tmp_path_factory.mktemp("t") / "t.csv"
    channels = tuple(
        Channel(name, unit="Pa", sampling_rate=4.0, n_samples=2, source_index=k)
        for k, name in enumerate(given_names)
    )
    samples = np.arange(2.0 * len(channels)).reshape(-1, 2)
    recording = Recording("a.tdms", channels, ArraySource(list(samples)))
    write_csv(Excerpt(recording, channels, 0, 2), path)
    with path.open(encoding="utf-8", newline="") as file:
        header, *values = csv.reader(file)
    assert [plain(cell).removesuffix(" [Pa]") for cell in header[1:]] == given_names
    assert not any(cell.startswith(("=", "+", "-", "@")) for cell in header)
    np.testing.assert_allclose(np.array(values, float)[:, 1:].T, samples)
    found = pd.read_csv(path)
    assert found.shape == (2, len(channels) + 1)
