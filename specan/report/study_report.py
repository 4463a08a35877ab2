"""A study on one page that a colleague can read: self-contained, no outside address.

The page begins with the story: what was missing, and what that did to the error. Parameters, candidates that were
rejected and what is needed to repeat the numbers come last.
"""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from itertools import pairwise
from pathlib import Path
from typing import Any

from specan import __version__
from specan.io.output_file import check_directory, text_file
from specan.report import study_sheets
from specan.report.figures_steps import figure_diagnosis, figure_history
from specan.report.figures_study import figure_comparison
from specan.report.html_page import bullets, page, picture, shown, table
from specan.report.residual_map import failing_map, residual_map
from specan.report.study_sheets import allowed_for, fall_text
from specan.study.comparison import Comparison
from specan.study.history import History, Step, error_pairs
from specan.study.study import Study
from specan.study.study_file import NAME
from specan.study.verdict import Diagnosis, headline, headline_of, reason

MOST_RIVALS = 5  # candidates that a step names beside the one that was added
MOST_REJECTED = 30
CHANGES = {"add": "was missing. With it", "drop": "was taken out. Without it"}


def write_study_report(study: Study, path: Path) -> None:
    """Write the page to a file; its directory must exist."""
    check_directory(path)
    page = study_report(study)
    with text_file(path) as file:
        file.write(page)


def study_report(study: Study) -> str:
    """The page as HTML.

    Every name and text of the study is shown as text, never as markup.
    """
    diagnosis = study.diagnose() if study.data.known else None
    comparison = study.compare()
    name = study.directory.resolve().name
    parts = [
        f"<h1>{escape(name)}</h1>",
        f"<p>{escape(study.model.title)}. Effects of the model: "
        f"{escape(', '.join(study.model_effects) or f'none, {study.model.words.ideal}')}.</p>",
        *_story(study.history, diagnosis),
        *_steps(study),
        *_comparison(study, comparison),
        *_what_is_missing(diagnosis),
        *_assumptions(study),
        "<h2>Parameters</h2>",
        shown(study_sheets.parameters(comparison.parameters)),
        *_rejected(diagnosis),
        "<h2>History</h2>",
        shown(study_sheets.history(study.history.steps)),
        *_reproduce(study),
    ]
    return page(name, parts)


def _story(history: History, diagnosis: Diagnosis | None) -> list[str]:
    """What was missing, what that did to the errors, and the error after each step."""
    lines = []
    for before, after in pairwise(history.steps):
        if after.action in CHANGES:
            text = f"{after.effect} {CHANGES[after.action]} the error {_falls(before, after)}."
            lines.append(text[:1].upper() + text[1:])
    if diagnosis is not None:
        lines.append(("Now: " if lines else "") + headline(diagnosis))
    parts = [f'<p class="verdict">{escape(line)}</p>' for line in lines]
    if history.steps:
        parts.append(picture(figure_history(history), "error after each step"))
    return parts


def _falls(before: Step, after: Step) -> str:
    return ", and ".join(
        f"on {kind} data {'went from' if a != b else 'stayed at'} {fall_text(a, b)}"
        for kind, a, b in error_pairs(before, after)
    )


def _steps(study: Study) -> list[str]:
    """Each change of the model with the diagnosis that led to it."""
    steps, parts = study.history.steps, []
    for before, after in pairwise(steps):
        if after.action not in CHANGES:
            continue
        parts.append(f"<h3>Step {after.step}: {escape(f'{after.action} {after.effect}')}</h3>")
        if after.because:
            parts.append(f"<p>Reason given: {escape(after.because)}</p>")
        parts += _led_to(after.diagnosis, before)
    return ["<h2>How each step came about</h2>", *parts] if parts else []


def _led_to(content: Mapping[str, Any] | None, before: Step) -> list[str]:
    if content is None:
        return ["<p>No diagnosis was made of the model as it was before this step.</p>"]
    parts = [f"<p><b>{escape(headline_of(content))}</b> {escape(reason(content))}</p>"]
    sheet = study_sheets.candidates(content, MOST_RIVALS)
    if sheet.rows:
        now = ["model as it was", f"{before.fit_error['value']:.3g}", *[""] * (len(sheet.header) - 2)]
        parts.append(table(sheet.header, [now, *sheet.rows]))
    return parts


def _comparison(study: Study, found: Comparison) -> list[str]:
    best, where = found.fit, found.localisation
    parts = ["<h2>Measured and model</h2>", picture(figure_comparison(found), "measured values and model")]
    aside = study.held_out.errors if study.held_out else []
    kinds = ["fitted"] * len(found.errors) + ["held out"] * len(aside)
    parts.append(shown(study_sheets.errors([*found.errors, *aside], data=kinds)))
    if where is not None:
        allowed = f"{text[:1].upper()}{text[1:]}." if (text := allowed_for(study)) else ""
        held = f"; on held-out data {study.held_out.reduced_chi2:.2f}" if study.held_out else ""
        parts.append(
            f"<p>Reduced chi-square {best.reduced_chi2:.2f} ({escape(study_sheets.chance(best.p_value))}, "
            f"{best.n_effective:.0f} independent values){held}. {escape(allowed)}</p>"
        )
        parts.append(bullets(where.sentences()))
        parts.append(failing_map(residual_map(study.problem, study.shown), study.data.known))
    return parts


def _what_is_missing(found: Diagnosis | None) -> list[str]:
    if found is None:
        return []
    parts = [
        "<h2>What is missing now</h2>",
        f"<p><b>{escape(headline(found))}</b> {escape(reason(found.to_dict()))}</p>",
    ]
    if found.residual_law is not None:
        parts.append(f"<p>A law of this form would fit better: {escape(found.residual_law['text'])}.</p>")
    parts += [f"<p>{escape(remark[:1].upper() + remark[1:])}.</p>" for remark in found.remarks]
    if found.ranking:
        parts.append(picture(figure_diagnosis(found), "error that each candidate leaves"))
    if found.next_measurement:
        parts += [
            "<h3>The next measurement</h3>",
            bullets(str(row["text"]) for row in found.next_measurement),
        ]
    return parts


def _assumptions(study: Study) -> list[str]:
    parts = ["<h2>What was found and assumed</h2>", bullets(study.data.statements)]
    defaults = study.model.rig.defaults_used
    if defaults:
        parts.append(table(["rig default", "value"], [[k, v] for k, v in defaults.items()]))
    return parts


def _rejected(found: Diagnosis | None) -> list[str]:
    """Everything that was tried of the model as it is, and what these data could not have shown."""
    if found is None:
        return []
    parts = []
    if found.ranking:
        sheet = study_sheets.candidates(found.to_dict(), MOST_REJECTED, valued=True)
        parts += ["<h2>Candidates tested</h2>", shown(sheet)]
    sheet, names = study_sheets.visible(found)
    hidden = [[name, "not detectable in its range", ""] for name in names]
    hidden += [[n, f"not testable: {why}", ""] for n, why in found.not_testable.items()]
    if sheet.rows or hidden:
        parts += [f"<h2>{sheet.title}</h2>", table(sheet.header, [*sheet.rows, *hidden])]
    return parts


def _reproduce(study: Study) -> list[str]:
    hashes = study.hashes
    rows = [[name, sha] for name, sha in {**hashes["files"], **hashes["effect_files"]}.items()]
    rows += [[study.content.rig, hashes["rig"]]]
    text = (study.directory / NAME).read_text(encoding="utf-8")
    return [
        "<h2>To reproduce these numbers</h2>",
        f"<p>specan {escape(__version__)}; the files below by their SHA-256, and this {NAME}:</p>",
        table(["file", "sha256"], rows),
        f"<pre>{escape(text)}</pre>",
    ]
