"""Where a model fails on transfer functions: level and phase, by third octave, receiver and group of receivers.

In a cell, a third octave at one receiver, a prediction is off in level and in phase, each with its standard uncertainty
(`specan.study.localisation.frf_errors`). The mean over any set of cells, in its own uncertainty, says how far the model
is off there and whether that place stands out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from specan.study.estimation.fit import Fit, misfit_p_value
from specan.study.estimation.problem import Problem
from specan.study.localisation.frf_errors import FrfErrors, curve_errors
from specan.study.localisation.localise import CLEAR, Block, Localisation, level_and_phase, tested, trends_of
from specan.study.observation import Array, Variable

# of its frequency: about what an error of 10 K or an unmodelled soft boundary moves a mode by
NEAR_MODE = 0.03

Modes = Callable[[Any], list[tuple[float, str]]]
Groups = tuple[Callable[[Sequence[str]], Mapping[str, list[int]]], str, str]
NO_GROUPS: Groups = (lambda channels: {}, "group", "channels")
Cells = tuple[Sequence[int], Sequence[int]]  # numbers of channels and of third octaves


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
        """The larger of the two in standard uncertainties."""
        return max(abs(self.z), abs(self.z_phase))


class _Errors:
    """The errors of all recordings, their third octaves and receivers."""

    def __init__(self, problem: Problem, best: Fit, modes_of: Modes) -> None:
        seen = list(zip(problem.observations, problem.plain(best.theta), strict=True))
        self._each = [(curve_errors(o, p), modes_of(o)) for o, p in seen]  # type: ignore[arg-type]
        self.bands: Array = np.unique(np.concatenate([one.bands for one, _ in self._each]))
        used = [name for one, _ in self._each for name, m in zip(one.channels, one.measured) if m.any()]
        self.channels = tuple(dict.fromkeys(used))
        lines = np.concatenate([one.frequency_hz[one.measured.any(axis=0)] for one, _ in self._each])
        self.reach_hz = (float(lines.min()), float(lines.max()))

    def _within(self, cells: Cells) -> Iterator[tuple[FrfErrors, list[tuple[float, str]], list[int], Any]]:
        """Each recording with its named modes, and the numbers that receivers and third octaves have in it."""
        names, wanted = {self.channels[m] for m in cells[0]}, self.bands[list(cells[1])]
        for one, modes in self._each:
            rows = [m for m, name in enumerate(one.channels) if name in names]
            inside = np.flatnonzero(np.isin(one.bands, wanted)).tolist()
            if rows and inside:
                yield one, modes, rows, inside

    def count(self, cells: Cells) -> int:
        """Values in some cells."""
        parts = self._within(cells)
        lines = [one.measured[m][:, np.isin(one.band_of_line, b)] for one, _, m, b in parts]
        return 2 * sum(map(np.count_nonzero, lines))

    def failure(self, cells: Cells) -> Failure:
        """Mean error over some cells; of several recordings that of the clearest."""
        found = []
        for one, _, rows, inside in self._within(cells):
            level, u_level, phase, u_phase = one.mean(rows, inside)
            if np.isfinite(level):
                found.append(Failure(level, phase, level / u_level, phase / u_phase))
        return max(found, key=lambda f: f.clarity)

    def most_at(self, cells: Cells) -> str:
        """The line with the largest error within a place, by its mode."""
        found = []
        for one, modes, rows, inside in self._within(cells):
            frequency, size = one.worst_line(rows, inside)
            found.append((size, frequency, _near_mode(frequency, modes)))
        _, frequency, mode = max(found)
        return f"most at {frequency:.0f} Hz{f' ({mode})' if mode else ''}"


def _near_mode(frequency_hz: float, modes: Sequence[tuple[float, str]]) -> str:
    if not modes:
        return ""
    own, name = min(modes, key=lambda mode: abs(mode[0] - frequency_hz))
    if abs(own - frequency_hz) <= NEAR_MODE * frequency_hz:
        return f"{name}, {own:.0f} Hz"
    return f"below the first mode, {modes[0][0]:.0f} Hz" if frequency_hz < modes[0][0] else "between modes"


def localise(
    problem: Problem, best: Fit, groups_of: Groups = NO_GROUPS, modes_of: Modes = lambda observation: []
) -> Localisation:
    """Find third octaves, receivers and groups of them at which a fitted model of transfer functions fails.

    Parameters
    ----------
    problem : Problem
    best : Fit
    groups_of : tuple of callable, str, str
        Channels that are looked at together, ``groups_of(channels) -> {name: numbers}``; the key of that name in
        results, and words before it.
    modes_of : callable, optional
        ``modes_of(observation) -> [(natural frequency, name), ...]``, so that a failure near one can be told by it.
    """
    errors = _Errors(problem, best, modes_of)
    grouped, label, words = groups_of
    near = grouped(errors.channels)
    variables = {**problem.observations[0].variables, label: Variable(words, before=True)}
    observable = str(problem.observations[0].observable[0])  # type: ignore[attr-defined]
    unit = problem.assembly.model.observables[observable].unit
    places = list(_places(errors, near, label))
    blocks = []
    for where, cells in places:
        off = errors.failure(cells)
        statistic = off.z**2 + off.z_phase**2
        p, relative = misfit_p_value(statistic, 2.0, problem.noise_dof), 100 * (10 ** (off.level_dB / 20) - 1)
        blocks.append(
            Block(
                where, observable, errors.count(cells), statistic, p, off.z, relative, float("nan"), unit,
                level_dB=off.level_dB, phase_deg=off.phase_deg, z_phase=off.z_phase, variables=variables,
            )
        )  # fmt: skip
    marked = [
        replace(block, most_at=errors.most_at(cells)) if block.significant else block
        for block, (_, cells) in zip(tested(blocks), places, strict=True)
    ]
    groups: list[tuple[str, Sequence[int]]] = [
        (f"all {problem.observations[0].plural}", range(len(errors.channels)))  # type: ignore[attr-defined]
    ]
    groups += [(f"{words} {group}", inside) for group, inside in near.items()]
    groups += [(name, [m]) for m, name in enumerate(errors.channels)]
    fails = any(b.significant for b in marked)
    return Localisation(
        blocks=tuple(sorted(marked, key=lambda b: (b.p_value, -b.statistic))),
        trends=tuple(trends_of(marked, ("third_octave_hz", "channel"), variables, problem.noise_dof)),
        notes=tuple(_sentences(errors, groups)) if fails else (),
    )


def _places(
    errors: _Errors, near: Mapping[str, Sequence[int]], label: str
) -> Iterator[tuple[dict[str, Any], Cells]]:
    """Third octaves, receivers, groups, and every pair of a third octave with one of the others."""
    everywhere, always = range(len(errors.channels)), range(len(errors.bands))
    groups: list[tuple[dict[str, Any], Sequence[int]]] = []
    groups += [({"channel": name}, [m]) for m, name in enumerate(errors.channels) if len(everywhere) > 1]
    groups += [({label: group}, inside) for group, inside in near.items()]
    for where, chosen in groups:
        yield where, (chosen, always)
    for b, band in enumerate(errors.bands.tolist()):
        yield {"third_octave_hz": band}, (everywhere, [b])
        for where, chosen in groups:
            yield {"third_octave_hz": band, **where}, (chosen, [b])


def _sentences(errors: _Errors, groups: Sequence[tuple[str, Sequence[int]]]) -> list[str]:
    """The clearest places, each a run of third octaves at some receivers; none twice."""
    count = len(errors.bands)
    # of up to three third octaves: an error that goes on further is said of all frequencies
    ends = [(a, a + n) for n in (1, 2, 3) for a in range(count - n + 1)]
    runs = [range(*pair) for pair in dict.fromkeys([*ends, (0, count)])]
    every = [(errors.failure((m, b)), text, m, b) for text, m in groups for b in runs]
    taken: set[tuple[int, int]] = set()
    found: list[str] = []
    for _ in range(3):
        free = [e for e in every if not taken.intersection((m, b) for m in e[2] for b in e[3])]
        best = max((e[0].clarity for e in free), default=0.0)
        if best < CLEAR:
            break
        # a smaller or larger place is named instead only where |z| is larger by a tenth
        alike = [e for e in free if 1.1 * e[0].clarity >= best]
        off, text, channels, bands = max(alike, key=lambda e: len(e[2]) * len(e[3]))
        taken |= {(m, b) for m in channels for b in bands}
        z = off.z if abs(off.z) >= abs(off.z_phase) else off.z_phase
        band = (
            "all frequencies" if len(bands) == count else _edges(errors.bands[list(bands)], errors.reach_hz)
        )
        said = level_and_phase(off.level_dB, off.z, off.phase_deg, off.z_phase)
        found.append(f"{band}, {text}: {said} (z = {z:.1f}), {errors.most_at((channels, bands))}")
    return found


def _edges(bands: Array, reach_hz: tuple[float, float]) -> str:
    """Lower and upper edge of a run of third octaves, as far as lines reach: ``178-224 Hz``."""
    exact = 1000 * 10 ** (np.round(10 * np.log10(bands / 1000)) / 10)
    return f"{max(exact[0] * 10**-0.05, reach_hz[0]):.0f}-{min(exact[-1] * 10**0.05, reach_hz[1]):.0f} Hz"
