"""Where a model fails on transfer functions: level and phase, by third octave, receiver and group of receivers.

In a cell, a third octave at one receiver, the errors of level and phase are

    dL = 10 lg (sum |H_a|^2 / sum |H_x|^2),    dphi = arg sum H_a conj(H_x),

with H_a the model's and H_x the measured transfer function. They carry the uncertainty of the measurement and of what
is declared about it and the model. The mean over any set of cells, in its own uncertainty, says how far the model is
off there and whether that place stands out.

FRAC (over the lines of a receiver; Heylen and Lammens 1996) and CSAC (over the receivers of a line; Zang, Grafe and
Imregun 2001) have none, and hardly move where chi-square sees an effect: they are shown and decide nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.arrays import Complex
from specan.dsp.bands import band_at, band_edges
from specan.errors import require_known
from specan.study.estimation.fit import Fit, misfit_p_value
from specan.study.estimation.problem import Problem
from specan.study.localisation.localise import CLEAR, Block, Localisation, level_and_phase, tested, trends_of
from specan.study.observation import Array, Variable
from specan.study.observation.frf import FrfObservation

DB = 20 / np.log(10)  # decibels of a relative change


class FrfErrors:
    """Errors of one recording; NaN where a receiver is not in use.

    Parameters
    ----------
    observation : FrfObservation
    predicted : array (observation.n,)
        What the model expects in place of `observation.measured`.

    Attributes
    ----------
    bands : array (bands,)
        Nominal third octaves, Hz.
    third : Variable
        Words of the third octaves, and which of them the lines fill in part only.
    level_dB, u_level_dB, phase_deg, u_phase_deg : array (receivers, bands)
        Model over measurement, and standard uncertainties; a positive phase is ahead.
    frac : array (receivers,)
    csac : array (bands,)
        Mean over the lines of the band.
    common : complex array (receivers, bands, errors)
        One standard deviation each of what the bands of a receiver share; relative, the real part to the
        level, the imaginary part to the phase.
    of_all : int
        How many of the last of these errors all receivers share: of their frame, of the modes.
    frequency_hz : array (lines,)
    band_of_line : array (lines,)
        Number of the third octave of every line.
    measured, model : complex array (receivers, lines)
        Zero where a receiver is not in use.
    """

    def __init__(self, observation: FrfObservation, predicted: Array) -> None:
        kept = observation.kept
        self.recording, self.plural = observation.name, observation.plural
        self.channels = observation.channels
        self.third, self.frequency_hz = observation.variables["third_octave_hz"], observation.frequency_hz
        self.measured: Complex = np.where(kept, observation.response, 0.0)
        self.model = observation.lines_of(predicted)
        labels = np.zeros(kept.shape)
        labels[kept] = observation.labels["third_octave_hz"][: observation.n // 2]
        self.bands: Array = np.unique(labels[kept])
        self.band_of_line = np.searchsorted(self.bands, labels.max(axis=0))
        self.of_all = 0 if observation.modal is None else observation.modal.shape[-1]
        parts = np.full((4, len(kept), len(self.bands)), np.nan)
        self.common: Complex = np.zeros(
            (*parts.shape[1:], observation.common_at((0, 0)).shape[-1]), dtype=complex
        )
        for m in np.flatnonzero(kept.any(axis=1)).tolist():
            for b, band in enumerate(self.bands):
                lines = np.flatnonzero(labels[m] == band)
                if lines.size:
                    seen = self.measured[m, lines], self.model[m, lines]
                    parts[:, m, b], self.common[m, b] = _cell(observation, m, lines, *seen)
        self.level_dB, self.u_level_dB, self.phase_deg, self.u_phase_deg = parts
        self.frac, by_line = (assurance(self.measured, self.model, axis=axis) for axis in (1, 0))
        of_band = self.band_of_line == np.arange(len(self.bands))[:, None]
        self.csac = np.array([np.nanmean(by_line[lines]) for lines in of_band])

    def mean(self, rows: Sequence[int], bands: Sequence[int]) -> tuple[float, float, float, float]:
        """Mean level error over some receivers and bands, dB, its uncertainty; the same of the phase, degrees."""
        cells = np.ix_(rows, bands)
        there = np.isfinite(self.level_dB[cells])
        count = int(there.sum())
        if not count:
            return (float("nan"),) * 4
        found: list[float] = []
        for value, spread, part, unit in (
            (self.level_dB, self.u_level_dB, self.common.real, DB),
            (self.phase_deg, self.u_phase_deg, self.common.imag, 180 / np.pi),
        ):
            shared = np.where(there[..., None], unit * part[cells], 0.0)
            own = np.where(there, spread[cells], 0.0) ** 2 - np.sum(shared**2, axis=-1)
            of_each, of_all = np.split(shared.sum(axis=1), [shared.shape[-1] - self.of_all], axis=-1)
            variance = np.sum(np.maximum(own, 0.0)) + np.sum(of_each**2) + np.sum(of_all.sum(axis=0) ** 2)
            found += [float(np.nanmean(value[cells])), float(np.sqrt(variance)) / count]
        return found[0], found[1], found[2], found[3]

    @property
    def band_texts(self) -> list[str]:
        """The third octaves as they are printed."""
        return [self.third.short(band, unit=False) for band in self.bands.tolist()]

    @property
    def worst_band(self) -> int:
        """The third octave that is furthest off over all receivers; one that lines fill in part only if all are."""
        off = np.nanmean((self.level_dB / self.u_level_dB) ** 2, axis=0)
        whole = ~np.isin(self.bands, list(self.third.partial))
        return int(np.nanargmax(np.where(whole, off, -1.0) if whole.any() else off))

    def worst_line(self, rows: Sequence[int], bands: Sequence[int]) -> tuple[float, float]:
        """Frequency of the line with the largest error over some receivers and bands, and that error squared."""
        inside = np.isin(self.band_of_line, list(bands))
        off = np.sum(np.abs(self.model[rows] - self.measured[rows]) ** 2, axis=0) * inside
        return float(self.frequency_hz[np.argmax(off)]), float(off.max())

    def number(self, channel: str | None) -> int:
        """Row of a receiver; of the one with the clearest level error if none is named.

        Raises
        ------
        RequestError
            No such receiver is in use.
        """
        used = [c for c, f in zip(self.channels, self.frac, strict=True) if np.isfinite(f)]
        if channel is None:
            clear = np.nan_to_num(np.abs(self.level_dB) / self.u_level_dB).max(axis=1)
            return int(np.argmax(clear))
        require_known(channel, used, f"{channel!r} is not a channel that is fitted")
        return self.channels.index(channel)

    def as_dict(self) -> dict[str, Any]:
        """For JSON: one row a third octave and receiver, then FRAC and CSAC."""
        rows = [
            {
                "third_octave_hz": float(band), "channel": channel,
                "level_error_dB": self.level_dB[m, b], "u_level_dB": self.u_level_dB[m, b],
                "phase_error_deg": self.phase_deg[m, b], "u_phase_deg": self.u_phase_deg[m, b],
                "in_part": float(band) in self.third.partial,
            }
            for m, channel in enumerate(self.channels)
            for b, band in enumerate(self.bands)
            if np.isfinite(self.level_dB[m, b])
        ]  # fmt: skip
        return {
            "recording": self.recording,
            "errors": rows,
            "frac": {c: f for c, f in zip(self.channels, self.frac.tolist(), strict=True) if np.isfinite(f)},
            "csac": dict(zip([f"{b:g}" for b in self.bands], self.csac.tolist(), strict=True)),
        }


curve_errors = FrfErrors  # as a kind of measurement brings it


def _cell(
    observation: FrfObservation, mic: int, lines: NDArray[np.intp], measured: Complex, model: Complex
) -> tuple[tuple[float, ...], Complex]:
    """Level, its uncertainty, phase, its uncertainty; and the part of both that bands share."""
    energy = float(np.sum(np.abs(measured) ** 2))
    level = 10 * np.log10(np.sum(np.abs(model) ** 2) / energy)
    phase = np.degrees(np.angle(np.sum(model * np.conj(measured))))
    # a small error d changes sum |H|^2 by 2 Re sum conj(H) d, and the phase by Im of the same
    weight = np.conj(measured) / energy
    number = np.round(observation.frequency_hz[lines] / observation.line_hz).astype(int)
    apart = np.abs(number[:, None] - number)
    known = np.array(observation.line_correlation)
    correlation = np.where(apart < known.size, known[np.minimum(apart, known.size - 1)], 0.0)
    noisy = weight * observation.noise[mic, lines]
    random = float(np.real(np.conj(noisy) @ correlation @ noisy))
    common = weight @ observation.common_at((mic, lines))
    spread = [np.sqrt(random + np.sum(part**2)) for part in (common.real, common.imag)]
    return (level, DB * spread[0], phase, np.degrees(spread[1])), common


def assurance(measured: Complex, model: Complex, axis: int) -> Array:
    """``|sum conj(H_x) H_a|^2 / (sum |H_x|^2 sum |H_a|^2)`` along an axis: FRAC over lines, CSAC over receivers.

    Examples
    --------
    >>> h = np.array([[1.0 + 1j, 2.0, 0.5j]])
    >>> assurance(h, 3 * h, axis=1).round(12).tolist()
    [1.0]
    """
    both = np.abs(np.sum(np.conj(measured) * model, axis=axis)) ** 2
    with np.errstate(invalid="ignore", divide="ignore"):
        found: Array = both / (
            np.sum(np.abs(measured) ** 2, axis=axis) * np.sum(np.abs(model) ** 2, axis=axis)
        )
    return found


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
    low, high = band_edges([band_at(f, 3) for f in bands], 3)
    return f"{max(low[0], reach_hz[0]):.0f}-{min(high[-1], reach_hz[1]):.0f} Hz"
