"""Where a fitted model fails, looked for in the way that suits the kind of measurement.

Rows of tables are looked at by left-out blocks (`LeftOut`) over every operating variable, with false discoveries
controlled.

Other kinds have a module of their own, with a function ``localise(problem, best) -> Localisation`` and, where they hold
curves, ``curve_errors(observation, predicted)``. So may an installed kind (an entry point of the group
``specan.measurement_kinds``).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.result import picked
from specan.study.estimation.fit import Fit, discoveries, misfit_p_value
from specan.study.estimation.prediction_error import LeftOut
from specan.study.estimation.problem import Problem
from specan.study.observation import Variable, brought, shared_labels, variable_named
from specan.units import spoken

CLEAR = 3.0  # |z| from which a mean error is named


@dataclass(frozen=True)
class Block:
    """Rows that were left out together.

    Attributes
    ----------
    where : mapping
        Operating variable to level, ``{"load_kN": 2.0}``.
    n : int
        Number of rows.
    statistic, p_value : float
        S_b and its probability under a true model.
    z : float
        Mean relative error over its standard uncertainty; positive where the model is high.
    error_percent, error : float
        That mean relative error of the prediction, and what it is in the observable's unit.
    significant : bool
        Passed by Benjamini and Yekutieli's rule (blocks overlap) at a false discovery rate of 5 %.
    level_dB, phase_deg, z_phase : float or None
        Of transfer functions: model over measurement, and the z of the phase (`z` is that of the level).
    most_at : str
        Of transfer functions: where the error is largest, and the mode that is near.
    variables : mapping
        Words and unit of the operating variables.
    """

    where: Mapping[str, Any]
    observable: str
    n: int
    statistic: float
    p_value: float
    z: float
    error_percent: float
    error: float
    unit: str
    significant: bool = False
    level_dB: float | None = None
    phase_deg: float | None = None
    z_phase: float | None = None
    most_at: str = ""
    variables: Mapping[str, Variable] = field(default_factory=dict, repr=False)

    @property
    def text(self) -> str:
        """What the model does there: ``model 4.2 % (0.11 mm) high``, ``model 4 dB high``."""
        if self.level_dB is not None:
            return level_and_phase(self.level_dB, self.z, self.phase_deg, self.z_phase)
        if abs(self.z) < CLEAR:
            return "model off in both directions"
        size = f" ({spoken(abs(self.error), unit=self.unit, digits=2)})" if self.unit not in ("", "1") else ""
        return f"model {spoken(abs(self.error_percent), digits=2)} %{size} {'high' if self.z > 0 else 'low'}"

    @property
    def place(self) -> str:
        """Where that is: ``2 kN (load), 60 mm (width)``."""
        return ", ".join(self._variable(name).spoken(level) for name, level in self.where.items())

    @property
    def short_place(self) -> str:
        """The same without the variables' names: ``2 kN, 60 mm``."""
        return ", ".join(self._variable(name).short(level) for name, level in self.where.items())

    def _variable(self, name: str) -> Variable:
        return variable_named(name, self.variables)

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        levels = "" if self.level_dB is None else " level_dB phase_deg z_phase most_at"
        return picked(self, "where place observable z p_value error_percent error unit n text" + levels)


@dataclass(frozen=True)
class Trend:
    """Whether the residual depends on an operating variable at all.

    Attributes
    ----------
    p_value : float
        Of the fall in chi-square if every level had its own offset.
    sentence : str
        ``fails from 2 kN up: model 6 % low (z = -5.1)``; empty where there is nothing to say.
    """

    variable: str
    p_value: float
    significant: bool
    sentence: str
    words: str = ""


@dataclass(frozen=True)
class Localisation:
    """Blocks and trends of one fit, the most improbable first.

    Attributes
    ----------
    notes : tuple of str
        Sentences on where it fails, where they say more than those of the trends.
    """

    blocks: tuple[Block, ...]
    trends: tuple[Trend, ...]
    notes: tuple[str, ...] = ()

    @property
    def fails_at(self) -> tuple[Block, ...]:
        """Blocks that are significant."""
        return tuple(b for b in self.blocks if b.significant)

    def sentences(self) -> list[str]:
        """Where the model fails and where not, in words."""
        failing = list(self.notes) or list(
            dict.fromkeys(t.sentence for t in self.trends if t.significant and t.sentence)
        )
        calm = [f"{t.words or t.variable} (p = {t.p_value:.2g})" for t in self.trends if not t.significant]
        if not failing and self.fails_at:
            worst = self.fails_at[0]
            failing = [f"fails at {worst.place}: {worst.text} (z = {worst.z:.1f})"]
        if not failing:
            return ["no operating range deviates significantly"]
        return [*failing, *(["no dependence on " + ", ".join(calm)] if calm else [])]


def level_and_phase(level_dB: float | None, z: float, phase_deg: float | None, z_phase: float | None) -> str:
    """``model 4.0 dB high``, ``model 12 degrees ahead``, or both.

    Examples
    --------
    >>> level_and_phase(3.96, 8.0, -2.0, -1.0)
    'model 4 dB high'
    >>> level_and_phase(-0.31, -4.0, -12.2, -9.0)
    'model 0.31 dB low and 12 degrees behind'
    """
    parts = []
    if abs(z) >= CLEAR and level_dB is not None:
        parts.append(f"{spoken(abs(level_dB), digits=2)} dB {'high' if level_dB > 0 else 'low'}")
    if z_phase is not None and abs(z_phase) >= CLEAR and phase_deg is not None:
        parts.append(f"{spoken(abs(phase_deg), digits=2)} degrees {'ahead' if phase_deg > 0 else 'behind'}")
    return "model " + (" and ".join(parts) or "off equally in both directions")


@dataclass(frozen=True)
class MistakenSetUp:
    """What is declared wrongly about a recording.

    Attributes
    ----------
    text : str
        The mistake as a sentence; empty where none is seen.
    before_percent, after_percent : float
        RMS error of the response, part of its RMS, as declared and with the mistake undone.
    """

    text: str = ""
    before_percent: float = 0.0
    after_percent: float = 0.0

    @property
    def sentence(self) -> str:
        """The mistake, and by how much the error falls without it."""
        return (
            f"{self.text}: the response is off by {spoken(self.before_percent, digits=2)} % as declared and by "
            f"{spoken(self.after_percent, digits=2)} % otherwise"
        )


def mistaken_set_up(problem: Problem) -> MistakenSetUp:
    """A mistake of the set-up that explains why a model is far from the data, where its kind can tell."""
    look = brought(problem.observations, "mistaken_set_up")
    return look(problem) if look else MistakenSetUp()


def localise(problem: Problem, best: Fit) -> Localisation:
    """Find where a fitted model fails.

    Parameters
    ----------
    problem : Problem
        Over observations of one kind, or of several, which are then looked at by blocks.
    best : Fit
        Its minimum.

    Returns
    -------
    Localisation
        Blocks and trends, the most improbable first.
    """
    found: Localisation = (brought(problem.observations, "localise") or by_blocks)(problem, best)
    return found


def curve_errors(problem: Problem, best: Fit) -> list[Any]:
    """Level and phase errors of every recording whose kind of measurement holds curves; none where none does.

    See `specan.study.localisation.by_band_and_channel.FrfErrors`.
    """
    predictions = problem.plain(best.theta)
    ways = [brought([o], "curve_errors") for o in problem.observations]
    return [way(o, p) for way, o, p in zip(ways, problem.observations, predictions, strict=True) if way]


def by_blocks(problem: Problem, best: Fit) -> Localisation:
    """Find the operating conditions at which a fitted model fails.

    Parameters
    ----------
    problem : Problem
    best : Fit
        Its minimum.
    """
    algebra = LeftOut(problem, best)
    labels, variables = shared_labels(problem.observations), dict(problem.observations[0].variables)
    marked = tested([_block(algebra, *one, variables) for one in _off(algebra, _places(labels))])
    trends = [
        replace(t, sentence=_sentence(algebra, t.variable, labels[t.variable], marked, variables))
        if t.significant
        else t
        for t in trends_of(marked, labels, variables, problem.noise_dof)
    ]
    return Localisation(tuple(sorted(marked, key=lambda b: b.p_value)), tuple(trends))


def tested(blocks: Sequence[Block]) -> list[Block]:
    """The blocks, told which of them are significant among all."""
    passed = discoveries([b.p_value for b in blocks])
    return [replace(b, significant=bool(ok)) for b, ok in zip(blocks, passed, strict=True)]


def trends_of(
    blocks: Sequence[Block], names: Iterable[str], variables: Mapping[str, Variable], noise_dof: float
) -> list[Trend]:
    """A model depends wrongly on what it is far off at one level of, the number of levels allowed for."""
    found = {}
    for name in names:
        alone = [b for b in blocks if set(b.where) == {name}]
        # of blocks without a phase by their direction alone
        p = [misfit_p_value(b.z**2, 1.0, noise_dof) if b.z_phase is None else b.p_value for b in alone]
        if p:
            found[name] = min(1.0, len(p) * min(p))
    passed = discoveries(list(found.values()))
    trends = [
        Trend(name, p, bool(ok), "", variable_named(name, variables).words)
        for (name, p), ok in zip(found.items(), passed, strict=True)
    ]
    return sorted(trends, key=lambda t: t.p_value)


def _places(labels: Mapping[str, NDArray[Any]]) -> list[tuple[dict[str, Any], NDArray[np.bool_]]]:
    """Every level of every variable, and every combination of levels of two of them."""
    single = [
        ({name: level}, values == level) for name, values in labels.items() for level in _levels(values)
    ]
    pairs = [
        ({a: one, b: two}, (labels[a] == one) & (labels[b] == two))
        for a, b in combinations(labels, 2)
        for one in _levels(labels[a])
        for two in _levels(labels[b])
    ]
    found: dict[bytes, tuple[dict[str, Any], NDArray[np.bool_]]] = {}
    for where, rows in [*single, *pairs]:
        if np.any(rows) and not np.all(rows):
            found.setdefault(rows.tobytes(), (where, rows))  # the same rows under two names count once
    return list(found.values())


def _levels(values: NDArray[Any]) -> list[Any]:
    return np.unique(values).tolist()


def _off(
    algebra: LeftOut, places: Iterable[tuple[Any, NDArray[np.bool_]]]
) -> list[tuple[Any, str, NDArray[np.bool_], tuple[float, float]]]:
    """By how much the model is off at each place, in part and in standard uncertainties.

    Two observables may be off to opposite sides for one reason: each by itself.
    """
    each = [
        (place, name, rows & mine)
        for place, rows in places
        for name, mine in algebra.problem.observable_rows.items()
        if np.any(rows & mine)
    ]
    directions = algebra.directions([rows for _, _, rows in each])
    return [(*one, along) for one, along in zip(each, directions, strict=True)]


def _block(
    algebra: LeftOut,
    where: Mapping[str, Any],
    observable: str,
    rows: NDArray[np.bool_],
    direction: tuple[float, float],
    variables: Mapping[str, Variable],
) -> Block:
    error, z = direction
    if rows.size <= 3000:  # of data; beyond it blocks are tested by their direction only
        statistic, dof = algebra.statistic(rows)
    else:
        statistic, dof = z**2, 1.0
    p = misfit_p_value(statistic, dof, algebra.problem.noise_dof)
    known = algebra.problem.assembly.model.observables.get(observable)
    size = error * float(np.mean(algebra.predicted[rows]))
    unit = known.unit if known else ""
    return Block(
        where, observable, int(rows.sum()), statistic, p, z, 100 * error, size, unit, variables=variables
    )


def _sentence(
    algebra: LeftOut,
    name: str,
    values: NDArray[Any],
    blocks: Sequence[Block],
    variables: Mapping[str, Variable],
) -> str:
    """The end of a variable's range, the level, or the level in company, at which the model is furthest off."""
    levels, variable = _levels(values), variable_named(name, variables)
    tried = [(f"at {variable.spoken(level)}", values == level) for level in levels]
    if not isinstance(levels[0], str):
        tried += [(f"from {variable.spoken(level)} up", values >= level) for level in levels[1:-1]]
        tried += [(f"up to {variable.spoken(level)}", values <= level) for level in levels[1:-1]]
    text, what, _, (error, z) = max(_off(algebra, tried), key=lambda found: abs(found[3][1]))
    if abs(z) >= CLEAR:
        whose = (
            f"{what.replace('_', ' ')} of the model" if len(algebra.problem.observable_rows) > 1 else "model"
        )
        size = spoken(100 * abs(error), unit="percent", digits=2)
        return f"fails {text}: {whose} {size} {'high' if z > 0 else 'low'} (z = {z:.1f})"
    company = [b for b in blocks if name in b.where and len(b.where) > 1]
    worst = max(company, key=lambda b: abs(b.z), default=None)
    if worst is not None and abs(worst.z) >= CLEAR:
        return f"fails at {worst.place}: {worst.text} (z = {worst.z:.1f})"
    return f"fails with {variable.words}, in both directions"
