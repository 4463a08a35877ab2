"""From the probabilities of all explanations to what is said."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from specan.study.evidence.explanations import OF_THE_BEST, SURE, EffectSet, Explanation, Explanations


@dataclass(frozen=True, eq=False)
class Stated:
    """An explanation whatever the form of the base and of the noise.

    Attributes
    ----------
    kind : str
        ``nothing``, ``effects``, ``beyond``, ``unknown`` or ``fault``.
    uses : frozenset of Use
    probability : float
    best : Explanation
        The likeliest among its forms.
    """

    kind: str
    uses: EffectSet
    fault: str
    probability: float
    best: Explanation

    @property
    def text(self) -> str:
        """``nothing``, ``windage with seal-drag``, ``something else``, or the fault."""
        names = " with ".join(sorted(map(str, self.uses)))
        if self.kind == "effects":
            return names
        if self.kind == "beyond":
            return (names or "nothing is missing") + ", with values outside their known range"
        if self.kind == "fault":
            return self.fault + (f" beside {names}" if names else "")
        return {"nothing": "nothing is missing", "unknown": "something else"}[self.kind]


@dataclass(frozen=True, eq=False)
class Judgement:
    """What the probabilities amount to.

    Attributes
    ----------
    kind : str
        ``nothing-missing``, ``effect``, ``group``, ``fits-only-if``, ``unknown-effect`` or ``faulty-data``.
    sets : tuple of Stated
        What is named, the likeliest first.
    stated : tuple of Stated
        Every explanation, the likeliest first.
    """

    kind: str
    sets: tuple[Stated, ...]
    stated: tuple[Stated, ...]

    def probability(self, kind: str) -> float:
        """Of all explanations of a kind together."""
        return sum(one.probability for one in self.stated if one.kind == kind)


def stated(explanations: Explanations) -> tuple[Stated, ...]:
    """Explanations summed over forms of the base and of the noise, the likeliest first."""
    kinds: dict[tuple[str, EffectSet, str], list[tuple[float, Explanation]]] = {}
    for probability, one in explanations.probabilities:
        kind, uses = one.kind, one.uses
        if kind in ("effects", "unknown") and one.names_its_effects:
            kind = "effects"
        elif kind in ("effects", "unknown"):
            if kind == "effects":  # it stays among what was tried
                kinds.setdefault((kind, uses, ""), []).append((0.0, one))
            kind, uses = "unknown", frozenset()
        key = kind, uses, one.fault.name if one.fault else ""
        kinds.setdefault(key, []).append((probability, one))
    found = [Stated(*key, sum(p for p, _ in own), own[0][1]) for key, own in kinds.items()]
    return tuple(sorted(found, key=lambda one: -one.probability))


def judge(explanations: Explanations) -> Judgement:
    """What is said."""
    all_of_them = stated(explanations)
    whole = Judgement("", (), all_of_them)
    named = whole.probability("effects")
    fault, nothing = whole.probability("fault"), whole.probability("nothing")
    rest = max(named, whole.probability("beyond"), whole.probability("unknown"))
    alone = sum(one.probability for one in all_of_them if one.kind == "fault" and not one.uses)
    # Its owner has to look for what is sure, or for the likeliest where something is sure to be wrong.
    if fault > SURE or (nothing <= 1 - SURE and alone > rest):
        faults = tuple(one for one in all_of_them if one.kind == "fault")
        return Judgement("faulty-data", faults[:1], all_of_them)
    # A fault that is not sure is no reason to say that an effect is missing.
    if nothing > (1 - SURE) * (1 - fault):
        return Judgement("nothing-missing", (), all_of_them)
    beyond = [one for one in all_of_them if one.kind == "beyond"]
    if whole.probability("beyond") > max(named, whole.probability("unknown")):
        return Judgement("fits-only-if", tuple(beyond[:1]), all_of_them)
    if whole.probability("unknown") > named:
        return Judgement("unknown-effect", (), all_of_them)
    effects = [one for one in all_of_them if one.kind == "effects"]
    sets = without_larger(one for one in effects if one.probability > effects[0].probability * OF_THE_BEST)
    return Judgement("effect" if len(sets) == 1 else "group", tuple(sets), all_of_them)


def without_larger(found: Iterable[Stated]) -> list[Stated]:
    """Explanations without those that a likelier one with fewer effects says already."""
    kept: list[Stated] = []
    for one in found:
        if not any(other.uses and other.uses < one.uses for other in kept):
            kept.append(one)
    return kept
