"""A study on one page that a colleague can read: self-contained, no outside address."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import TYPE_CHECKING, Any

from specan import __version__
from specan.report.figures_study import figure_compare, figure_history, figure_map
from specan.report.html_page import bullets, page, picture, table
from specan.report.residual_map import map_axes
from specan.study.study_file import NAME

if TYPE_CHECKING:
    from specan.study.study import Study
    from specan.study.verdict import Diagnosis


def study_report(study: Study) -> str:
    """The page as HTML.

    Every name and text of the study is shown as text, never as markup.
    """
    diagnosis = study.diagnose() if study.data.known else None
    parts = [
        f"<h1>{escape(study.directory.resolve().name)}</h1>",
        f"<p>{escape(study.model.title)}. Effects of the model: "
        f"{escape(', '.join(study.model_effects) or f'none, {study.model.words.ideal}')}.</p>",
        *_comparison(study),
        *(_diagnosis(diagnosis) if diagnosis else []),
        *_history(study),
        *_assumptions(study),
        *_reproduce(study),
    ]
    return page(study.directory.resolve().name, parts)


def _comparison(study: Study) -> list[str]:
    found = study.compare()
    best, where = found.fit, found.localisation
    parts = ["<h2>Measured and model</h2>"]
    rows = [("fitted", e) for e in found.errors]
    rows += [("held out", e) for e in (study.held_out.errors if study.held_out else ())]
    parts.append(
        table(
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
        parts.append(bullets(where.sentences()))
    parts.append(picture(figure_compare(study), "measured values and model"))
    if where is not None and map_axes(study.problem.observations[0].labels):
        parts.append(picture(figure_map(study), "where the model fails"))
    rows_ = [
        [name, f"{p['value']:.4g}", f"{p['low']:.4g} to {p['high']:.4g}", _unit(p), _remark(p)]
        for name, p in found.parameters.items()
    ]
    parts += ["<h3>Parameters</h3>", table(["parameter", "value", "95 %", "unit", ""], rows_)]
    return parts


def _unit(p: Mapping[str, Any]) -> str:
    return "" if p["unit"] == "1" else str(p["unit"])


def _remark(p: Mapping[str, Any]) -> str:
    if p["at_bound"]:
        return "at the end of its domain"
    if not p["plausible"]:
        return "not plausible"
    return "instrument, held by its certificate" if p["nuisance"] else ""


def _diagnosis(found: Diagnosis) -> list[str]:
    parts = [
        "<h2>What is missing</h2>",
        f'<p class="verdict">{escape(verdict_line(found))}</p>',
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
        parts.append(table(header, rows, grey))
    visible = [
        [n, "invisible at any plausible size" if v is None else f"{v['value']:.2g} {v['unit']}"]
        for n, v in found.smallest_visible.items()
    ]
    visible += [[n, f"not testable: {why}"] for n, why in found.not_testable.items()]
    if visible:
        parts += ["<h3>Smallest effect that these data would show</h3>", table(["effect", "size"], visible)]
    if found.next_measurement:
        parts += ["<h3>What would decide</h3>", bullets(str(row["text"]) for row in found.next_measurement)]
    return parts


def verdict_line(found: Diagnosis) -> str:
    """Verdict and what it names: ``group: windage or seal-drag``."""
    names = " or ".join(" with ".join(members) for members in found.alternatives)
    return found.verdict + (f": {names}" if names else "")


def _value(name: str, p: Mapping[str, Any]) -> str:
    return f"{name} = {p['value']:.3g} ({p['low']:.3g} to {p['high']:.3g}) {_unit(p)}".rstrip()


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
    return ["<h2>History</h2>", table(header, rows), picture(figure_history(steps), "errors of the steps")]


def _assumptions(study: Study) -> list[str]:
    parts = ["<h2>What was found and assumed</h2>", bullets(study.data.statements)]
    defaults = study.model.rig.defaults_used
    if defaults:
        parts.append(table(["rig default", "value"], [[k, v] for k, v in defaults.items()]))
    return parts


def _reproduce(study: Study) -> list[str]:
    hashes = study.hashes
    rows = [[name, sha] for name, sha in {**hashes["files"], **hashes["effect_files"]}.items()]
    rows += [[study.content.rig, hashes["rig"]]]
    text = (study.directory / NAME).read_text(encoding="utf-8")
    return [
        "<h2>To have these numbers again</h2>",
        f"<p>specan {escape(__version__)}; the files below by their SHA-256, and this {NAME}:</p>",
        table(["file", "sha256"], rows),
        f"<pre>{escape(text)}</pre>",
    ]
