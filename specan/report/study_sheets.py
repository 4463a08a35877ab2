"""Tables of a study, for the screen, the report and the page."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from specan.result import Sheet, cell
from specan.study.estimation.prediction_error import ObservableError
from specan.study.history import Step
from specan.study.verdict import placed


def unit_text(unit: str) -> str:
    """A unit in a column of units; nothing for a number."""
    return "" if unit == "1" else unit


def errors(found: Iterable[ObservableError], title: str = "", data: Sequence[str] = ()) -> Sheet:
    """Errors of every observable; `data` names the data of each row, where there are several kinds."""
    header = ["observable", "values", "RMS error", "bias", "unit", "relative RMS", "largest"]
    rows: list[list[Any]] = [
        [
            e.observable, e.n, f"{e.rms:.4g}", f"{e.bias:+.2g}", unit_text(e.unit), f"{e.relative_rms:.2f} %",
            f"{e.relative_max:.2f} %",
        ]
        for e in found
    ]  # fmt: skip
    if not data:
        return Sheet(title, header, rows)
    return Sheet(title, ["data", *header], [[kind, *row] for kind, row in zip(data, rows, strict=True)])


def parameters(found: Mapping[str, Mapping[str, Any]]) -> Sheet:
    """Fitted parameters with their 95 % intervals."""
    rows = [
        [name, f"{p['value']:.4g}", f"{p['low']:.4g}", f"{p['high']:.4g}", unit_text(p["unit"]), _remark(p)]
        for name, p in found.items()
    ]
    return Sheet("Parameters (95 %)", ["parameter", "value", "from", "to", "unit", ""], rows)


def _remark(p: Mapping[str, Any]) -> str:
    if p["at_bound"]:
        return "at its bound"
    if not p["plausible"]:
        return "outside"
    return "certificate" if p.get("nuisance") else ""


def value_text(p: Mapping[str, Any]) -> str:
    """``9.37 (7.02 to 11.6) W``."""
    return f"{p['value']:.3g} ({p['low']:.3g} to {p['high']:.3g}) {unit_text(p['unit'])}".rstrip()


def amount(error: Mapping[str, Any]) -> str:
    """An error of a step: ``0.0123 N*m``."""
    return f"{error['value']:.4g} {unit_text(error['unit'])}".rstrip()


def history(steps: Sequence[Step], title: str = "") -> Sheet:
    """Every step with its errors on fitted and on held-out data."""
    rows: list[list[Any]] = []
    for s in steps:
        what = f"{s.action} {s.effect}".strip() + (f" ({s.because})" if s.because else "")
        fitted, aside = (", ".join(map(amount, s.of_each(kind).values())) for kind in ("fit", "held_out"))
        rows.append([s.step, what, fitted, cell(s.reduced_chi2), aside, cell(s.held_out_reduced_chi2)])
    return Sheet(title, ["step", "what", "fitted", "chi2/n", "held out", "chi2/n"], rows)


def candidates(ranking: Iterable[Mapping[str, Any]], *, valued: bool = False) -> Sheet:
    """Rows of a ranking, as ``study diagnose --json`` prints them; with their parameters where `valued`."""
    header, forms = ["candidate", "error left", "probability"], {"error_after": ".3g", "probability": ".2g"}
    rows = [
        [" + ".join(placed(row["effects"], row["at"])), *(cell(row.get(key), form) for key, form in forms.items()),
         *(["; ".join(f"{n} = {value_text(p)}" for n, p in row["parameters"].items())] if valued else [])]
        for row in ranking
    ]  # fmt: skip
    return Sheet("", [*header, *(["parameters"] if valued else [])], rows)


def visible(found: Mapping[str, Mapping[str, Any] | None]) -> Sheet:
    """Smallest detectable effects."""
    rows = [[n, f"{v['value']:.2g}", unit_text(v["unit"])] for n, v in found.items() if v is not None]
    return Sheet("Smallest detectable effects", ["effect", "size", ""], rows)
