"""Figures of a diagnosis: how well each candidate explains the data, and what a further reading would tell."""

from __future__ import annotations

from matplotlib.figure import Figure

from specan.errors import RequestError
from specan.report.figure_style import COLOURS, heading, name_rows, new_figure, styled
from specan.study.verdict import Diagnosis, NextMeasurements, headline, percent
from specan.units import axis_label

MOST_ROWS = 16


@styled
def figure_diagnosis(found: Diagnosis) -> Figure:
    """RMS error that each refitted candidate leaves, beside that of the model as it is.

    Those that the verdict names are dark, the others pale; those with implausible values are hatched.

    Raises
    ------
    RequestError
        Nothing was refitted.
    """
    ranked = found.ranking[:MOST_ROWS]
    if not ranked:
        raise RequestError("no candidate was refitted: there is nothing to draw", remedy="leave out --plot")
    now = found.error.before if found.error is not None else None
    first = 0 if now is None else 1
    figure = new_figure(2.1 + 0.24 * (len(ranked) + first))
    axes = figure.subplots()
    named = len(found.alternatives) if found.verdict in ("effect", "group", "fits-only-if") else 0
    if now is not None:
        axes.barh(0, now.rms, color="0.6", height=0.72)
        axes.annotate(f" {now.rms:.3g}", (now.rms, 0), va="center", fontsize=8, color="0.3")
    for place, row in enumerate(ranked, first):
        axes.barh(
            place, row.error_after, height=0.72, edgecolor="white" if row.plausible else "0.35", linewidth=0.0,
            color=COLOURS[0] if place - first < named else "#bcd6e6", hatch="" if row.plausible else "////",
        )  # fmt: skip
        beside = f" {row.error_after:.3g}   {percent(row.probability)}" + (
            "" if row.plausible else "   implausible"
        )
        axes.annotate(beside, (row.error_after, place), va="center", fontsize=8, color="0.3")
    name_rows(axes, [*(["model as it is"] if first else []), *(" + ".join(row.names) for row in ranked)])
    axes.set_xlim(0, 1.28 * max([row.error_after for row in ranked] + [now.rms if now else 0.0]))
    what = f"RMS error of {now.observable}" if now else "RMS error"
    axes.set_xlabel(axis_label(f"Remaining {what}", now.unit if now else "1"))
    fit = (
        "" if found.lack_of_fit is None else f"Model as it is: chi²/n {found.lack_of_fit.reduced_chi2:.3g}. "
    )
    heading(
        figure, headline(found),
        fit + "Dark: named by the verdict. Hatched: with values that are not plausible. Beside each bar: remaining "
        "error, probability.",
    )  # fmt: skip
    return figure


@styled
def figure_next(found: NextMeasurements) -> Figure:
    """What the rivals expect of each proposed reading; the bars are two standard uncertainties of a reading.

    Raises
    ------
    RequestError
        No condition is proposed.
    """
    shown = [row for row in found.rows if row["predictions"]]
    if not shown:
        raise RequestError("no condition is proposed: there is nothing to draw", remedy="leave out --plot")
    most = max(len(row["predictions"]) for row in shown)
    figure = new_figure(1.3 + len(shown) * (0.65 + 0.2 * most))
    for axes, row in zip(figure.subplots(len(shown), 1, squeeze=False)[:, 0], shown, strict=True):
        values = list(row["predictions"].values())
        reach = None if row["sigma"] is None else 2 * row["sigma"]
        for place, value in enumerate(values):
            axes.errorbar(value, place, xerr=reach, fmt="o", color=COLOURS[place % len(COLOURS)], capsize=3)
        name_rows(axes, list(row["predictions"]))
        apart = "" if row["separation_sigma"] is None else f": {row['separation_sigma']:.1f} sigma apart"
        axes.set_title(row["text"].partition(":")[0] + apart)
    axes.set_xlabel(axis_label("Expected reading", shown[-1]["unit"]))
    bars = "bars: two standard uncertainties of it"
    heading(figure, "The next measurement", f"What each candidate expects of a reading; {bars}")
    return figure
