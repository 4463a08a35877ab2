"""What each effect of the catalogue promises beside a fit, by linear algebra, and from where it would be fitted."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from copy import copy
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from specan.models import Use
from specan.study.estimation.fit import Fit
from specan.study.estimation.problem import Problem
from specan.study.evidence.marginal import Marginal
from specan.study.observation import Array
from specan.study.selection.candidates import Candidate, candidates
from specan.study.selection.signatures import Signature, Signatures, default_value

ONE_SIDED_80 = 0.84  # standard deviations below which four of five values of a normal law lie


@dataclass(frozen=True, eq=False)
class Promise:
    """One effect beside a fit.

    Attributes
    ----------
    ln_gain : float
        ln of the evidence with the effect over that without, made linear.
    starts : tuple of mapping
        SI values from which to fit, the most promising first.
    origin : mapping
        SI values of what it stands beside.
    """

    use: Use
    ln_gain: float
    starts: tuple[dict[str, Any], ...]
    origin: Mapping[str, Any] = field(default_factory=dict)

    def on_the_way(self, problem: Problem) -> list[Array]:
        """Of each start the place on the way there with the least chi-square, and the default values.

        A straight line leads too far where predictions bend.
        """
        effect = problem.assembly.model.effects[self.use.name]
        origin = {f"{self.use}.{n}": v for n, v in effect.neutral_si.items()} | dict(self.origin)
        found = [problem.start(self.origin)]
        for start in self.starts:
            # shares of the way to a promise
            places = [
                problem.start(
                    {n: origin.get(n, v) + share * (v - origin.get(n, v)) for n, v in start.items()}
                )
                for share in (1.0, 0.5, 0.2, 0.05)
            ]
            left = [float(np.sum(problem.residual(place) ** 2)) for place in places]
            found.append(places[int(np.argmin(np.nan_to_num(left, nan=np.inf)))])
        return found[::-1]


class Catalogue:
    """What may be added to a base, and how each changes what it predicts.

    Parameters
    ----------
    problem : Problem
    base : Fit
        Of a model to which effects may be added.
    worth : float
        Rows that each row stands for.
    before : Catalogue, optional
        Of a model with fewer effects: what each does to the residual depends little on those beside it.
    anew : bool
        All effects are looked at again, where the other model was far from the data; else only errors of instruments.

    Attributes
    ----------
    candidates : list of Candidate
    not_testable : dict
        Effects that the data say nothing about, with the reason.
    led : dict
        Where the base is far off, values from which else to fit those effects that come nearest.
    """

    def __init__(
        self,
        problem: Problem,
        base: Fit,
        worth: float = 1.0,
        before: Catalogue | None = None,
        anew: bool = True,
    ) -> None:
        self.problem, self.base, self.worth = problem, base, worth
        self.candidates, self.not_testable = candidates(problem)
        self.signatures: dict[Use, list[Signature]] = {}
        self.led: dict[Use, dict[str, Any]] = {}
        found = self.candidates
        if before is not None:
            found = [c for c in found if anew or c.effect.instrument]
            kept = {c.use for c in self.candidates} - {c.use for c in found}
            self.signatures = {use: before.signatures.get(use, []) for use in kept}
        at = Signatures(problem, base)
        points = at.grid(found)
        for c in found:
            if c.use in points:
                self.signatures[c.use] = [
                    replace(one, columns=np.sqrt(worth) * one.columns[: problem.n_data])
                    for one in at.at(c, points[c.use])
                ]
            elif at.changes(c, [{n: default_value(c, n) for n in c.own}])[0] is None:
                self.not_testable[c.use.name] = "gives values that are not finite at these conditions"

    def whitened_by(self, problem: Problem) -> Catalogue:
        """The same effects on the same rows, of independent noise here, under the noise of another problem."""
        found = copy(self)
        found.problem, found.candidates = problem, candidates(problem)[0]
        sigma = np.concatenate([o.sigma for o in self.problem.observations])[:, None]
        found.signatures = {
            use: [replace(one, columns=problem.whiten(one.columns * sigma)) for one in own]
            for use, own in self.signatures.items()
        }
        return found

    def promises(self, beside: Marginal) -> Iterator[Promise]:
        """The best of each effect that the fit does not have."""
        have = set(beside.tangent.problem.assembly.uses) - set(beside.tangent.problem.nuisances)
        for candidate in self.candidates:
            if candidate.use in have:
                continue
            if (found := self._best(beside, candidate)) is not None:
                led = [self.led[found.use]] if found.use in self.led else []
                yield replace(found, starts=(*led, *found.starts))

    def visible(self, beside: Marginal, base: Marginal, needed: float) -> dict[str, dict[str, Any] | None]:
        """Sizes of all effects that would be seen in four cases of five: beside a fit; of what it has, beside the base.

        Parameters
        ----------
        beside, base : Marginal
        needed : float
            ln of the evidence that an effect has to gain.

        Returns
        -------
        dict
            ``{"windage": {"value": 0.4, "unit": "W"}}``, None where no size in its range is seen; of an effect that may
            act at several places the largest, with ``places``.
        """
        have = set(beside.tangent.problem.assembly.uses) - set(beside.tangent.problem.nuisances)
        found: dict[str, dict[str, float | None]] = {}
        units: dict[str, str] = {}
        for candidate in self.candidates:
            where = base if candidate.use in have else beside
            name = (candidate.without_prior or candidate.amplitudes)[0]
            units[candidate.use.name] = candidate.parameter(name).unit
            size = self._visible(where, candidate, needed)
            value = None if size is None else float(candidate.parameter(name).from_si(size))
            found.setdefault(candidate.use.name, {})[candidate.use.at] = value
        return {name: together(places, units[name]) for name, places in sorted(found.items())}

    def _visible(self, where: Marginal, candidate: Candidate, needed: float) -> float | None:
        """Size of the first amplitude that gains `needed` in four cases of five, its shapes at their defaults."""
        own, tangent = self.signatures.get(candidate.use), where.tangent
        if not own:
            return None
        name, one_step = own[0].names[0], float(abs(own[0].size[0]))
        column = self._columns(where, candidate, own[0])[:, 0]
        low, high = candidate.extended.domain(name.whole)
        most = max(high - candidate.neutral(name), candidate.neutral(name) - low)
        width = float(np.ptp(candidate.plausible(name))) / np.sqrt(12) / one_step
        curvature = where.curvature(column)
        if not curvature > 0:
            return None
        unit = -2 * float(tangent.ln_likelihood(where.chi2 + 1.0) - tangent.ln_likelihood(where.chi2))
        fall = (2 * needed + np.log1p(width**2 * curvature)) / unit
        more = (np.sqrt(fall) + ONE_SIDED_80) / np.sqrt(curvature)
        power = 1.0 if candidate.without_prior else self._power(where, candidate, own[0], more)
        with np.errstate(over="ignore"):  # beyond all numbers: it is not seen
            size = float(np.power(more, 1 / power) * one_step)
        return size if size <= most else None

    def _power(self, where: Marginal, candidate: Candidate, one: Signature, more: float) -> float:
        """Power of its size that an effect goes with, up to so many times that of a signature; 1 is a straight line."""
        reach = max(one.multiplier_bounds, key=abs)
        multiple = np.sign(reach) * min(more, abs(reach))
        if abs(np.log(abs(multiple))) < 0.01:  # the same size
            return 1.0
        place = {**one.shapes, one.names[0]: one.neutral[0] + multiple * one.size[0]}
        (column,) = Signatures(self.problem, self.base).changes(candidate, [place])
        if column is None:
            return 1.0
        own_rows = column[: self.problem.n_data]
        grown = self.worth * where.curvature(own_rows) / where.curvature(one.columns[:, 0])
        # 0.5: nothing grows less than with the root of a size, but by rounding and where motions are chaotic
        return max(float(np.log(max(grown, 1e-300)) / np.log(multiple**2)), 0.5)

    def _best(self, beside: Marginal, candidate: Candidate) -> Promise | None:
        own = self.signatures.get(candidate.use, [])
        if not own:
            return None
        tried = []
        for one in own:
            width = np.array([np.ptp(candidate.plausible(name)) for name in one.names]) / np.sqrt(12)
            # An amplitude that the signature leaves at nothing has no column of its own.
            width = np.divide(width, np.abs(one.size), out=np.zeros(width.size), where=one.size != 0)
            (gain,), (found,) = beside.beside(self._columns(beside, candidate, one) * width, np.ones(1))
            found = found * width
            inside = np.clip(found, *one.multiplier_bounds)
            # The other sign is not allowed: as good as nothing.
            tried.append((float(gain if np.all(inside == found) else min(gain, 0.0)), one, inside))
        tried.sort(key=lambda item: -item[0])
        starts = [self._start(beside, candidate, *tried[0][1:])]
        for _, one, found in tried[1:]:
            if one.place != tried[0][1].place:
                starts.append(self._start(beside, candidate, one, found))
                break
        origin = beside.tangent.problem.values_at(beside.tangent.theta)
        return Promise(candidate.use, tried[0][0], tuple(starts), origin)

    def _columns(self, where: Marginal, candidate: Candidate, one: Signature) -> Array:
        """Columns of a signature; of what a fit has under a prior they are its own, which elsewhere are others."""
        columns, names = one.columns.copy(), where.tangent.problem.names
        for k, name in enumerate(one.names):
            if name in candidate.without_prior and name in names:
                columns[:, k] = where.tangent.jacobian[:, names.index(name)] * one.size[k]
        return columns

    def _start(self, beside: Marginal, candidate: Candidate, one: Signature, found: Array) -> dict[str, Any]:
        """Values after a linear step of everything along a signature."""
        problem = beside.tangent.problem
        moved = beside.shifted(self._columns(beside, candidate, one), found)
        values = one.moved(problem, moved, found)
        return dict(problem.values_at(moved)) | candidate.extended.of_elements(values)


def together(places: dict[str, float | None], unit: str) -> dict[str, Any] | None:
    """The largest of some sizes."""
    seen = [value for value in places.values() if value is not None]
    if not seen:
        return None
    found: dict[str, Any] = {"value": max(seen, key=abs), "unit": unit}
    return found | ({"places": places} if len(places) > 1 else {})
