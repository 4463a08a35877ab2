"""The study engine as the bench asks it about a room, what the data could know, and what adding the effect does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from hidden_effects.room_cases import Case
from specan.errors import ComputationError
from specan.io.open import open_recording
from specan.models import Use
from specan.room.study.estimate_frf import observe_recording
from specan.room.study.of_field import initial_fit
from specan.study.create import begin
from specan.study.edit import add_effect
from specan.study.estimation.fit import fit
from specan.study.estimation.prediction_error import HeldOut
from specan.study.estimation.problem import Problem
from specan.study.evidence.explanations import Form
from specan.study.evidence.promises import Promise
from specan.study.observation.frf import FrfObservation
from specan.study.progress import unheard
from specan.study.selection.refits import Refit, Refits
from specan.study.study import Study
from truth.room import EFFECTS, RoomCase

STARTS = 2
RIVALS = 2  # wrong candidates that are refitted: those that promise most when linearised
_PLACES = {"wall": "{}", "microphone": "Mic {:.0f}", "card": "card {:.0f}", "edge": "{}"}


def diagnose(case: Case, directory: Path) -> dict[str, Any]:
    """Verdict on a recording, as ``study diagnose --json`` gives it; reading and fitting are part of its cost."""
    return _study(directory, case).diagnose().to_dict()


def measure(case: Case, truth: RoomCase, directory: Path, verdict: Mapping[str, Any]) -> dict[str, Any]:
    """lambda and D from noise-free data, the truth's places, and the held-out error after adding what was named.

    Returns
    -------
    dict
        ``lambda``, ``left``, ``d``, ``rival``, ``conditional_lambda``, ``planted``: as for the worm gear, but beyond
        ``misfit``, which the base leaves of the same room without effects (of a null it is lambda), and of the wrong
        candidates only the `RIVALS` that promise most are refitted.
        ``at``: wall, microphone, card or edge of each hidden effect.
        ``base``: reduced chi-square of the base on the noisy data and on those held out.
        ``added``: None, or the same after the best set of the verdict was added, the excess of the RMS error over the
        declared uncertainty before and after, and the parameters with their 95 % intervals.
    """
    study = _study(directory, case)
    known = initial_fit(Refit(frozenset(), study.problem, study.best), unheard).base.problem
    ideal = [_noise_free(known, directory / name) for name in _quiet_files(case)]
    found = {"at": _places(truth), **_knowable(case, *ideal)}
    before = study.held_out
    assert before is not None
    found["base"] = {
        "reduced_chi2": study.best.reduced_chi2,
        "held_out_reduced_chi2": before.reduced_chi2,
    }
    return found | {"added": _added(study, before, verdict)}


@lru_cache(maxsize=1)
def _study(directory: Path, case: Case) -> Study:
    """The study that a user would begin."""
    place = directory / "study"
    begin(
        place,
        "room",
        directory / "rig.toml",
        [directory / "recording.tdms"],
        validations=[directory / "validation.tdms"] if case.validated else [],
        hold_out=[] if case.validated else ["channel=" + ",".join(case.held_out)],
    )
    study = Study(place)
    kept = {name: effect for name, effect in study.model.effects.items() if name not in case.without}
    study.model = replace(study.model, effects=kept)
    return study


def _places(truth: RoomCase) -> dict[str, str]:
    """Where each hidden effect of the catalogue sits."""
    found = {}
    for full, drawn in truth.truth.details.items():
        candidate = EFFECTS[full.partition("@")[0]].candidate
        for kind, form in _PLACES.items():
            if candidate and kind in drawn:
                found[candidate] = form.format(drawn[kind])
    return found


def _quiet_files(case: Case) -> list[str]:
    return ["quiet.tdms", "healthy.tdms"] if case.effects else ["quiet.tdms"]


def _noise_free(problem: Problem, path: Path) -> Problem:
    """Covariance of the noisy recording as a verdict takes it, transfer functions of the one without noise."""
    (observation,) = problem.observations
    assert isinstance(observation, FrfObservation)
    model = problem.assembly.model
    quiet = observe_recording(open_recording(path), model)
    return problem.over([replace(observation, response=quiet.response, folding=quiet.folding)])


def _knowable(case: Case, problem: Problem, healthy: Problem | None = None) -> dict[str, Any]:
    refits = Refits(Refit(frozenset(), problem, fit(problem)))
    if healthy is None:
        return {"lambda": refits.base.fit.chi2, "misfit": refits.base.fit.chi2, "d": None, "planted": {}}
    misfit = fit(healthy).chi2
    found = {"lambda": max(refits.base.fit.chi2 - misfit, 0.0), "misfit": misfit, "left": None}
    found |= {"d": None, "rival": None, "conditional_lambda": None}
    form = Form({}, problem, refits.base.fit, 0.0)
    promises = {one.use: one for one in form.catalogue.promises(form.marginal)}
    order = sorted(promises, key=lambda use: -promises[use].ln_gain)
    names = frozenset(case.truth)
    if len(names) > 1:
        return found | _of_a_pair(refits, promises, names) | {"planted": {}}
    right = _refits(refits, promises, [u for u in order if u.name in names][:RIVALS])
    wrong = _refits(refits, promises, [u for u in order if u.name not in names][:RIVALS])
    best = min(right, key=lambda r: r.fit.chi2, default=None)
    found["planted"] = dict.fromkeys(names, 0.0 if best is None else _amplitude(best))
    if names and best is None:  # the base is collinear with it whole
        return found
    left = (
        best.fit.chi2 if best is not None else misfit
    )  # of an effect outside the catalogue the truth leaves nothing
    found["left"] = left - misfit
    if wrong:
        rival = min(wrong, key=lambda r: r.fit.chi2)
        found |= {"rival": str(next(iter(rival.uses))), "d": rival.fit.chi2 - left}
    return found


def _refits(refits: Refits, promises: Mapping[Use, Promise], uses: Sequence[Use]) -> list[Refit]:
    made = [refits.fit(refits.base, frozenset({use}), promises[use].starts) for use in uses]
    return [refit for refit in made if refit is not None]


def _of_a_pair(refits: Refits, promises: Mapping[Use, Promise], names: frozenset[str]) -> dict[str, Any]:
    """What the better half of a pair alone leaves beyond both."""
    order = sorted(promises, key=lambda use: -promises[use].ln_gain)
    uses = [next((use for use in order if use.name == name), None) for name in sorted(names)]
    if None in uses:
        return {}
    alone = _refits(refits, promises, uses)
    both = frozenset(uses)
    start = {name: value for use in uses for name, value in promises[use].starts[0].items()}
    whole = refits.fit(refits.base, both, [start])
    if whole is None:
        return {}
    least = min((r.fit.chi2 for r in alone), default=refits.base.fit.chi2)
    return {"conditional_lambda": least - whole.fit.chi2}


def _amplitude(refit: Refit) -> float | None:
    """Size of the first amplitude of an effect that was added, in its declared unit."""
    (use,) = refit.uses
    effect = refit.problem.assembly.model.effects[use.name]
    name = next(n for n in effect.parameters if n in effect.neutral)
    parameter, value = effect.parameters[name], refit.fit.values[f"{use}.{name}"]
    return abs(float(parameter.from_si(value)) - effect.neutral[name])


def _added(study: Study, before: HeldOut, verdict: Mapping[str, Any]) -> dict[str, Any] | None:
    """Add the first set of the ranking, if the verdict names one, and predict what was held out."""
    if verdict["verdict"] not in ("effect", "group"):
        return None
    first = verdict["ranking"][0]
    uses = [Use(name, place) for name in first["effects"] for place in first["at"].get(name, [""])]
    intervals: dict[str, tuple[float, float]] = {}
    try:
        for use in uses:
            change = add_effect(study, str(use))
            study = change.study
            intervals |= {
                name: (row["low"], row["high"])
                for name, row in study.parameters.items()
                if name.startswith(str(use))
            }
        after = study.held_out
    except ComputationError as fault:
        after, intervals = None, {str(fault): (float("nan"), float("nan"))}
    gone = float("inf")
    return {
        "uses": [str(use) for use in uses],
        "reduced_chi2_before": before.reduced_chi2,
        "reduced_chi2_after": after.reduced_chi2 if after else gone,
        "excess_before": _excess(before),
        "excess_after": _excess(after) if after else gone,
        "parameters": first["parameters"],
        "intervals": intervals,
    }


def _excess(found: HeldOut) -> float:
    """RMS error beyond what the uncertainty of data and prediction gives, in the unit of the data."""
    return float(np.sqrt(max(found.errors[0].rms ** 2 - np.mean(np.concatenate(found.sigma) ** 2), 0.0)))
