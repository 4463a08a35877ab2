r"""A name as a cell of a table: read back as it was by pandas, R and spreadsheets, whatever it holds.

The rule, in the order in which it is applied:

1. A backslash is doubled; characters that end a cell or a line and those that UTF-8 does not have become
   ``\t``, ``\n``, ``\r``, ``\x1b``, ``\u2028``, ``\udcff`` (a byte of a file name that is not UTF-8).
2. Before ``=``, ``+``, ``-``, ``@`` or an apostrophe at the beginning of a longer text stands an apostrophe, so
   that no spreadsheet takes it for a formula.
3. A text with ``#`` or ``"``, or with a blank at its beginning or end, stands between ``"``; ``"`` within it is
   doubled.

Ordinary names are not touched. Different names give different cells, and `plain` gives back the name.
"""

from __future__ import annotations

import csv
import re
import unicodedata

_SHORT = {"\t": "\\t", "\n": "\\n", "\r": "\\r", "\\": "\\\\"}
# Controls, surrogates, separators of lines and of paragraphs.
_UNSEEN = {"Cc", "Cs", "Zl", "Zp"}
_FORMULA = ("=", "+", "-", "@", "'")
_ESCAPE = re.compile(r"\\(x[0-9a-f]{2}|u[0-9a-f]{4}|U[0-9a-f]{8}|.)")
_LETTERS = {"t": "\t", "n": "\n", "r": "\r", "\\": "\\"}


def escaped(text: str) -> str:
    r"""Rule 1: one line of UTF-8, whatever the text holds.

    Examples
    --------
    >>> escaped("Mic\t1"), escaped("a\\b"), escaped("bad\udcff")
    ('Mic\\t1', 'a\\\\b', 'bad\\udcff')
    """
    if text.isascii() and text.isprintable() and "\\" not in text:
        return text
    return "".join(_escape(c) for c in text)


def harmless(text: object) -> str:
    """Rules 1 and 2, for writers that quote by themselves.

    Examples
    --------
    >>> harmless("=1+1"), harmless("-"), harmless("Mic 1")
    ("'=1+1", '-', 'Mic 1')
    """
    found = escaped(str(text))
    return f"'{found}" if len(found) > 1 and found.startswith(_FORMULA) else found


def word(text: object) -> str:
    r"""A cell of a tab-separated table.

    Examples
    --------
    >>> word("Mic 1"), word("Mic #1"), word('5" pipe'), word("a\tb")
    ('Mic 1', '"Mic #1"', '"5"" pipe"', 'a\\tb')
    """
    found = harmless(text)
    if "#" in found or '"' in found or found != found.strip():
        return '"' + found.replace('"', '""') + '"'
    return found


def cells(line: str) -> list[str]:
    """The cells of one line of a table, without quotation marks.

    Examples
    --------
    >>> cells('a.tdms\\t"Mic #1"\\t94.000')
    ['a.tdms', 'Mic #1', '94.000']
    """
    line = line.rstrip("\n")
    return line.split("\t") if '"' not in line else next(csv.reader([line], delimiter="\t"))


def plain(cell: str) -> str:
    r"""The name that a cell, read without its quotation marks, stands for.

    Examples
    --------
    >>> plain("'=1+1"), plain("Mic\\t1"), plain("a\\\\b")
    ('=1+1', 'Mic\t1', 'a\\b')
    """
    found = cell[1:] if len(cell) > 1 and cell.startswith("'") else cell
    return _ESCAPE.sub(lambda m: _LETTERS.get(m[1], chr(int(m[1][1:], 16)) if len(m[1]) > 1 else m[0]), found)


def _escape(character: str) -> str:
    if character in _SHORT:
        return _SHORT[character]
    if unicodedata.category(character) not in _UNSEEN:
        return character
    code = ord(character)
    if code < 0x100:
        return f"\\x{code:02x}"
    return f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"
