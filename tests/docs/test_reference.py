"""docs/reference.md says what `import specan` offers, and is made from the docstrings.

``python tests/docs/test_reference.py`` writes it anew.
"""

import inspect
from pathlib import Path
from typing import Any

import specan
from specan.data.band_levels import BandLevels
from specan.data.calibration import Calibration
from specan.data.frequency_response import FrequencyResponse
from specan.data.levels import SignalLevels
from specan.data.orders import OrderSpectrum
from specan.data.spectrum import Spectrogram, Spectrum
from specan.data.tone import ToneTable
from specan.result import Result

PAGE = Path(__file__).parents[2] / "docs" / "reference.md"
RESULTS = (
    Result, BandLevels, Spectrum, Spectrogram, FrequencyResponse, SignalLevels, ToneTable, OrderSpectrum, Calibration,
)  # fmt: skip


def first_line(thing: object) -> str:
    return (inspect.getdoc(thing) or "").split("\n")[0].replace("|", "\\|")


def as_written(thing: Any) -> inspect.Signature:
    """Of an analysis the settings are generated; its docstring names them."""
    generated = vars(thing).pop("__signature__", None) if inspect.isfunction(thing) else None
    try:
        return inspect.signature(thing)
    finally:
        if generated is not None:
            thing.__signature__ = generated


def signature(thing: object) -> str:
    """Names of the parameters; types and defaults are in ``help``, and so are the settings of an analysis."""
    found = []
    for p in as_written(thing).parameters.values():
        if p.name not in ("self", "cls"):
            found.append("**settings" if p.kind is p.VAR_KEYWORD else p.name)
    return f"({', '.join(found)})"


def methods(kind: type) -> list[tuple[str, object]]:
    return [
        (name, getattr(kind, name))
        for name, thing in vars(kind).items()
        if not name.startswith("_") and (callable(thing) or isinstance(thing, (classmethod, property)))
    ]


def table(rows: list[tuple[str, str]]) -> list[str]:
    return ["| name | what it is |", "|---|---|", *(f"| `{name}` | {text} |" for name, text in rows), ""]


def page() -> str:
    functions = [(n, getattr(specan, n)) for n in specan.__all__]
    plain = [(n, f) for n, f in functions if inspect.isfunction(f)]
    classes = [(n, f) for n, f in functions if inspect.isclass(f)]
    lines = [
        "# Reference",
        "",
        "Made from the docstrings by a test. `help(specan.octave)` has parameters and units;",
    ]
    lines += ["examples are on [specan in Python](python.md).", "", "## Functions", ""]
    lines += table([(f"specan.{n}{signature(f)}", first_line(f)) for n, f in plain])
    lines += ["## Classes", "", *table([(f"specan.{n}", first_line(c)) for n, c in classes])]
    for kind in (specan.Recording, specan.Study):
        rows = [
            (name + ("" if isinstance(thing, property) else signature(thing)), first_line(thing))
            for name, thing in methods(kind)
        ]
        lines += [f"## specan.{kind.__name__}", "", *table(rows)]
    lines += ["## Results", "", *table([(k.__name__, first_line(k)) for k in RESULTS])]
    rows = [(n + signature(t), first_line(t)) for n, t in methods(Result)]
    return "\n".join([*lines, "## Every result", "", *table(rows)]).rstrip("\n") + "\n"


def test_the_reference_is_current() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(), "write it anew: python tests/docs/test_reference.py"


def test_everything_in_it_is_described() -> None:
    rows = [line for line in page().splitlines() if line.startswith("| `")]
    assert len(rows) > 50
    assert [row for row in rows if row.endswith("|  |")] == []


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8", newline="\n")
