"""The study engine as the bench asks it about a planetary gear."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hidden_effects.gear_cases import Case
from specan.models import Model, Use
from specan.planetary_gear.model.build import build
from specan.planetary_gear.study.open_orders import open_data
from specan.study.diagnose import diagnose as find_missing
from specan.study.estimation.fit import fit
from specan.study.estimation.prediction_error import held_out_error
from specan.study.estimation.problem import Problem
from specan.study.observation import DataFile, MeasuredFiles, OpenedData
from specan.study.selection.candidates import base_problem
from truth.planetary_gear import Gear
from truth.planetary_gear.recorded import Run


def diagnose(case: Case, directory: Path) -> dict[str, Any]:
    """Verdict on three recordings, as ``study diagnose --json`` gives it; reading them is part of its cost."""
    return find_missing(_problem(case, directory)).to_dict()


def measure(case: Case, truth: Gear, directory: Path, verdict: Mapping[str, Any]) -> dict[str, Any]:
    """What the data know, out of the fits of the verdict; the noise is in it.

    Returns
    -------
    dict
        ``lambda``: chi-square that the base leaves beyond its degrees of freedom. ``d``: twice ln of the evidence of
        the right effects over the best set without one of them; where they were not refitted, after a fit of them.
        ``conditional_lambda``: of a pair, the same over the better one of its effects alone. ``hidden``: true sizes.
        ``covered``: whether the 95 % interval holds the true size. ``held_out``: of a pin, RMS (m/s^2) and level
        error of lines (dB) on the torque that was held out, before and after it is added.
    """
    lack = verdict["lack_of_fit"]
    names = set(case.truth)
    wrong = [2 * r["ln_evidence"] for r in verdict["ranking"] if not names <= set(r["effects"])]
    right = next((r for r in verdict["ranking"] if set(r["effects"]) == names), None)
    gain = 2 * right["ln_evidence"] if right else _gain_of(case, truth, directory) if names else 0.0
    return {
        "lambda": max((lack["reduced_chi2"] - 1) * lack["n_effective"], 0.0),
        "d": gain - max([0.0, *wrong]) if names else None,
        "conditional_lambda": gain
        - max([0.0, *(2 * r["ln_evidence"] for r in verdict["ranking"] if set(r["effects"]) < names)]),
        "hidden": truth.machine.hidden,
        "covered": _covered(truth, right) if right else None,
        "held_out": _held_out(case, truth, directory, right)
        if right and "planet-position-error" in names
        else None,
        "teeth": [truth.machine.z_sun, truth.machine.z_planet, truth.machine.z_ring, truth.machine.planets],
    }


_SIZE = {"planet-position-error": ("error", "error_um"), "unequal-load-sharing": ("share", "share")}


def _covered(truth: Gear, right: Mapping[str, Any]) -> bool | None:
    """Whether the interval of a size that model and simulator mean alike holds the true one."""
    for effect, (own, name) in _SIZE.items():
        rows = [v for k, v in right["parameters"].items() if k.startswith(effect) and k.endswith(own)]
        if name in truth.machine.hidden.get(effect, ()) and rows:
            return bool(rows[0]["low"] <= truth.machine.hidden[effect][name] <= rows[0]["high"])
    return None


def _held_out(
    case: Case, truth: Gear, directory: Path, right: Mapping[str, Any]
) -> list[tuple[float, float | None]]:
    problem = _problem(case, directory)
    unseen = _opened(problem.assembly.model, directory, truth.runs, [truth.held_out]).held_out
    uses = _uses(truth)
    richer = problem.with_uses(uses)
    names = [name for name in right["parameters"] if name in richer.assembly.parameters]
    start = {n: richer.assembly.parameters[n].to_si(right["parameters"][n]["value"]) for n in names}
    base = fit(problem)
    errors = [
        held_out_error(p, f, unseen).errors[0]
        for p, f in ((problem, base), (richer, fit(richer, start={**base.values, **start})))
    ]
    return [(error.rms, error.level_dB) for error in errors]


def _uses(truth: Gear) -> list[Use]:
    return [
        Use(name, f"P{int(size['planet'])}" if "planet" in size else "")
        for name, size in truth.machine.hidden.items()
    ]


def _gain_of(case: Case, truth: Gear, directory: Path) -> float:
    """Fall in BIC by the hidden effects, from a fit of them."""
    problem = _problem(case, directory)
    base, richer = fit(problem), problem.with_uses(_uses(truth))
    found = fit(richer, start=base.values, starts=3)
    more = len(found.theta) - len(base.theta)
    return float(base.chi2 - found.chi2 - more * np.log(problem.n_effective))


def _problem(case: Case, directory: Path) -> Problem:
    model = build(tomllib.loads((directory / "rig.toml").read_text(encoding="utf-8")))
    return base_problem(model, _opened(model, directory, case.simulate().runs).fitted)


def _opened(model: Model, directory: Path, runs: Sequence[Run], held_out: Sequence[Run] = ()) -> OpenedData:
    fitted, unseen = (
        [
            DataFile(name, directory / name)
            for run in part
            if (name := f"run_{run.sun_hz:.0f}Hz_{run.torque:.0f}Nm.tdms")
        ]
        for part in (runs, held_out)
    )
    return open_data(model, MeasuredFiles(fitted, unseen))
