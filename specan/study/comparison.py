"""A model fitted and compared with its measurements, as a user and other programs get it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from specan.models import Model
from specan.result import Result, picked
from specan.study.estimation.fit import Fit
from specan.study.estimation.prediction_error import ObservableError
from specan.study.localisation.by_band_and_channel import FrfErrors
from specan.study.localisation.localise import Localisation, curve_errors
from specan.study.observation import Observation
from specan.units import convert, spoken


def readings(model: Model, observation: Observation, column: str) -> NDArray[Any]:
    """Values along an operating variable as they were read, in the column's unit; its labels where it is no number."""
    name = next((n for n, c in model.conditions.items() if c.column == column and not c.group), None)
    if name is None:
        return observation.labels[column]
    condition = model.conditions[name]
    return np.asarray(convert(observation.conditions[name], condition.unit, condition.column_unit))


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Result):
    """A model fitted and compared with the measurement.

    Attributes
    ----------
    study : specan.study.study.Study
        Whose model it is.
    fit : Fit
    errors : tuple of ObservableError
        The observable with most values first.
    localisation : Localisation or None
        Where the model fails; None where the uncertainty is unknown, or there are as many parameters as values.
    parameters : mapping
        Fitted parameters with their 95 % intervals.
    """

    study: Any  # a study makes its comparison, so that its class is not known here
    fit: Fit
    errors: tuple[ObservableError, ...]
    localisation: Localisation | None
    parameters: Mapping[str, Mapping[str, Any]]

    dimensions = ("parameter",)

    def summary(self) -> str:
        """Errors, and how well the model fits."""
        errors = ", ".join(f"RMS of {e.observable} {spoken(e.rms, unit=e.unit)}" for e in self.errors)
        if self.localisation is None:
            return errors
        p = self.fit.p_value
        return f"{errors}, reduced chi-square {self.fit.reduced_chi2:.3g}, p {'< 1e-12' if p < 1e-12 else f'{p:.2g}'}"

    def columns(self) -> dict[str, Any]:
        """One row for each fitted parameter, with its 95 % interval."""
        names = ("value", "low", "high", "unit", "plausible", "at_bound")
        rows = self.parameters.values()
        return {"parameter": list(self.parameters), **{n: [row[n] for row in rows] for n in names}}

    @property
    def residuals(self) -> pd.DataFrame:
        """Every measured value beside the model's.

        Returns
        -------
        pandas.DataFrame
            The conditions of each value, ``measured``, ``model``, ``residual`` (measured less model) and its standard
            uncertainty ``u`` in ``unit``; ``data`` says whether it was fitted or held out.
        """
        study, problem = self.study, self.study.problem
        seen = zip(problem.observations, problem.plain(study.shown.theta), strict=True)
        parts = [("fitted", one, predicted) for one, predicted in seen]
        if study.held_out is not None:
            unseen = zip(study.data.held_out, study.held_out.predictions, strict=True)
            parts += [("held-out", one, predicted) for one, predicted in unseen]
        known = study.model.observables
        columns = {name: c.column for name, c in study.model.conditions.items() if not c.group}
        frames = []
        for data, one, predicted in parts:
            names = np.broadcast_to(getattr(one, "observable", one.name), one.measured.shape)
            own = {
                "observable": names,
                "measured": one.measured,
                "model": predicted,
                "residual": one.measured - predicted,
                "u": one.sigma,
                "unit": [known[name].unit if name in known else "" for name in names],
            }
            of_row = {n: labels for n, labels in one.labels.items() if n not in columns}
            of_row |= {c: readings(study.model, one, c) for n, c in columns.items() if n in one.conditions}
            rows = pd.DataFrame({**one.places, "data": data, **of_row}, index=np.arange(names.size))
            rows = rows.rename(columns={name: f"{name} (condition)" for name in own})
            frames.append(rows.assign(**own))
        return pd.concat(frames, ignore_index=True)

    @cached_property
    def recorded(self) -> list[FrfErrors]:
        """Level and phase errors of every recording of transfer functions that is fitted; none if none is."""
        return curve_errors(self.study.problem, self.fit)

    @property
    def path_gains(self) -> list[dict[str, Any]]:
        """Of each recording of order lines: gains that were learned from it, and the error without them."""
        problem = self.study.problem
        values = problem.values_at(self.study.shown.theta)
        return [
            gains
            for o in problem.observations
            if hasattr(o, "path_gains")
            for gains in o.path_gains(problem.assembly, problem.seen_by(o, values))
        ]

    def content(self) -> dict[str, Any]:
        """What ``specan study compare --json`` prints; `recordings` only where curves were compared."""
        study, where, known = self.study, self.localisation, self.study.data.known
        return {
            "model_effects": study.model_effects,
            "errors": [e.as_dict() for e in self.errors],
            "reduced_chi2": self.fit.reduced_chi2 if known else None,
            "p_value": self.fit.p_value if known else None,
            "n_effective": self.fit.n_effective,
            "dof": self.fit.dof,
            "model_discrepancy_percent": study.data.discrepancy_percent,
            "parameters": self.parameters,
            "at_bound": self.fit.at_bound,
            "fails_at": [b.as_dict() for b in where.fails_at] if where else [],
            "trends": [
                picked(t, "variable p_value significant text=sentence")
                for t in (where.trends if where else ())
            ],
            "sentences": where.sentences() if where else [],
            "assumptions": study.data.statements,
            "mistaken_set_up": study.mistaken_set_up.text,
            **({"recordings": [one.as_dict() for one in self.recorded]} if self.recorded else {}),
            **({"path_gains": gains} if (gains := self.path_gains) else {}),
        }
