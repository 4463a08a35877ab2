"""Where a model fails on transfer functions: level and phase, by third octave, receiver and group of receivers.

Whether a place stands out is a matter of the left-out algebra of `LeftOut`: in a cell, a third octave at
one receiver, the prediction may be off along itself (a level) and across itself (a phase). Errors of
different receivers are independent, or low in rank, so what holds for any set of cells follows from sums over
cells. By how much
the model is off there is said in plain dB and degrees (`specan.study.localisation.frf_errors`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.models import Model
from specan.study.estimation.distributions import discoveries
from specan.study.estimation.fit import Fit, misfit_p_value
from specan.study.estimation.prediction_error import LEAST_SHARE, LeftOut
from specan.study.estimation.problem import Problem
from specan.study.localisation.frf_errors import curve_errors  # also offered to `localise`
from specan.study.localisation.localise import (
    CLEAR,
    LEVEL,
    Block,
    Localisation,
    Trend,
    level_and_phase,
    tested,
)
from specan.study.observation import Array, Variable
from specan.study.observation.frf import FrfObservation

MOST_SENTENCES = 3  # that are told
NEAR_MODE = (
    0.03  # of its frequency: about what an error of 10 K or an unmodelled soft boundary moves a mode by
)
LONGEST_RUN = 3  # third octaves: an error that goes on further is said of all frequencies
GAIN = 1.1  # by how much |z| has to be larger for a smaller or larger place to be named instead


@dataclass(frozen=True)
class Failure:
    """Mean error of the model over some cells, and its size in standard uncertainties.

    Attributes
    ----------
    level_dB, phase_deg : float
        Model over measurement; a positive phase is ahead.
    z, z_phase : float
    """

    level_dB: float
    phase_deg: float
    z: float
    z_phase: float

    @property
    def clarity(self) -> float:
        """The larger of both z, as a size."""
        return max(abs(self.z), abs(self.z_phase))


@dataclass(frozen=True)
class Grouping:
    """Which channels a failure is looked for at together, and what they are called."""

    plural: str
    groups: Callable[[Sequence[str]], Mapping[str, list[int]]]
    label: str
    words: str

    @classmethod
    def of(cls, model: Model) -> Grouping:
        """What a model says of its receivers; of a model without places, each channel stands for itself."""
        known = model.receivers
        if known is None:
            return cls("channels", lambda channels: {}, "group", "channels")
        return cls(known.plural, known.groups, known.group_label, known.group_words)


class Cells:
    """Sums over the cells of a fit: what any set of them says.

    Attributes
    ----------
    bands : array
        Nominal third octaves.
    channels : tuple of str
    """

    def __init__(self, algebra: LeftOut) -> None:
        observations = [o for o in algebra.problem.observations if isinstance(o, FrfObservation)]
        band = np.concatenate([o.labels["third_octave_hz"] for o in observations])
        channel = np.concatenate([o.labels["channel"] for o in observations])
        self.bands = np.unique(band)
        lines = np.concatenate([o.conditions["frequency"] for o in observations])
        self.reach_hz = (float(lines.min()), float(lines.max()))
        self.channels = tuple(dict.fromkeys(channel.tolist()))
        turned = np.concatenate([_turned(p) for p in np.split(algebra.predicted, _ends(observations))])
        both = [np.where(band == b, part, 0.0) for b in self.bands for part in (algebra.predicted, turned)]
        parts = np.split(np.stack(both, axis=1), _ends(observations))
        white = np.concatenate([o.whiten_each(part) for o, part in zip(observations, parts, strict=True)])
        spread, shrink = _of_all(observations)
        seen = white.shape[0]
        basis, projected = algebra.basis[:seen], algebra.projected[:seen]
        # Columns of one receiver are whitened to d - U s U'd, with d on its own rows: sums of d and of U'd do.
        self._shared = 2 * shrink - shrink**2
        of_basis, of_clean = (shrink[:, None] * (spread.T @ basis), shrink * (spread.T @ projected))
        self._gram, self._fitted, self._along, self._spread = [], [], [], []
        for name in self.channels:
            rows = np.flatnonzero(channel == name)
            own, onto = white[rows], spread[rows].T @ white[rows]
            self._gram.append(own.T @ own)
            self._spread.append(onto)
            self._fitted.append(own.T @ basis[rows] - onto.T @ of_basis)
            self._along.append(own.T @ projected[rows] - onto.T @ of_clean)

    def statistic(self, channels: Sequence[int], bands: Sequence[int]) -> tuple[float, float]:
        """Chi-square of a level and a phase error over some cells, all others refitted; its degrees of freedom."""
        pick = np.zeros((2 * len(self.bands), 2))
        for b in bands:
            pick[2 * b, 0] = pick[2 * b + 1, 1] = 1.0
        onto = sum(self._spread[m] for m in channels) @ pick
        gram = pick.T @ sum(self._gram[m] for m in channels) @ pick - self._common(onto)
        fitted = pick.T @ sum(self._fitted[m] for m in channels)
        along = pick.T @ sum(self._along[m] for m in channels)
        return _statistic(gram, fitted, along, np.diag(gram))

    def fall(self, variable: str) -> tuple[float, float]:
        """Fall of chi-square, and degrees of freedom, if every level of a variable had its own error."""
        if variable == "channel":
            level = np.tile(np.eye(2), (len(self.bands), 1))
            grams = [level.T @ g @ level for g in self._gram]
            gram = np.zeros((2 * len(grams), 2 * len(grams)))
            for k, g in enumerate(grams):
                gram[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = g
            gram -= self._common(np.concatenate([onto @ level for onto in self._spread], axis=1))
            fitted = np.concatenate([level.T @ f for f in self._fitted])
            along = np.concatenate([level.T @ a for a in self._along])
        else:
            gram, fitted, along = (np.sum(parts, axis=0) for parts in (self._gram, self._fitted, self._along))
            gram = gram - self._common(np.sum(self._spread, axis=0))
        return _statistic(gram, fitted, along, np.diag(gram))

    def _common(self, onto: Array) -> Array:
        """What the errors that all receivers share take from a Gram matrix."""
        taken: Array = onto.T @ (self._shared[:, None] * onto)
        return taken


def _of_all(observations: Sequence[FrfObservation]) -> tuple[Array, Array]:
    """Directions that errors common to all receivers of a recording widen, and by how much each is shortened."""
    from scipy.linalg import block_diag

    found = [o.of_all for o in observations]
    return block_diag(*(basis for basis, _ in found)), np.concatenate([shrink for _, shrink in found])


def _statistic(gram: Array, fitted: Array, along: Array, whole: Array) -> tuple[float, float]:
    """Chi-square along directions; those that the parameters all but absorb do not count."""
    size = np.sqrt(np.maximum(whole, 1e-300))
    values, vectors = np.linalg.eigh((gram - fitted @ fitted.T) / np.outer(size, size))
    kept = values > LEAST_SHARE
    turned = vectors[:, kept].T @ (along / size)
    return float(np.sum(turned**2 / values[kept])), float(kept.sum())


def _ends(observations: Sequence[Any]) -> NDArray[np.intp]:
    return np.cumsum([o.n for o in observations])[:-1]


def _turned(predicted: Array) -> Array:
    """Real parts, then imaginary parts, of the prediction times j."""
    real, imaginary = np.split(predicted, 2)
    return np.concatenate([-imaginary, real])


class Words:
    """Level and phase errors of all recordings of a problem, over any set of cells of `Cells`."""

    def __init__(self, problem: Problem, best: Fit, cells: Cells) -> None:
        predictions = problem.plain(best.theta)
        self._errors = [
            curve_errors(o, p)  # type: ignore[arg-type]
            for o, p in zip(problem.observations, predictions, strict=True)
        ]
        self._cells = cells
        self._modes = [_named_modes(problem, o, best.theta) for o in problem.observations]

    def details(self, channels: Sequence[int], bands: Sequence[int]) -> tuple[str, str]:
        """The least and the largest error over some receivers and bands, and the line, and mode, of the largest."""
        names, wanted = {self._cells.channels[m] for m in channels}, self._cells.bands[list(bands)]
        found = []
        for one, modes in zip(self._errors, self._modes, strict=True):
            rows = [m for m, name in enumerate(one.channels) if name in names]
            inside = np.flatnonzero(np.isin(one.bands, wanted)).tolist()
            if rows and inside:
                frequency, size = one.worst_line(rows, inside)
                found.append((size, frequency, _near_mode(frequency, modes), one.extremes(rows, inside)))
        if not found:
            return "", ""
        _, frequency, mode, between = max(found)
        return between, f"most at {frequency:.0f} Hz{f' ({mode})' if mode else ''}"

    def failure(self, channels: Sequence[int], bands: Sequence[int]) -> Failure:
        """Mean error over some receivers and bands: of several recordings, of the one that is furthest off."""
        names = {self._cells.channels[m] for m in channels}
        wanted = self._cells.bands[list(bands)]
        found = []
        for one in self._errors:
            rows = [m for m, name in enumerate(one.channels) if name in names]
            level, u_level, phase, u_phase = one.mean(
                rows, np.flatnonzero(np.isin(one.bands, wanted)).tolist()
            )
            if np.isfinite(level):
                found.append(Failure(level, phase, level / u_level, phase / u_phase))
        return max(found, key=lambda f: f.clarity)


def _named_modes(problem: Problem, observation: Any, theta: Array) -> list[tuple[float, str]]:
    """Modes of the fitted model that have a name."""
    receivers = problem.assembly.model.receivers
    named = None if receivers is None else receivers.modes
    if named is None:
        return []
    values = problem.seen_by(observation, problem.values_at(theta))
    found = problem.assembly.evaluate(observation.conditions_at_nodes, values, wanted=list(named.reads))
    quantities = {name: found[name] for name in named.reads}
    return named.names(quantities, (1 + NEAR_MODE) * float(observation.frequency_hz[-1]))


def _near_mode(frequency_hz: float, modes: Sequence[tuple[float, str]]) -> str:
    """The mode nearest to a line; where none is near, only whether all are above."""
    if not modes:
        return ""
    own, name = min(modes, key=lambda mode: abs(mode[0] - frequency_hz))
    if abs(own - frequency_hz) <= NEAR_MODE * frequency_hz:
        return f"{name}, {own:.0f} Hz"
    return f"below the first mode, {modes[0][0]:.0f} Hz" if frequency_hz < modes[0][0] else "between modes"


def localise(problem: Problem, best: Fit) -> Localisation:
    """Find third octaves, receivers and groups of them at which a fitted model of transfer functions fails."""
    cells = Cells(LeftOut(problem, best))
    words = Words(problem, best, cells)
    grouping = Grouping.of(problem.assembly.model)
    near = grouping.groups(cells.channels)
    variables = {
        **problem.observations[0].variables,
        grouping.label: Variable(grouping.words, before=True),
    }
    places = list(_places(cells, near, grouping.label))
    blocks = [_block(cells, words, problem, where, m, b, variables) for where, m, b in places]
    marked = []
    for block, (_, m, b) in zip(tested(blocks), places, strict=True):
        between, most_at = words.details(m, b) if block.significant else ("", "")
        marked.append(replace(block, between=between, most_at=most_at))
    fails = any(b.significant for b in marked)
    return Localisation(
        blocks=tuple(sorted(marked, key=lambda b: (b.p_value, -b.statistic))),
        trends=_trends(cells, problem, variables),
        notes=tuple(_sentences(cells, words, near, grouping)) if fails else (),
    )


Place = tuple[dict[str, Any], list[int], list[int]]


def _places(cells: Cells, near: Mapping[str, list[int]], label: str) -> Iterator[Place]:
    """Third octaves, receivers, groups, and every pair of a third octave with one of the others."""
    everywhere, always = list(range(len(cells.channels))), list(range(len(cells.bands)))
    groups: list[tuple[dict[str, Any], list[int]]] = []
    if len(everywhere) > 1:
        groups += [({"channel": name}, [m]) for m, name in enumerate(cells.channels)]
    groups += [({label: group}, inside) for group, inside in near.items()]
    for where, chosen in groups:
        yield where, chosen, always
    for b, band in enumerate(cells.bands.tolist()):
        yield {"third_octave_hz": band}, everywhere, [b]
        for where, chosen in groups:
            yield {"third_octave_hz": band, **where}, chosen, [b]


def _block(
    cells: Cells,
    words: Words,
    problem: Problem,
    where: Mapping[str, Any],
    channels: list[int],
    bands: list[int],
    variables: Mapping[str, Variable],
) -> Block:
    found = words.failure(channels, bands)
    statistic, dof = cells.statistic(channels, bands)
    rows = sum(
        int(np.sum(np.isin(o.labels["third_octave_hz"], cells.bands[bands])
                   & np.isin(o.labels["channel"], [cells.channels[m] for m in channels])))
        for o in problem.observations
    )  # fmt: skip
    observable = str(problem.observations[0].observable[0])  # type: ignore[attr-defined]
    relative = 100 * (10 ** (found.level_dB / 20) - 1)
    p = misfit_p_value(statistic, dof, problem.noise_dof) if dof else float("nan")
    unit = problem.assembly.model.observables[observable].unit
    return Block(
        where, observable, rows, statistic, p, found.z, relative, float("nan"), unit,
        level_dB=found.level_dB, phase_deg=found.phase_deg, z_phase=found.z_phase, variables=variables,
    )  # fmt: skip


def _trends(cells: Cells, problem: Problem, variables: Mapping[str, Variable]) -> tuple[Trend, ...]:
    names = ["third_octave_hz", *(["channel"] if len(cells.channels) > 1 else [])]
    p = [misfit_p_value(*cells.fall(name), problem.noise_dof) for name in names]
    passed = discoveries(p, LEVEL)
    found = [Trend(n, v, bool(ok), "", variables[n].words) for n, v, ok in zip(names, p, passed, strict=True)]
    return tuple(sorted(found, key=lambda t: t.p_value))


# --- sentences ---------------------------------------------------------------------------------------


def _sentences(cells: Cells, words: Words, near: Mapping[str, list[int]], grouping: Grouping) -> list[str]:
    """The clearest places, each a run of third octaves at some receivers; none twice."""
    groups: list[tuple[str, list[int]]] = [(f"all {grouping.plural}", list(range(len(cells.channels))))]
    groups += [(f"{grouping.words} {group}", inside) for group, inside in near.items()]
    groups += [(name, [m]) for m, name in enumerate(cells.channels)]
    count = len(cells.bands)
    ends = [(a, a + n) for n in range(1, LONGEST_RUN + 1) for a in range(count - n + 1)]
    runs = [list(range(*pair)) for pair in dict.fromkeys([*ends, (0, count)])]
    every = [(words.failure(m, b), text, m, b) for text, m in groups for b in runs]
    taken: set[tuple[int, int]] = set()
    found: list[str] = []
    for _ in range(MOST_SENTENCES):
        free = [e for e in every if not taken.intersection((m, b) for m in e[2] for b in e[3])]
        if not free:
            break
        best = max(free, key=lambda e: e[0].clarity)
        # of places that are about as clear, the widest says most
        alike = [e for e in free if GAIN * e[0].clarity >= best[0].clarity]
        failure, text, channels, bands = max(alike, key=lambda e: len(e[2]) * len(e[3]))
        if failure.clarity < CLEAR:
            break
        taken |= {(m, b) for m in channels for b in bands}
        z = failure.z if abs(failure.z) >= abs(failure.z_phase) else failure.z_phase
        band = "all frequencies" if len(bands) == count else _edges(cells.bands[bands], cells.reach_hz)
        where = f"{band}, {text}"
        text = level_and_phase(failure.level_dB, failure.z, failure.phase_deg, failure.z_phase)
        found.append(f"{where}: {text} (z = {z:.1f}), {words.details(channels, bands)[1]}")
    return found


def _edges(bands: Array, reach_hz: tuple[float, float]) -> str:
    """Lower and upper edge of a run of third octaves, as far as lines reach: ``178-224 Hz``."""
    exact = 1000 * 10 ** (np.round(10 * np.log10(bands / 1000)) / 10)
    return f"{max(exact[0] * 10**-0.05, reach_hz[0]):.0f}-{min(exact[-1] * 10**0.05, reach_hz[1]):.0f} Hz"
