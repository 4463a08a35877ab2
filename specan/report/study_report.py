"""A study on one page that a colleague can read: self-contained, no outside address."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

from specan import __version__
from specan.report.figures_study import figure_compare, figure_history, figure_map
from specan.study.observation.table import TableObservation
from specan.study.study_file import NAME

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from specan.study.diagnosis import Diagnosis
    from specan.study.study import Study

STYLE = """
body { font: 15px/1.5 sans-serif; max-width: 62em; margin: 2em auto; padding: 0 1em; color: #222; }
table { border-collapse: collapse; margin: 0.8em 0; } td, th { padding: 0.2em 0.8em; text-align: left;
border-bottom: 1px solid #ddd; } td.n { text-align: right; font-variant-numeric: tabular-nums; }
img { max-width: 100%; } .verdict { font-size: 1.25em; border-left: 0.3em solid #0072B2; padding-left: 0.6em; }
pre { background: #f5f5f5; padding: 0.8em; overflow-x: auto; } tr.grey { color: #888; }
"""


def study_report(study: Study) -> str:
    """The page as HTML.

    Every name and text of the study is shown as text, never as markup.
    """
    diagnosis = study.diagnose() if study.data.known else None
    parts = [
        f"<h1>{escape(study.directory.resolve().name)}</h1>",
        f"<p>{escape(study.model.title)}. Effects of the model: "
        f"{escape(', '.join(study.model_effects) or 'none, the ideal machine')}.</p>",
        *_comparison(study),
        *(_diagnosis(diagnosis) if diagnosis else []),
        *_history(study),
        *_assumptions(study),
        *_reproduce(study),
    ]
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        f"<title>{escape(study.directory.resolve().name)}</title><style>{STYLE}</style></head>\n<body>\n"
        + "\n".join(parts)
        + "\n</body></html>\n"
    )


def _comparison(study: Study) -> list[str]:
    found = study.compare()
    best, where = found.fit, found.localisation
    parts = ["<h2>Measured and model</h2>"]
    rows = [("fitted", e) for e in found.errors]
    rows += [("held out", e) for e in (study.held_out.errors if study.held_out else ())]
    parts.append(
        _table(
            ["data", "observable", "values", "RMS error", "bias", "unit", "relative RMS", "largest"],
            [
                [what, e.observable, e.n, f"{e.rms:.4g}", f"{e.bias:+.2g}", e.unit, f"{e.relative_rms:.2f} %",
                 f"{e.relative_max:.2f} %"]
                for what, e in rows
            ],
        )
    )  # fmt: skip
    if where is not None:
        held = f"; on held-out data {study.held_out.reduced_chi2:.2f}" if study.held_out else ""
        parts.append(
            f"<p>Reduced chi-square {best.reduced_chi2:.2f} (p = {best.p_value:.2g}, "
            f"{best.n_effective:.0f} independent values){held}. A model discrepancy of "
            f"{study.data.discrepancy_percent:g} % is allowed for.</p>"
        )
        parts.append(_list(where.sentences()))
    if isinstance(study.problem.observations[0], TableObservation):
        parts.append(_picture(figure_compare(study), "measured values and model"))
        varying = [n for n in study.problem.observations[0].labels if n != "measurement"]
        if where is not None and len(varying) > 1:
            parts.append(_picture(figure_map(study), "where the model fails"))
    rows_ = [
        [name, f"{p['value']:.4g}", f"{p['low']:.4g} to {p['high']:.4g}", p["unit"], _remark(p)]
        for name, p in found.parameters.items()
    ]
    parts += ["<h3>Parameters</h3>", _table(["parameter", "value", "95 %", "unit", ""], rows_)]
    return parts


def _remark(p: Mapping[str, Any]) -> str:
    if p["at_bound"]:
        return "at the end of its domain"
    if not p["plausible"]:
        return "not plausible"
    return "instrument, held by its certificate" if p["nuisance"] else ""


def _diagnosis(found: Diagnosis) -> list[str]:
    names = " or ".join(" with ".join(members) for members in found.alternatives)
    verdict = found.verdict + (f": {names}" if names else "")
    parts = [
        "<h2>What is missing</h2>",
        f'<p class="verdict">{escape(verdict)}</p>',
        f"<p>{escape(found.reason[:1].upper() + found.reason[1:])}.</p>",
    ]
    if found.residual_law is not None:
        parts.append(f"<p>What is left goes like {escape(found.residual_law.text.lstrip('~ '))}.</p>")
    rows = [
        [
            " + ".join(r.effects), f"{r.delta_bic:.1f}", f"{r.p_value:.1g}", f"{r.held_out_gain:.1f}",
            f"{r.error_after:.3g}", "; ".join(_value(n, p) for n, p in r.parameters.items()),
        ]
        for r in found.ranking[:12]
    ]  # fmt: skip
    if rows:
        grey = [not r.plausible for r in found.ranking[:12]]
        header = ["effects", "delta BIC", "p", "gain in cross-validation", "error after", "parameters"]
        parts.append(_table(header, rows, grey))
    visible = [
        [n, "invisible at any plausible size" if v is None else f"{v['value']:.2g} {v['unit']}"]
        for n, v in found.smallest_visible.items()
    ]
    visible += [[n, f"not testable: {why}"] for n, why in found.not_testable.items()]
    if visible:
        parts += ["<h3>Smallest effect that these data would show</h3>", _table(["effect", "size"], visible)]
    if found.next_measurement:
        parts += ["<h3>What would decide</h3>", _list(str(row["text"]) for row in found.next_measurement)]
    return parts


def _value(name: str, p: Mapping[str, Any]) -> str:
    return f"{name} = {p['value']:.3g} ({p['low']:.3g} to {p['high']:.3g}) {p['unit']}"


def _history(study: Study) -> list[str]:
    steps = study.history.steps
    if not steps:
        return []
    rows = [
        [
            s.step, f"{s.action} {s.effect}".strip(), s.because, f"{s.fit_error['value']:.4g}",
            "" if s.held_out_error is None else f"{s.held_out_error['value']:.4g}", s.fit_error["unit"],
            "" if s.reduced_chi2 is None else f"{s.reduced_chi2:.2f}",
            "" if s.held_out_reduced_chi2 is None else f"{s.held_out_reduced_chi2:.2f}",
        ]
        for s in steps
    ]  # fmt: skip
    header = ["step", "what", "because", "fitted", "held out", "unit", "chi2/n fitted", "chi2/n held out"]
    return ["<h2>History</h2>", _table(header, rows), _picture(figure_history(steps), "errors of the steps")]


def _assumptions(study: Study) -> list[str]:
    parts = ["<h2>What was found and assumed</h2>", _list(study.data.statements)]
    defaults = study.model.settings.get("defaults_used", {})
    if defaults:
        parts.append(_table(["rig default", "value"], [[k, v] for k, v in defaults.items()]))
    return parts


def _reproduce(study: Study) -> list[str]:
    hashes = study.hashes
    rows = [[name, sha] for name, sha in {**hashes["files"], **hashes["effect_files"]}.items()]
    rows += [[study.content.rig, hashes["rig"]]]
    text = (study.directory / NAME).read_text(encoding="utf-8")
    return [
        "<h2>To have these numbers again</h2>",
        f"<p>specan {escape(__version__)}; the files below by their SHA-256, and this {NAME}:</p>",
        _table(["file", "sha256"], rows),
        f"<pre>{escape(text)}</pre>",
    ]


def _table(header: Sequence[str], rows: Iterable[Sequence[Any]], grey: Sequence[bool] | None = None) -> str:
    lines = ["<table><tr>" + "".join(f"<th>{escape(h)}</th>" for h in header) + "</tr>"]
    for k, row in enumerate(rows):
        kind = ' class="grey"' if grey is not None and grey[k] else ""
        lines.append(f"<tr{kind}>" + "".join(_cell(value) for value in row) + "</tr>")
    return "\n".join([*lines, "</table>"])


def _cell(value: Any) -> str:
    text = str(value)
    number = isinstance(value, (int, float)) or text[:1].isdigit() or text[:2] in ("-0", "+0")
    return f'<td class="n">{escape(text)}</td>' if number and len(text) < 12 else f"<td>{escape(text)}</td>"


def _list(items: Iterable[str]) -> str:
    return "<ul>" + "".join(f"<li>{escape(item)}</li>" for item in items) + "</ul>"


def _picture(figure: Figure, text: str) -> str:
    """A figure inside the page."""
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=110)
    data = base64.b64encode(stream.getvalue()).decode()
    return f'<p><img alt="{escape(text)}" src="data:image/png;base64,{data}"></p>'
