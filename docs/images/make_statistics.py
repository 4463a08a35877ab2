"""Draws the pictures of `docs/statistics.md` from made-up measurements whose truth is known.

Run ``python docs/images/make_statistics.py``. The seed is fixed, so the pictures are the same each time.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from specan.report.figure_style import COLOURS, heading, legend_above, new_figure, styled

HERE = Path(__file__).parent
SIGMA = 0.02
X = np.repeat(np.linspace(0.5, 3.0, 12), 3)
RNG = np.random.default_rng(20)


def line(*columns: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Least squares: residual in sigma, and chi-square."""
    design = np.stack(columns, axis=1)
    z = (y - design @ np.linalg.lstsq(design, y, rcond=None)[0]) / SIGMA
    return z, float(z @ z)


@styled
def residuals() -> object:
    """A model that fits, and one that lacks a quadratic term."""
    one = np.ones_like(X)
    figure = new_figure(3.4)
    sheet = figure.subplots(1, 2, sharey=True)
    for axes, size, text in (
        (sheet[0], 0.0, "complete model"),
        (sheet[1], 0.06, "a quadratic term is missing"),
    ):
        z, chi2 = line(one, X, y=0.3 + 0.2 * X + size * X**2 + SIGMA * RNG.standard_normal(X.size))
        axes.axhspan(-2, 2, color="0.92", lw=0)
        axes.axhline(0, color="0.5", lw=0.8)
        axes.plot(X, z, "o", ms=4, color=COLOURS[0])
        axes.set_title(f"{text}: chi²/n = {chi2 / (X.size - 2):.2f}")
        axes.set_xlabel("Operating variable")
    sheet[0].set_ylabel("(Measured - model) / sigma")
    heading(
        figure,
        "Residuals in units of the uncertainty",
        "Grey: two standard uncertainties, 95 % of the values of a complete model",
    )
    return figure


@styled
def chance() -> object:
    """Gain of the best of many candidates when none of them is there."""
    trials, n = 4000, X.size
    gains = {}
    for count in (1, 12):
        best = np.zeros(trials)
        for k in range(trials):
            z = RNG.standard_normal(n)
            directions = RNG.standard_normal((count, n))
            directions /= np.linalg.norm(directions, axis=1, keepdims=True)
            best[k] = np.max((directions @ z) ** 2)
        gains[count] = best
    figure = new_figure(3.2, 6.4)
    axes = figure.subplots()
    edges = np.linspace(0, 22, 67)
    for (count, values), colour in zip(gains.items(), COLOURS):
        text = "one candidate" if count == 1 else f"best of {count} candidates"
        axes.hist(values, edges, histtype="step", color=colour, lw=1.5, label=text)
        limit = float(np.quantile(values, 0.99))
        axes.axvline(limit, color=colour, ls="--", lw=1)
        axes.annotate(f" 1 % above {limit:.1f}", (limit, trials / 6), color=colour, fontsize=8)
    axes.set(yscale="log", xlabel="Fall in chi-square by chance", ylabel="Data sets out of 4000")
    axes.yaxis.set_major_formatter("{x:g}")
    legend_above(axes)
    heading(figure, "The best of many candidates gains by chance alone")
    return figure


@styled
def left_out() -> object:
    """Error on fitted and on left-out conditions as terms are added."""
    y = 0.3 + 0.2 * X + 0.03 * X**2 + SIGMA * RNG.standard_normal(X.size)
    scaled = (X - X.mean()) / np.ptp(X)
    degrees = np.arange(0, 9)
    fitted, outside = [], []
    for degree in degrees:
        design = np.stack([scaled**k for k in range(degree + 1)], axis=1)
        coefficients = np.linalg.lstsq(design, y, rcond=None)[0]
        fitted.append(np.sqrt(np.mean((y - design @ coefficients) ** 2)))
        errors = []
        for level in np.unique(X):
            kept = level != X
            part = np.linalg.lstsq(design[kept], y[kept], rcond=None)[0]
            errors.append(y[~kept] - design[~kept] @ part)
        outside.append(np.sqrt(np.mean(np.concatenate(errors) ** 2)))
    figure = new_figure(3.2, 6.4)
    axes = figure.subplots()
    axes.plot(degrees, fitted, "o-", color=COLOURS[0], label="on fitted data")
    axes.plot(degrees, outside, "s--", color=COLOURS[1], label="in cross-validation")
    axes.axhline(SIGMA, color="0.5", lw=0.8, ls=":", label="noise")
    axes.set(xlabel="Terms added to a constant (the truth has two)", ylabel="RMS error", yscale="log")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set_yticks([0.02, 0.05, 0.1, 0.2], ["0.02", "0.05", "0.1", "0.2"])
    axes.yaxis.set_minor_formatter("")
    legend_above(axes)
    heading(
        figure,
        "The error on fitted data always falls",
        "The error on conditions that were left out falls while a term is real",
    )
    return figure


@styled
def alike() -> object:
    """Two explanations of the same residual, and where they part."""
    figure = new_figure(3.2, 6.4)
    axes = figure.subplots()
    x = np.linspace(0.5, 6.0, 200)
    power, root = 0.03 * x**2, -0.1245 + 0.1335 * x
    axes.axvspan(0.5, 3.0, color="0.93", lw=0, label="conditions that were measured")
    axes.errorbar(
        [1.0, 1.75, 2.5],
        [0.03, 0.092, 0.1875],
        yerr=2 * SIGMA,
        fmt="o",
        color="0.3",
        capsize=3,
        label="residual, 95 %",
    )
    axes.plot(x, power, color=COLOURS[0], label="effect A: x²")
    axes.plot(x, root, color=COLOURS[1], ls="--", label="effect B: a + b x")
    axes.annotate(
        "the next measurement",
        (5.0, 0.53),
        (3.4, 0.85),
        arrowprops={"arrowstyle": "->", "color": "0.3"},
        fontsize=8,
    )
    axes.set(xlabel="Operating variable", ylabel="Effect", ylim=(-0.1, 1.1))
    axes.legend(loc="upper left")
    heading(figure, "Two explanations that these data cannot distinguish")
    return figure


PICTURES = {
    "statistics_residuals": residuals,
    "statistics_chance": chance,
    "statistics_left_out": left_out,
    "statistics_alike": alike,
}

if __name__ == "__main__":
    for name, draw in PICTURES.items():
        draw().savefig(HERE / f"{name}.png", dpi=110)  # type: ignore[attr-defined]
