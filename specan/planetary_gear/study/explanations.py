"""Explanations of order lines: sets of effects by the evidence of their patterns, as large as these tell."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from specan.models import Use
from specan.planetary_gear.study.evidence import LineEvidence, Pattern
from specan.study.estimation.problem import Problem
from specan.study.evidence.diagnosis import told
from specan.study.evidence.explanations import (
    NOTHING,
    OF_THE_BEST,
    UNKNOWN,
    Explanation,
    Explanations,
    Form,
)
from specan.study.evidence.faults import ln_mean
from specan.study.evidence.marginal import Tangent
from specan.study.evidence.promises import together
from specan.study.localisation.localise import MistakenSetUp
from specan.study.progress import Progress
from specan.study.selection.candidates import Candidate, candidates, confounded_with, without
from specan.study.selection.refits import Refit
from specan.study.verdict import Diagnosis

PAIRED = 3, 6  # likeliest effects that are looked at with others, and with how many of these


@dataclass(frozen=True, eq=False)
class OfLines(Explanation):
    """One way in which order lines may have come about, with lines of another origin or without."""

    tones: str = ""

    @property
    def of_noise(self) -> str:
        """What it says of the noise."""
        return self.tones

    @property
    def names_its_effects(self) -> bool:
        """Lines that are within the errors of its form are no other explanation's: see `OfOrderLines`."""
        return self.kind == "effects"


class OfOrderLines(Explanations):
    """Explanations of the order lines of a planetary gear."""

    def set_up(self) -> None:
        """No rig declares another form of the base."""
        self.forms = [Form({}, self.problem, self.base, 0.0)]
        self.lines = LineEvidence(self.problem, self.problem.values_at(self.base.theta))
        found, self._not_testable = candidates(self.problem)
        self._candidates = [c for c in found if c.use not in self.problem.nuisances]
        self.patterns = {c.use: self.lines.patterns(c) for c in self._candidates}

    def candidates(self, form: Form) -> Sequence[Candidate]:
        """Effects that may be missing, without what is uncertain of the machine anyway."""
        return self._candidates

    @property
    def not_testable(self) -> Mapping[str, str]:
        """Effects that the data say nothing about, with the reason."""
        return self._not_testable

    def look(self) -> None:
        """Nothing, anything, every effect, and the likeliest with a second one or with anything."""
        nothing = self.lines.nothing
        self.found = []
        likeliest: dict[Use, Pattern] = {}
        alone: dict[Use, float] = {}
        places: dict[Use, float] = {}  # what the likeliest place has more than the mean over all
        anything = self.lines.anything()
        each = [self.lines.ln_evidence([one]) for one in anything]
        unknown = float(ln_mean([float(ln_mean(each)), self.lines.ln_in_some()]))
        tried = [c for c in self._candidates if self.patterns[c.use]]
        # Teeth part, perhaps, where no error in proportion to its lines explains those of all recordings.
        for parted in (False, True):
            first = max(alone, key=alone.__getitem__, default=None)
            if first and alone[first] > unknown and not likeliest[first].but:
                break
            for number, candidate in enumerate(tried):
                use = candidate.use
                self.progress(f"lines of {use}", 0.35 * parted + 0.35 * number / len(tried))
                likeliest[use], most, alone[use] = self.lines.likeliest(candidate, self.patterns[use], parted)
                places[use] = most - alone[use]
        # An error of a share s in the form of an effect leaves s^2 of the chi-square that it takes away: what else is
        # to explain that has to add more, and what is known to look alike is told apart in units of that.
        share, best = self.lines.seen.known.near**2, max([nothing, *alone.values()])
        of_form = {
            use: share * max(gain - nothing - self.lines.of_another_origin(likeliest[use].but), 0.0)
            for use, gain in alone.items()
        }
        first = next((use for use, gain in alone.items() if gain == best), None)
        self._form_error = of_form[first] if first else 0.0
        self._keep_lines("nothing", [], nothing)
        for use, gain in alone.items():
            self._keep_lines("effects", [likeliest[use]], gain)
        self._keep_lines("unknown", [anything[int(np.argmax(each))]], unknown)
        order = sorted((use for use in alone if alone[use] > nothing), key=lambda use: -alone[use])
        for k, use in enumerate(order[: PAIRED[0]]):
            self.progress(f"lines of {use} with others", 0.7 + 0.05 * k)
            for other in [*order[k + 1 : PAIRED[1]], None]:
                second = anything[0] if other is None else likeliest[other]
                gain = self.lines.ln_evidence([likeliest[use], second], near=[likeliest[use]])
                gain -= sum(places[u] for u in (use, other) if u)
                if gain > best + self._form_error:
                    self._keep_lines("effects" if other else "unknown", [likeliest[use], second], gain)
        if first:
            self._coarsen(first, of_form, likeliest)
        near = [e.uses for e in self.found if e.uses and e.ln_joint > self.best + np.log(OF_THE_BEST)]
        fits = {uses: self._told(sorted(uses), likeliest) for uses in dict.fromkeys(near)}
        self.found = [
            replace(e, tangent=fits[e.uses], fitted=True) if e.uses in fits else e for e in self.found
        ]

    def _keep_lines(self, kind: str, patterns: Sequence[Pattern], ln_evidence: float) -> None:
        """Keep an explanation by patterns, and the same with lines that tones of the background make."""
        form, uses = self.forms[0], frozenset(p.use for p in patterns if p.use)
        chance = UNKNOWN / NOTHING if kind == "unknown" else 1.0
        ln_prior = float((self._ln_prior(form, uses) if uses else np.log(NOTHING)) + np.log(chance))
        apart = frozenset().union(*(p.but for p in patterns))
        names = " and ".join(name for k, name in enumerate(self.lines.seen.recordings) if k in apart)
        said = [f"lines of {names} have another origin: teeth may lose contact there"] if apart else []
        one = OfLines(kind, form, uses, form.tangent, ln_prior, ln_evidence, fitted=kind == "nothing")
        self.found.append(replace(one, tones="".join(said)))
        more, where = self.lines.tones(patterns)
        if where and more > self.lines.seen.known.near**2 * (ln_evidence - self.lines.nothing):
            said.append(f"{' and '.join(where)} is isolated: perhaps a tone of the background")
            self.found.append(replace(one, ln_evidence=ln_evidence + more, tones="; ".join(said)))

    def _coarsen(self, first: Use, of_form: Mapping[Use, float], likeliest: Mapping[Use, Pattern]) -> None:
        """Tell what is known to look like the best effect from it in units of what an error of its form leaves.

        Where teeth part, each error makes lines of the others.
        A coarsened posterior: Miller and Dunson, J. Am. Stat. Assoc. 114 (2019) 1113.
        """
        parted = {use for use in of_form if likeliest[first].parted or likeliest[use].parted}
        alike = parted.union(confounded_with(self.problem.assembly.model, first))
        best = max(e.ln_evidence for e in self.found if e.uses == {first} and e.kind == "effects")
        for k, one in enumerate(self.found):
            if one.kind == "effects" and one.ln_evidence < best and len(one.uses) == 1 and one.uses <= alike:
                unit = 1 + (self._form_error if one.uses <= parted else of_form[min(one.uses)])
                self.found[k] = replace(one, ln_evidence=best - (best - one.ln_evidence) / unit)

    def _told(self, uses: Sequence[Use], likeliest: Mapping[Use, Pattern]) -> Tangent:
        """The model with some effects, as large as their lines tell."""
        problem = self.problem.with_uses(uses)
        theta = problem.start({**self.base.values, **self.lines.start([likeliest[use] for use in uses])})
        return Tangent.at(problem, theta, problem.residual(theta), problem.jacobian(theta))

    def visible(self, one: Explanation) -> dict[str, dict[str, Any] | None]:
        """Sizes at which the lines of each effect are seen; none of effects that make no lines of their own."""
        needed, units = self.needed, {}
        found: defaultdict[str, dict[str, float | None]] = defaultdict(dict)
        for candidate in self.candidates(self.forms[0]):
            name = candidate.amplitudes[0]
            units[candidate.use.name] = candidate.parameter(name).unit
            sizes = [self.lines.visible(pattern, needed) for pattern in self.patterns[candidate.use]]
            size = min(sizes, default=np.inf)
            inside = size <= max(np.abs(self.problem.with_uses([candidate.use]).domain(name.whole)))
            value = float(candidate.parameter(name).from_si(size)) if inside else None
            found[candidate.use.name][candidate.use.at] = value
        return {name: together(places, units[name]) for name, places in sorted(found.items())}


def diagnosed(start: Refit, set_up: MistakenSetUp | None, progress: Progress) -> Diagnosis:
    """The verdict on order lines, as `specan.study.diagnose.diagnose` asks for it."""
    return told(OfOrderLines(start.problem, start.fit, progress))


def near_the_data(problem: Problem) -> dict[str, float]:
    """Values that the lines tell of the effects that a model has beside those of its base, SI."""
    model = problem.assembly.model
    own = [
        use
        for use in problem.assembly.uses
        if use.name not in model.base_effects and use not in problem.nuisances
    ]
    if not own:
        return {}
    base = problem
    for use in own:
        base = without(base, use)
    lines = LineEvidence(base, base.values_at(base.start()))
    each = ((c, lines.patterns(c)) for c in candidates(base)[0] if c.use in own)
    return lines.start([lines.likeliest(c, found, parted=True)[0] for c, found in each if found])
