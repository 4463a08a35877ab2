"""A result written to a file, in the format that its ending names."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

from specan import __version__
from specan.data.frequency_response import FrequencyResponse
from specan.data.spectrum import Spectrum
from specan.io.output_file import text_file
from specan.io.results_text import table_lines, words, write_table
from specan.result import RecordingResult, finite

if TYPE_CHECKING:
    import pandas as pd


def write_frame(frame: pd.DataFrame, path: Path, header: Sequence[str], decimal: str = ".") -> None:
    """Write a data frame as a table; the header says what it is."""
    if path.suffix.lower() == ".json":
        with text_file(path) as file:
            content = {"written_by": f"specan {__version__}", "rows": finite(frame.to_dict("records"))}
            json.dump(content, file, indent=2, ensure_ascii=False)
        return
    columns = {n: words(v) if v.dtype.kind in "OUT" else v.to_numpy(float) for n, v in frame.items()}
    whole = [f"specan {__version__}", *header]
    write_table(path, whole, list(columns), [table_lines(columns)], decimal)


def write_result(
    found: RecordingResult, path: Path, tables: Iterable[Mapping[str, Any]] = (), decimal: str = "."
) -> None:
    """Write a result: ``.json``, ``.uff``, or a table.

    Parameters
    ----------
    found : RecordingResult
        What a verb has found.
    path : Path
        ``.json`` holds what ``--json`` prints, ``.uff`` and ``.unv`` functions of frequency; every other ending is that
        of a table (`specan.io.results_text.write_table`). Its header says which verb made it, and ends with its
        settings, calibration and notes.
    tables : iterable of mapping
        Tables in place of those of the result: named columns as `table_lines` takes them, one set after the other.
    decimal : {".", ","}
        Decimal sign of a table that is text.
    """
    ending = path.suffix.lower()
    if ending == ".json":
        with text_file(path) as file:
            content = {"written_by": f"specan {__version__}", **found.to_dict()}
            json.dump(content, file, indent=2, ensure_ascii=False)
            file.write("\n")
        return
    if ending in (".uff", ".unv") and isinstance(found, (FrequencyResponse, Spectrum)):
        from specan.io.export_file import write_uff_functions

        write_uff_functions(found, path)
        return
    settings = dict(found.settings)
    said = settings.pop("calibration", None)
    calibration = [f"calibration: {said}"] if said else []
    header = [f"specan {__version__} {found.verb}", *found.about(), f"settings: {settings}", *calibration]
    parts = iter(tables or found.tables())
    first = next(parts)
    lines = map(table_lines, chain([first], parts))
    write_table(path, [*header, *found.notes], list(first), lines, decimal)
