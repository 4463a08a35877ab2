"""Figures of a diagnosis: how well each candidate explains the data, and what a further reading would tell."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from specan.errors import RequestError
from specan.report.figure_style import COLOURS
from specan.report.study_report import verdict_line
from specan.study.verdict import Diagnosis, Ranked

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_ROWS = 20
_LINEAR = 10.0  # fall in BIC up to which the axis is linear


def figure_diagnosis(found: Diagnosis) -> Figure:
    """Fall in BIC of every refitted candidate; those that the verdict names are dark, implausible ones hatched.

    Raises
    ------
    RequestError
        Nothing was refitted.
    """
    from matplotlib.figure import Figure  # not pyplot: no window, no global state

    ranked = found.ranking[:MOST_ROWS]
    if not ranked:
        raise RequestError("no candidate was refitted: there is nothing to draw", remedy="leave out --plot")
    figure = Figure(figsize=(8.0, 1.6 + 0.3 * len(ranked)), layout="constrained")
    axes = figure.subplots()
    places, gains = np.arange(len(ranked)), np.array([r.delta_bic for r in ranked])
    named = np.arange(len(ranked)) < len(found.alternatives)
    for place, row, gain, asked in zip(places, ranked, gains, named, strict=True):
        axes.barh(
            place, gain, color=COLOURS[0] if asked else COLOURS[4], alpha=1.0 if row.plausible else 0.35,
            hatch="" if row.plausible else "///",
        )  # fmt: skip
        text = f" p {row.p_value:.1g}" + ("" if row.plausible else ", implausible")
        axes.annotate(text, (max(gain, 0.0), place), va="center", fontsize="x-small")
    axes.set_xscale("symlog", linthresh=_LINEAR)
    low, high = axes.get_xlim()
    axes.set_xlim(min(low, -1.0), max(high, 1.0) * 8)
    axes.axvline(0, color="0.4", linewidth=0.8)
    axes.set_yticks(places, [_name(row) for row in ranked])
    axes.set_ylim(len(ranked) - 0.4, -0.6)
    axes.set_xlabel("Fall in BIC; dark: named by the verdict")
    axes.grid(True, axis="x", color="0.9")
    axes.set_axisbelow(True)
    axes.set_title(verdict_line(found), fontsize="medium", loc="left", wrap=True)
    return figure


def _name(row: Ranked) -> str:
    places = {name: list(found) for name, found in row.at.items()}
    parts = [f"{n}@{places[n].pop(0)}" if places.get(n) else n for n in row.effects]
    return " + ".join(parts).replace("$", r"\$")


def figure_next(rows: Sequence[dict[str, Any]]) -> Figure:
    """What the rivals expect of each proposed reading; the bars are two standard uncertainties of a reading.

    Raises
    ------
    RequestError
        No condition is proposed.
    """
    from matplotlib.figure import Figure

    shown = [row for row in rows if row["predictions"]]
    if not shown:
        raise RequestError("no condition is proposed: there is nothing to draw", remedy="leave out --plot")
    most = max(len(row["predictions"]) for row in shown)
    figure = Figure(figsize=(8.0, len(shown) * (1.1 + 0.3 * most)), layout="constrained")
    for axes, row in zip(figure.subplots(len(shown), 1, squeeze=False)[:, 0], shown, strict=True):
        values = list(row["predictions"].values())
        reach = None if row["sigma"] is None else 2 * row["sigma"]
        for place, value in enumerate(values):
            axes.errorbar(value, place, xerr=reach, fmt="o", color=COLOURS[place % len(COLOURS)], capsize=3)
        axes.set_yticks(range(len(values)), [name.replace("$", r"\$") for name in row["predictions"]])
        axes.set_ylim(len(values) - 0.4, -0.6)
        unit = "" if row["unit"] in ("", "1") else f" / {row['unit']}"
        axes.set_xlabel(f"expected reading{unit}; bars: two standard uncertainties of it")
        axes.grid(True, axis="x", color="0.9")
        where = ", ".join(f"{name} = {value:.4g}" for name, value in row["conditions"].items())
        apart = "" if row["separation_sigma"] is None else f": {row['separation_sigma']:.1f} sigma apart"
        axes.set_title(f"{where}{apart}".replace("$", r"\$"), fontsize="medium", loc="left")
    return figure
