"""A smooth picture of the machine that uncertainties are worked out around: the base model, fitted once.

How a setting's scatter goes over into the reading needs the slope of the reading over that setting, and
a discrepancy in percent of what the effects do needs that part. Both are taken from the model with its own base
effects - not from the model that a study is trying out - so that the covariance stays the same from step
to step and chi-squares of different models may be compared.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from specan.errors import SpecanError
from specan.models import Assembly, Model, varying
from specan.study.data.operating_table import Rows
from specan.study.estimation.fit import fit
from specan.study.estimation.problem import Problem
from specan.study.observation import Array
from specan.study.observation.table import TableObservation

CRUDE = 0.01  # relative weight of a row in the first fit


@dataclass(frozen=True, eq=False)
class Reference:
    """The fitted base model, or the model without effects where that could not be fitted."""

    assembly: Assembly
    values: Mapping[str, Any]

    def predict(self, rows: Rows) -> Array:
        """What the reference expects in every row."""
        return crude(rows).predict(self.assembly, self.values)

    def slope(self, rows: Rows, condition: str) -> Array:
        """Derivative of the reading over one condition."""
        x = rows.conditions[condition]
        step = 1e-3 * max(float(np.ptp(x)), 0.1 * float(np.abs(x).max()), 1e-9)
        ends = []
        for side in (1, -1):
            moved = {**rows.conditions, condition: x + side * step}
            ends.append(crude(rows, moved).predict(self.assembly, self.values))
        slope = (ends[0] - ends[1]) / (2 * step)
        return np.where(np.isfinite(slope), slope, 0.0)

    def effects_part(self, rows: Rows) -> Array:
        """What the effects do to the reading: prediction less that of the model without effects.

        A model whose base has no effects is taken whole.
        """
        predicted = self.predict(rows)
        model = self.assembly.model
        if not model.base_effects:
            return predicted
        ideal = model.assemble()
        return predicted - crude(rows).predict(ideal, ideal.defaults())


def crude(rows: Rows, conditions: Mapping[str, Array] | None = None) -> TableObservation:
    """Rows as an observation, each weighted by its size: good enough for a first fit."""
    weight = CRUDE * np.maximum(np.abs(rows.measured), 0.01 * np.abs(rows.measured).max())
    return TableObservation(
        name=", ".join(rows.recordings),
        observable=rows.observable,
        measured=rows.measured,
        conditions=rows.conditions if conditions is None else conditions,
        covariance=np.diag(weight**2),
        recordings=rows.recordings,
        recording=rows.recording,
        available=frozenset(rows.conditions),
        groups=rows.groups,
    )


def reference(model: Model, rows: Rows) -> Reference:
    """Fit the base effects to the rows."""
    ideal = model.assemble()
    try:
        assembly = model.assemble(model.base_effects)
        free = assembly.free(varying([rows.conditions]))
        return Reference(assembly, fit(Problem(assembly, (crude(rows),), free)).values)
    except SpecanError:  # too few rows, or data that the base cannot follow at all: the ideal slopes serve
        return Reference(ideal, ideal.defaults())
