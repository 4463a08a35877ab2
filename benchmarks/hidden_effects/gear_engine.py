"""The study engine as the bench asks it about a planetary gear."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hidden_effects.gear_cases import Case
from specan.models.planetary_gear.build import build
from specan.study.data.open_orders import open_data
from specan.study.diagnose import diagnose as find_missing
from specan.study.estimation.fit import fit
from specan.study.estimation.problem import Problem
from specan.study.observation import DataFile, MeasuredFiles
from specan.study.selection.candidates import base_problem
from truth.planetary_gear import Gear


def diagnose(case: Case, directory: Path) -> dict[str, Any]:
    """Verdict on three recordings, as ``study diagnose --json`` gives it; reading them is part of its cost."""
    return find_missing(_problem(case, directory)).to_json()


def measure(case: Case, truth: Gear, directory: Path, verdict: Mapping[str, Any]) -> dict[str, Any]:
    """``lambda``: chi-square that the base leaves beyond its degrees of freedom; ``hidden``: true sizes."""
    problem = _problem(case, directory)
    best = fit(problem)
    return {
        "lambda": max(best.chi2 - problem.n_effective, 0.0), "d": None, "hidden": truth.machine.hidden,
        "teeth": [truth.machine.z_sun, truth.machine.z_planet, truth.machine.z_ring, truth.machine.planets],
    }  # fmt: skip


def _problem(case: Case, directory: Path) -> Problem:
    model = build(tomllib.loads((directory / "rig.toml").read_text(encoding="utf-8")))
    gear = case.simulate()
    paths = [directory / f"run_{run.sun_hz:.0f}Hz_{run.torque:.0f}Nm.tdms" for run in gear.runs]
    return base_problem(model, open_data(model, MeasuredFiles([DataFile(p.name, p) for p in paths])).fitted)
