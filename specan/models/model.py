"""A model: quantities, conditions, the effects it knows, and what is measured of it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from specan.errors import RequestError, nearest
from specan.models.effect import Effect, Use
from specan.models.evaluation import Evaluator
from specan.models.graph import components
from specan.models.observable import Observable
from specan.models.order_lines import OrderLines
from specan.models.quantity import Condition, Quantity
from specan.models.receivers import Receivers
from specan.models.rig_statement import RigStatement
from specan.models.table_rules import TableRules


@dataclass(frozen=True)
class Nuisance:
    """An instrument error that every fit of a study carries, held by its certificate.

    `effect` names the effect whose parameter follows a normal law about its neutral value with the
    standard deviation `prior_sd`, in the parameter's unit.
    """

    effect: str
    parameter: str
    prior_sd: float
    source: str = ""


@dataclass(frozen=True)
class LawSpace:
    """Where a law is looked for when something unknown is missing.

    Attributes
    ----------
    quantity : str
        Quantity that the unknown would add to.
    variables : mapping
        ``{symbol: name}`` of the positive quantities or conditions that it may be a power of.
    """

    quantity: str
    variables: Mapping[str, str]


@dataclass(frozen=True)
class Words:
    """What a model calls its own things, in sentences that a study prints.

    Attributes
    ----------
    ideal : str
        The model without effects: ``the ideal machine``.
    discrepancy_of : str
        What the declared discrepancy is a percentage of: the part of the reading that the effects make.
    remedy_uncertainty : str
        An example of stating a reading's uncertainty in the rig file.
    vary : str
        What to vary in a measurement in which nothing varies.
    what_else : str
        What else could be asked where nothing is left to decide; ``{study}`` stands for the study's directory.
    """

    ideal: str = "the model without effects"
    discrepancy_of: str = "prediction"
    remedy_uncertainty: str = ""
    vary: str = "conditions"
    what_else: str = ""


@dataclass(frozen=True)
class Model:
    """A graph of quantities with the effects that may change it.

    Attributes
    ----------
    axes : mapping
        Elements of each axis: ``{"wall": ("x0", "x1", ...), "microphone": ("Mic 1", ...)}``.
    base_effects : tuple of str
        Effects that a new study starts with.
    nuisances : tuple of Nuisance
        Instrument errors with a certificate.
    rig : RigStatement
        Limits of the conditions and uncertainties of instruments and settings.
    words : Words
        What the model calls its own things.
    table_rules : TableRules, optional
        What its tables obey, and which of their columns follow from others.
    receivers : Receivers, optional
        Where it predicts transfer functions: the channels and their places.
    order_lines : OrderLines, optional
        Where it predicts order lines: which, and what a recording tells about them.
    settings : mapping
        The checked rig file, for the model's own simulation and figures; a study never reads it.
    law : LawSpace, optional
        Where a law is looked for when something unknown is missing.
    unsuited : mapping
        Effects that such models know and this rig rules out: ``{name: reason}``.
    notes : tuple of str
        What a user should know before a study starts: size, cost.
    """

    name: str
    title: str
    conditions: Mapping[str, Condition]
    quantities: Mapping[str, Quantity]
    effects: Mapping[str, Effect]
    observables: Mapping[str, Observable]
    base_effects: tuple[str, ...] = ()
    nuisances: tuple[Nuisance, ...] = ()
    axes: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    rig: RigStatement = field(default_factory=RigStatement)
    words: Words = field(default_factory=Words)
    table_rules: TableRules | None = None
    receivers: Receivers | None = None
    order_lines: OrderLines | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)
    law: LawSpace | None = None
    unsuited: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        known = {*self.quantities, *self.conditions}
        for node in self.quantities.values():
            _require_known(node.name, node.reads, known)
        for effect in self.effects.values():
            _require_known(effect.name, effect.reads, known)
            _require_known(effect.name, effect.changes, set(self.quantities))
            if effect.at and effect.at not in self.axes:
                raise RequestError(
                    f"the effect {effect.name!r} acts at one {effect.at}, an axis that {self.name} lacks",
                    remedy=nearest(effect.at, self.axes),
                )
        self._check_observables()
        loop = next(
            (c for c in components({q.name: q.reads for q in self.quantities.values()}) if len(c) > 1), None
        )
        if loop:
            raise RequestError(f"the quantities {', '.join(loop)} of {self.name} read each other in a circle")

    def _check_observables(self) -> None:
        for observable in self.observables.values():
            _require_known(observable.name, (observable.quantity,), set(self.quantities))
            node = self.quantities[observable.quantity]
            if node.unit != observable.unit:
                raise RequestError(
                    f"the observable {observable.name!r} is in {observable.unit}, its quantity "
                    f"{node.name!r} in {node.unit}",
                    expected="the unit of the quantity",
                    remedy="declare that unit, and the unit of a table's column as column_unit",
                )

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of measurement that the model can be held against: ``("table",)``."""
        return tuple(dict.fromkeys(o.kind for o in self.observables.values()))

    def with_effect(self, *more: Effect) -> Model:
        """The same model with further effects in its catalogue (a user's own)."""
        from dataclasses import replace

        return replace(self, effects={**self.effects, **{e.name: e for e in more}})

    def assemble(self, uses: Iterable[Use | str] = ()) -> Assembly:
        """Switch effects on."""
        parsed = {Use.parse(u) if isinstance(u, str) else u for u in uses}
        for use in parsed:
            effect = self.effects.get(use.name)
            if use.name in self.unsuited:
                raise RequestError(f"{use.name} is no effect of this rig: {self.unsuited[use.name]}")
            if effect is None:
                raise RequestError(
                    f"{self.name} knows no effect {use.name!r}", remedy=nearest(use.name, self.effects)
                )
            if effect.at and use.at not in self.axes[effect.at]:
                raise RequestError(
                    f"{use} names no {effect.at} of this rig",
                    expected=f"one of {', '.join(self.axes[effect.at])}",
                )
            if use.at and not effect.at:
                raise RequestError(
                    f"{use.name} acts everywhere, not at {use.at!r}", remedy=f"use {use.name!r}"
                )
        return Assembly(self, tuple(sorted(parsed)))

    def candidates(self, assembly: Assembly) -> tuple[Use, ...]:
        """Uses of effects that the assembly lacks, one for each element of the axis they act at."""
        uses = []
        for effect in self.effects.values():
            elements = self.axes[effect.at] if effect.at else ("",)
            uses += [Use(effect.name, element) for element in elements]
        return tuple(use for use in sorted(uses) if use not in assembly.uses)

    def not_testable(self, available: Iterable[str]) -> dict[str, str]:
        """Effects whose conditions the data lack: ``{"running-in": "needs elapsed_time"}``."""
        readable = set(available) | {n for n, c in self.conditions.items() if c.default is not None}
        known = set(available) | {n for n in readable if n in self.conditions and self.conditions[n].known}
        missing = {}
        for effect in self.effects.values():
            reads = {r for r in effect.reads if r in self.conditions and r not in readable}
            lacking = sorted(reads | {w for w in effect.needs if w not in known and w not in self.quantities})
            if lacking:
                missing[effect.name] = "needs " + ", ".join(lacking)
        return missing


@dataclass(frozen=True)
class Assembly(Evaluator):
    """A model with a set of effects switched on; evaluated for conditions and parameter values."""

    model: Model


def _require_known(owner: str, names: Iterable[str], known: set[str]) -> None:
    for name in names:
        if name not in known:
            raise RequestError(
                f"{owner!r} names the quantity {name!r}, which is not one", remedy=nearest(name, known)
            )
