"""Errors of single receivers that their own rows lead to.

What an error of one receiver does is in its own rows alone, so that all receivers can be looked at together: they are
moved at the same time, and each is led by its own rows. A receiver that stands some centimetres off is beyond what a
linearised score can promise.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specan.arrays import Real
from specan.models import Use
from specan.study.selection.candidates import Candidate, candidates
from specan.study.selection.refits import Refit
from specan.study.selection.signatures import default_value, residuals


@dataclass(frozen=True)
class Displaced:
    """Values of one receiver's error that its own rows ask for, and the chi-square that they take away."""

    values: dict[str, float]
    gain: float


def displaced(refit: Refit, uses: Collection[Use]) -> dict[Use, Displaced]:
    """Errors of single receivers that have no shape, each led by its own rows, best first.

    Left out are those that explain less than half of what their rows leave beyond the noise. The other parameters stay
    where they are. All rows are looked at: on a subsample without windows a small error of one receiver is hidden by
    what windows do to the errors that are declared of it.
    """
    found = [c for c in candidates(refit.problem)[0] if c.use in uses and c.effect.instrument and c.use.at]
    found = [c for c in found if c.amplitudes and not c.shapes and not c.without_prior]
    channel = np.concatenate(
        [np.asarray(o.labels.get("channel", [""] * o.n)).astype(str) for o in refit.problem.observations]
    )
    rows = {c.use: np.flatnonzero(channel == str(c.use.at)) for c in found}
    found = [c for c in found if rows[c.use].size]
    out: dict[Use, Displaced] = {}
    for name in sorted({c.use.name for c in found}):  # two errors of a receiver are in the same rows
        out |= _led(refit, [c for c in found if c.use.name == name], rows)
    return dict(sorted(out.items(), key=lambda item: -item[1].gain))


def _led(
    refit: Refit, found: Sequence[Candidate], rows: Mapping[Use, NDArray[np.intp]]
) -> dict[Use, Displaced]:
    """One kind of error of all receivers, moved at the same time."""
    problem = refit.problem.with_uses([c.use for c in found])
    neutral: dict[str, float] = {name: c.neutral(name) for c in found for name in c.amplitudes}
    theta = problem.start({**refit.fit.values, **neutral})
    low, high = problem.bounds()
    own = {c.use: np.array([problem.names.index(name) for name in c.amplitudes]) for c in found}
    # 0.1: of a usual size, for slopes
    size = {c.use: 0.1 * np.array([default_value(c, n) - c.neutral(n) for n in c.amplitudes]) for c in found}

    def at(many: list[Real]) -> Real:
        return residuals(problem, [problem.values_at(one) for one in many])

    start = at([theta])[:, 0]
    here, reach = start.copy(), dict.fromkeys(own, 1.0)
    # 5: of Gauss-Newton steps
    for _ in range(5):
        moved = np.tile(theta, (max(part.size for part in own.values()), 1))
        for use, part in own.items():
            moved[np.arange(part.size), part] += size[use]
        slopes, trial = at(list(moved)) - here[:, None], theta.copy()
        for use, part in own.items():
            step, *_ = np.linalg.lstsq(slopes[rows[use], : len(part)], -here[rows[use]], rcond=1e-9)
            trial[part] = np.clip(theta[part] + reach[use] * step * size[use], low[part], high[part])
        there = at([trial])[:, 0]
        for use, part in own.items():
            mine = rows[use]
            if there[mine] @ there[mine] < here[mine] @ here[mine]:
                theta[part], here[mine] = trial[part], there[mine]
            else:
                reach[use] /= 4
    out = {}
    for use, part in own.items():
        before, after = (float(x[rows[use]] @ x[rows[use]]) for x in (start, here))
        gain = before - after
        # 0.5: of what a receiver's own rows leave beyond the noise, that its error has to explain
        if gain > 0.5 * (before - min(refit.fit.reduced_chi2, 1.0) * rows[use].size):
            out[use] = Displaced({problem.names[k]: float(theta[k]) for k in part}, gain)
    return out
