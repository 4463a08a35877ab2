"""A model fitted and compared with its measurements, as a user and other programs get it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from specan.result import Result
from specan.study.estimation.fit import Fit
from specan.study.estimation.prediction_error import ObservableError
from specan.study.localisation.localise import Localisation


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
        Where the model fails; None where the uncertainty is unknown.
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
        errors = ", ".join(f"RMS of {e.observable} {e.rms:.3g} {e.unit}" for e in self.errors)
        if self.localisation is None:
            return errors
        return f"{errors}, reduced chi-square {self.fit.reduced_chi2:.3g}, p {self.fit.p_value:.2g}"

    def columns(self) -> dict[str, Any]:
        """One row for each fitted parameter, with its 95 % interval."""
        names = ("value", "low", "high", "unit", "plausible", "at_bound")
        rows = self.parameters.values()
        return {"parameter": list(self.parameters), **{n: [row[n] for row in rows] for n in names}}

    @property
    def path_gains(self) -> list[dict[str, Any]]:
        """Of each recording of order lines: gains that were learned from it, and the error without them."""
        problem = self.study.problem
        values = problem.values_at(self.study.shown.theta)
        return [
            o.path_gains(problem.assembly, problem.seen_by(o, values))
            for o in problem.observations
            if hasattr(o, "path_gains")
        ]

    def content(self) -> dict[str, Any]:
        """What ``specan study compare --json`` prints; `recordings` only where curves were compared."""
        study, where, known = self.study, self.localisation, self.study.data.known
        recorded = study.frf_errors()
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
                {
                    "variable": t.variable,
                    "p_value": t.p_value,
                    "significant": t.significant,
                    "text": t.sentence,
                }
                for t in (where.trends if where else ())
            ],
            "sentences": where.sentences() if where else [],
            "assumptions": study.data.statements,
            "mistaken_set_up": study.mistaken_set_up.text,
            **({"recordings": [one.as_dict() for one in recorded]} if recorded else {}),
            **({"path_gains": gains} if (gains := self.path_gains) else {}),
        }
