"""PySINDy and gplearn on the sealed cases of `proposed_laws.py`: what they find, and how it predicts fresh rows.

``python benchmarks/proposed_laws_by_peers.py [--seeds 100] [--genetic 20] [--first 5000]``, with pysindy and gplearn.
Neither holds a known model beside the term that it looks for. So that they need not, PySINDy gets readings and library
with the known model projected out, gplearn the residual of its fit; with what they find, the known model is fitted
again. PySINDy's library has the functions of the grammar at some widths, and their products with powers; its
threshold, or number of terms, is chosen by cross-validation. Counted: whether the function of the hidden law is in the
support, terms, held-out RMS over that of the true law with its numbers fitted, and data without a law in which terms
are found.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable
from contextlib import suppress

import numpy as np
from proposed_laws import Sealed, base_columns, draw, fitted_error, of_truth

PLACES = 4  # widths and onsets of each function in the library, in equal ratios over the data
POWERS = (-2.0, -1.0, -0.5, 0.5, 1.0, 2.0, 3.0)
THRESHOLDS = np.geomspace(0.01, 1.0, 12)  # of standardised columns, chosen by cross-validation
FOLDS = 5
MOST_TERMS = 6  # of the greedy search
POPULATION, GENERATIONS = 1000, 20  # gplearn's defaults


def library(spans: dict[str, tuple[float, float]]) -> list[tuple[str, Callable[[dict], np.ndarray]]]:
    """Functions of one variable as in the grammar, each with its family and variable."""
    found: list[tuple[str, Callable[[dict], np.ndarray]]] = []
    for v, (low, high) in spans.items():
        found += [(f"power of {v}", lambda t, v=v, p=p: t[v] ** p) for p in POWERS]
        for w in np.geomspace(low * (high / low) ** 0.15, low * (high / low) ** 0.7, PLACES):
            kinds: dict[str, Callable[[np.ndarray, float], np.ndarray]] = {
                "exponential": lambda x, w: np.exp(-x / w),
                "gaussian": lambda x, w: np.exp(-((x / w) ** 2)),
                "hyperbola": lambda x, w: 1 / (1 + x / w),
                "saturation": lambda x, w: x / (x + w),
                "tanh": lambda x, w: np.tanh(x / w),
                "onset": lambda x, w: np.maximum(x - w, 0.0),
                "resonance": lambda x, w: 1 / np.hypot(1 - (x / w) ** 2, 0.2 * x / w),
            }
            found += [(f"{n} of {v}", lambda t, v=v, w=w, f=f: f(t[v], w)) for n, f in kinds.items()]
    return found


def sindy(s: Sealed, method: str) -> tuple[set[tuple[str, ...]], int, float]:
    """Families in the support, number of terms, RMS error on fresh rows."""
    import pysindy

    spans = {v: (float(x.min()), float(x.max())) for v, x in s.table.items()}
    singles = [(frozenset([n]), f) for n, f in library(spans)]
    products = [
        (n | {f"power of {v}"}, lambda t, f=f, v=v, p=p: f(t) * t[v] ** p)
        for n, f in singles for v in spans if not next(iter(n)).endswith(v) for p in (-1.0, 1.0, 2.0)
    ]  # fmt: skip
    terms = [*singles, *products]
    own, own_there = base_columns(s.base, s.truth, s.table), base_columns(s.base, s.truth, s.fresh)
    here = np.column_stack([f(s.table) for _, f in terms])
    there = np.column_stack([f(s.fresh) for _, f in terms])
    basis, _ = np.linalg.qr(own)
    free, y = here - basis @ (basis.T @ here), s.measured - basis @ (basis.T @ s.measured)
    left = np.linalg.norm(free, axis=0)
    kept = np.flatnonzero(left > 1e-6 * np.linalg.norm(here, axis=0))  # the others are what the model has
    terms, here, there = [terms[k] for k in kept], here[:, kept], there[:, kept]
    free, y = free[:, kept] / left[kept], y / np.linalg.norm(y)

    def fitted(rows: np.ndarray, setting: float) -> np.ndarray:
        if method == "FROLS":
            optimizer = pysindy.FROLS(max_iter=int(setting), alpha=1e-9)
        else:
            optimizer = pysindy.STLSQ(threshold=setting, alpha=1e-6, max_iter=20)
        optimizer.fit(free[rows], y[rows, None])
        return np.asarray(optimizer.coef_).ravel()

    order = np.random.default_rng(0).permutation(y.size)
    parts = np.array_split(order, FOLDS)
    settings = range(1, MOST_TERMS + 1) if method == "FROLS" else THRESHOLDS
    losses = {}
    for setting in settings:
        with suppress(ValueError):  # FROLS: no further column that is not a sum of those it has
            losses[setting] = sum(
                float(np.sum((free[p] @ fitted(np.setdiff1d(order, p), setting) - y[p]) ** 2)) for p in parts
            )
    best = min(losses, key=lambda setting: losses[setting], default=None)
    support = np.flatnonzero(fitted(order, best)) if best is not None else np.empty(0, int)
    error = fitted_error(
        np.column_stack([own, here[:, support]]),
        np.column_stack([own_there, there[:, support]]),
        s.measured,
        s.target,
    )
    return {tuple(sorted(terms[k][0])) for k in support}, support.size, error


def genetic(s: Sealed, seed: int) -> tuple[str, int, float]:
    """Formula for the residual of the fitted model, its length, RMS error on fresh rows."""
    from gplearn.genetic import SymbolicRegressor

    own, own_there = base_columns(s.base, s.truth, s.table), base_columns(s.base, s.truth, s.fresh)
    solution, *_ = np.linalg.lstsq(own, s.measured, rcond=None)
    left = s.measured - own @ solution
    here, there = np.column_stack([*s.table.values()]), np.column_stack([*s.fresh.values()])
    model = SymbolicRegressor(
        population_size=POPULATION, generations=GENERATIONS, parsimony_coefficient=0.001, random_state=seed,
        function_set=("add", "sub", "mul", "div", "sqrt", "log", "abs", "neg", "inv", "max"),
    )  # fmt: skip
    model.fit(here, left / np.std(left))
    column, column_there = model.predict(here), model.predict(there)
    error = fitted_error(
        np.column_stack([own, column]), np.column_stack([own_there, column_there]), s.measured, s.target
    )
    return str(model._program), int(model._program.length_), error


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--genetic", type=int, default=20, help="cases for gplearn, which takes longest")
    parser.add_argument("--first", type=int, default=5000)
    asked = parser.parse_args()
    warnings.filterwarnings("ignore")  # of ill-conditioned libraries, one for each threshold
    seeds = range(asked.first, asked.first + asked.seeds)
    for method in ("STLSQ", "FROLS"):
        named, terms, ratios, spent = 0, [], [], []
        for seed in seeds:
            s = draw(seed, null=False)
            began = time.process_time()
            families, count, error = sindy(s, method)
            spent.append(time.process_time() - began)
            named += s.hidden.family in families
            terms.append(count)
            ratios.append(error / of_truth(s))
        false = sum(sindy(draw(seed, null=True), method)[1] > 0 for seed in seeds)
        _print(f"PySINDy {method}", named, len(seeds), terms, ratios, spent)
        print(f"  terms where nothing is hidden: {false}/{len(seeds)}", flush=True)
    terms, ratios, spent = [], [], []
    for seed in range(asked.first, asked.first + asked.genetic):
        s = draw(seed, null=False)
        began = time.process_time()
        formula, length, error = genetic(s, seed)
        spent.append(time.process_time() - began)
        terms.append(length)
        ratios.append(error / of_truth(s))
        print("  ", s.hidden.family, formula[:150], f"{ratios[-1]:.2f}", flush=True)
    if asked.genetic:
        _print("gplearn", None, asked.genetic, terms, ratios, spent)


def _print(name: str, named: int | None, of: int, terms: list, ratios: list, spent: list) -> None:
    right = "no families" if named is None else f"true family in the result: {named}/{of}"
    above = sum(r > 1.3 for r in ratios)
    print(f"{name}: {right}; terms: median {np.median(terms):g}, most {max(terms)}")
    print(
        "  held-out RMS over that of the true law: "
        f"median {np.median(ratios):.2f}, 90 % {np.quantile(ratios, 0.9):.2f}, above 1.3 {above}/{of}"
    )
    print(f"  CPU s: median {np.median(spent):.2f}")


if __name__ == "__main__":
    main()
