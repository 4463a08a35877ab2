"""The optimiser held to certified answers: the nonlinear regressions of NIST's Statistical Reference Datasets.

    python benchmarks/nist_strd.py [DIRECTORY]

DIRECTORY holds the .dat files as NIST publishes them (public domain); `tests/reference/nist_strd` by default. Each
is a model made from its formula, fitted from both starts. Printed are the certified digits, -log10 of the relative
error, of the worst parameter and of the worst standard error (after scaling by the residual standard deviation, as
NIST does): of specan, of scipy's curve_fit (MINPACK), and of lmfit where it is installed, from the same starts.
"""

from __future__ import annotations

import re
import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from specan.errors import SpecanError
from specan.models import Model
from specan.study.estimation.fit import fit
from specan.study.observation.table import TableObservation
from specan.study.selection.candidates import base_problem

MOST_DIGITS = 11.0  # to which NIST certifies
ENOUGH = 6.0
DATA = Path(__file__).parents[1] / "tests" / "reference" / "nist_strd"


@dataclass(frozen=True)
class Case:
    name: str
    formula: str
    predictors: dict[str, np.ndarray]
    y: np.ndarray
    starts: np.ndarray  # (2, parameters)
    certified: np.ndarray
    errors: np.ndarray
    residual_sd: float

    @property
    def names(self) -> list[str]:
        return [f"b{k + 1}" for k in range(self.certified.size)]

    def function(self):
        """The formula as a function of predictors and parameters."""
        names = ", ".join([*self.predictors, *self.names])
        place = {"exp": np.exp, "cos": np.cos, "sin": np.sin, "arctan": np.arctan, "pi": np.pi}
        exec(f"def y({names}):\n    return {self.formula}\n", place)
        return place["y"]


Solver = Callable[[Case, np.ndarray], tuple[np.ndarray, np.ndarray]]


def read(path: Path) -> Case:
    """A file of NIST: formula, starts, certified values, data."""
    lines = path.read_text().splitlines()
    rows = [
        [float(w) for w in m.group(1).split()]
        for line in lines
        if (m := re.match(r"\s*b\d+ =\s+(.*)$", line)) and len(m.group(1).split()) == 4
    ]
    numbers = np.array(rows)
    first = next(k for k, line in enumerate(lines) if re.match(r"\s*(log\[y\]|y)\s+=", line))
    formula = []
    for line in lines[first:]:
        if not line.strip():
            break
        formula.append(line.strip())
    text = " ".join(formula).split("=", 1)[1].rsplit("+ e", 1)[0].rsplit("+  e", 1)[0]
    text = text.replace("[", "(").replace("]", ")").strip().rstrip("+").strip()
    start = max(k for k, line in enumerate(lines) if line.startswith("Data:")) + 1
    data = np.array([[float(w) for w in line.split()] for line in lines[start:] if line.strip()])
    names = ["x"] if data.shape[1] == 2 else [f"x{k}" for k in range(1, data.shape[1])]
    y = np.log(data[:, 0]) if any("log[y]" in line for line in formula) else data[:, 0]
    return Case(
        path.stem,
        text,
        dict(zip(names, data.T[1:], strict=True)),
        y,
        numbers[:, :2].T,
        numbers[:, 2],
        numbers[:, 3],
        next(float(line.split(":")[1]) for line in lines if line.startswith("Residual Standard Deviation:")),
    )


def with_specan(case: Case, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Parameters, and their standard errors where every reading has the standard uncertainty 1."""
    model = Model.from_function(
        case.function(), conditions=dict.fromkeys(case.predictors, "1"), observables={"y": "1"},
        parameters=dict(zip(case.names, map(float, start), strict=True)), name=case.name,
    )  # fmt: skip
    rows = TableObservation(
        "nist", np.full(case.y.size, "y"), case.y, case.predictors, np.eye(case.y.size),
    )  # fmt: skip
    found = fit(base_problem(model, (rows,)))
    order = [found.names.index(f"y.{n}") for n in case.names]
    return found.theta[order], np.sqrt(np.diag(found.covariance))[order]


def with_scipy(case: Case, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same from MINPACK, through `scipy.optimize.curve_fit`."""
    from scipy.optimize import curve_fit

    function, x = case.function(), tuple(case.predictors.values())
    theta, covariance = curve_fit(
        lambda given, *b: function(*given, *b),
        x,
        case.y,
        p0=start,
        sigma=np.ones(case.y.size),
        absolute_sigma=True,
        maxfev=20000,
        xtol=1e-14,
        ftol=1e-14,
        gtol=1e-14,
    )
    return theta, np.sqrt(np.diag(covariance))


def with_lmfit(case: Case, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same from lmfit, with its own settings."""
    import lmfit

    model = lmfit.Model(case.function(), independent_vars=list(case.predictors))
    given = model.make_params(**dict(zip(case.names, map(float, start), strict=True)))
    found = model.fit(case.y, given, **case.predictors, scale_covar=False, max_nfev=20000)
    errors = [found.params[n].stderr for n in case.names]
    return np.array([found.params[n].value for n in case.names]), np.array(errors, dtype=float)


def residual_sd(case: Case, theta: np.ndarray) -> float:
    """Residual standard deviation, by which NIST scales standard errors."""
    rest = case.function()(*case.predictors.values(), *theta) - case.y
    return float(np.sqrt(rest @ rest / (case.y.size - theta.size)))


def digits(found: np.ndarray, certified: np.ndarray) -> float:
    """Certified digits of the worst value."""
    error = np.max(np.abs(found - certified) / np.abs(certified))
    return float(np.clip(-np.log10(max(error, 1e-300)), 0.0, MOST_DIGITS)) if np.isfinite(error) else 0.0


def scored(case: Case, start: np.ndarray, run: Solver) -> tuple[float, float, float]:
    """Digits of parameters, of standard errors, and of standard errors for the certified residual deviation."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        try:
            theta, errors = run(case, start)
            scale = residual_sd(case, theta)
        except (SpecanError, RuntimeError, ValueError, TypeError):
            return 0.0, 0.0, 0.0
        return (
            digits(theta, case.certified),
            digits(scale * errors, case.errors),
            digits(case.residual_sd * errors, case.errors),
        )


def main(directory: Path) -> None:
    solvers: dict[str, Solver] = {"specan": with_specan, "scipy": with_scipy}
    if find_spec("lmfit"):
        solvers["lmfit"] = with_lmfit
    print(f"{'':10}" + "".join(f"{s + ', start ' + str(k):>20}" for s in solvers for k in (1, 2)))
    passed = {(s, k): 0 for s in solvers for k in (0, 1)}
    paths, began = sorted(directory.glob("*.dat")), time.process_time()
    for path in paths:
        case = read(path)
        line = f"{case.name:10}"
        for solver, run in solvers.items():
            for k, start in enumerate(case.starts):
                found = scored(case, start, run)
                passed[solver, k] += min(found[:2]) >= ENOUGH
                line += f"{found[0]:14.1f}{found[1]:6.1f}"
        print(line, flush=True)
    print(f"{'6 digits':10}" + "".join(f"{n:>14} of {len(paths):2}" for n in passed.values()))
    print(f"{time.process_time() - began:.1f} CPU s")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else DATA)
