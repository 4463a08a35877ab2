"""How probable effects are, given order lines that an ideal set does not have.

How strongly a machine answers to an error of its parts is known poorly; where its lines lie, and with which phase each
sensor hears them, follows from symmetry. A line at order o is heard n passages of the planets beside its order in the
frame of the carrier; planets that move alike, or one after the other, make a motion of one kind there; and to each of
these the machine has one answer. So the lines y of an effect are

    y = t sum_q a_q s_q (1 + e) + noise,

t its size over the largest that is known, a_q standard normal, s_q the model's lines for a unit of each amplitude, with
the gain that lines of the ideal set tell of each sensor and harmonic. The relative errors e are those of the answer,
one for each harmonic, kind of motion and order in the carrier's frame, correlated over a resonance; of the path to each
sensor, a random walk over passages; of the form of an effect, one for each order in that frame, whichever sensor hears
it; and of each line. All is Gaussian for a given t, and the evidence is the mean over
sizes and over how much is known of the answers: nothing is fitted. Effects that the model has already make lines with
the same errors. In some recordings lines may be anything: where teeth part, what a set does is no sum of its errors.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.special import logsumexp

from specan.arrays import Complex
from specan.models import Use
from specan.planetary_gear.study.order_lines import OrderLinesObservation, resonance, same, strongest
from specan.study.estimation.problem import Problem
from specan.study.evidence.faults import ln_mean
from specan.study.evidence.promises import ONE_SIDED_80
from specan.study.observation import Array
from specan.study.selection.candidates import Candidate

# Sizes of an effect over the largest that is known, with the amplification of resonances whose damping ratio is 0.01 to
# 0.1 (see `Uncertainty`).
SIZES = np.exp2(np.arange(-15.0, 6.0))
# How well answers are known: errors over those of the rig file, and what part of them each recording has of its own.
ANSWERS = (1.0, 0.1), (2.0, 0.5)
# Probability that a tone of the background falls on a line, of all lines together, and how many may.
TONE, TONES = 0.05, 3
# Probability, assumed, that lines of a recording are anything whatever effect there is, as where teeth part.
APART = 0.05
STEP = 1e-3  # of the largest size that is known, for the model's lines
# Places of a shape parameter that is an angle, of another one, and finer ones in each step about the likeliest angle.
AROUND, ALONG, FINER = 24, 3, 4
EXACT = 1e-2  # of what lies between places, for the likeliest one
SEEN = 1e-2  # chi-square that the largest size must make in a line


@dataclass(frozen=True, eq=False)
class Pattern:
    """Lines that an effect makes; or those of anything, each with an amplitude of its own.

    Attributes
    ----------
    lines : complex array (amplitudes, rows, lines)
        At the largest size that is known, or all together at their values.
    use : Use, optional
        None of anything.
    values : mapping
        Shape parameters, SI.
    amplitudes : tuple of (str, float)
        Names of the amplitudes, and their values at that size, SI.
    parted : bool
        Teeth part at these values, so that lines are those of no other size.
    but : frozenset of int
        Numbers of recordings whose lines may be anything; it has none there.
    """

    lines: Complex
    use: Use | None = None
    values: dict[str, float] = field(default_factory=dict)
    amplitudes: tuple[tuple[str, float], ...] = ()
    parted: bool = False
    but: frozenset[int] = frozenset()


# Rows and numbers of lines about one harmonic, in recordings at one speed or in one recording.
Group = tuple[NDArray[np.intp], NDArray[np.intp]]


class LineEvidence:
    """Evidence of patterns in the order lines that an ideal set does not have.

    Parameters
    ----------
    problem : Problem
        The model as it is, and its order lines.
    values : mapping
        Of its parameters, SI.
    """

    def __init__(self, problem: Problem, values: dict[str, Any]) -> None:
        (seen,) = problem.observations
        assert isinstance(seen, OrderLinesObservation)
        self.seen, self.values = seen, values
        self.variance = 2 * self.seen.noise**2
        self.plain = self.seen.model_lines(problem.assembly, values)
        self.used = self.seen.beyond & self.seen.kept
        count = len(self.seen.recordings)
        self.recording = np.repeat(np.arange(count), len(self.seen.of_row) // count)
        self._by_recording = count, -1, self.plain.shape[1]
        speed = self.seen.speed.reshape(count, -1)[:, 0]
        # A tone is on the same line in recordings at one speed.
        self._at_speed = np.equal.outer(np.unique(speed), speed).astype(int)
        known = self.seen.known
        # What may answer for itself about each harmonic: every recording, or every kind of motion in it.
        recording = self.recording[:, None]
        self.free = recording, recording * (known.mode.max() + 1) + known.mode
        self.strongest = strongest(self.seen.amplitude, known.harmonic)
        self._sizes: dict[Pattern, NDArray[np.intp]] = {}

    # --- what lines are to be expected ------------------------------------------------------------

    @cached_property
    def _gain(self) -> tuple[Complex, Array]:
        """Gain of each sensor and harmonic that lines of the ideal set tell, and its relative uncertainty, a line each.

        The mean of logarithms, weighted by how little is known of each line.
        """
        o, known = self.seen, self.seen.known
        gain, unsure = np.zeros(o.amplitude.shape, complex), np.ones(o.amplitude.shape)
        away = known.path * known.far
        for row, h in product(range(len(o.channels)), np.unique(known.harmonic)):
            about = known.harmonic == h
            told = np.flatnonzero(about & o.kept[row] & ~o.beyond[row] & (self.plain[row] != 0))
            if not told.size:
                continue
            ratio = o.amplitude[row, told] / self.plain[row, told]
            noise = self.variance[row, told] / np.maximum(np.abs(o.amplitude[row, told]), 1e-300) ** 2
            weight = 1 / (known.near**2 + away[told] ** 2 + noise)
            turned = np.sum(weight * ratio / np.abs(ratio))
            size = np.exp(np.sum(weight * np.log(np.abs(ratio))) / weight.sum())
            gain[row, about] = size * turned / max(abs(turned), 1e-300)
            unsure[row, about] = np.sqrt(1 / weight.sum())
        return gain, unsure

    def patterns(self, candidate: Candidate, about: Pattern | None = None) -> list[Pattern]:
        """Lines of an effect, one pattern for each place of its shape parameters; none where it makes no new ones.

        Those about one of them lie closer to each other.
        """
        places = [
            _places(candidate.parameter(name).si, about.values[name] if about else None)
            for name in candidate.shapes
        ]
        found = [
            self._pattern(candidate, dict(zip(candidate.shapes, one, strict=True)))
            for one in product(*places)
        ]
        return [p for p in found if np.any(np.sum(np.abs(p.lines) ** 2, axis=0) > SEEN * self.variance)]

    def _pattern(self, candidate: Candidate, values: dict[str, float]) -> Pattern:
        """Lines of an effect at these shape parameters."""
        lines, sizes = [], []
        for name in candidate.amplitudes:
            known = candidate.parameter(name).si
            size = max(abs(known.min), abs(known.max))
            at = {n: candidate.neutral(n) for n in candidate.amplitudes} | values
            at[name] += STEP * size
            changed = self.seen.model_lines(candidate.extended.assembly, self.values | at)
            lines.append((changed - self.plain) / STEP * self._gain[0] * self.used)
            sizes.append((name, size))
        return Pattern(np.stack(lines), candidate.use, values, tuple(sizes))

    def anything(self) -> list[Pattern]:
        """Each line for itself: of all families, or of one of them."""
        family = np.array([name.partition(" (")[2] for name in self.seen.known.family])
        kinds = [np.ones(family.size, bool), *(family == f for f in np.unique(family))]
        kinds += [self.seen.known.family == f for f in np.unique(self.seen.known.family)]
        each = [self.strongest[None] * (self.used & kind) for kind in kinds]
        return [Pattern(lines) for lines in each if np.any(lines)]

    @cached_property
    def _had(self) -> Complex:
        """Lines of effects that the model has already."""
        return self.plain * self._gain[0] * self.used

    def _shown(self, *patterns: Pattern) -> NDArray[np.bool_]:
        """Lines that some patterns, or effects of the model, have."""
        size = np.abs(self._had) ** 2 + sum(np.sum(np.abs(p.lines) ** 2, axis=0) for p in patterns)
        return np.asarray(size > SEEN * self.variance)

    # --- evidence ---------------------------------------------------------------------------------

    def likeliest(
        self, candidate: Candidate, patterns: Sequence[Pattern], parted: bool = False
    ) -> tuple[Pattern, float, float]:
        """Likeliest pattern of an effect, ln of its evidence and of the mean over all places of shape parameters.

        Recordings whose lines are rather anything are left to that, one after the other, while the effect gains
        something in the others. Sizes at which teeth part are looked at where that is asked for.
        """
        found = self._likeliest_place(candidate, patterns, parted)
        while len(left := set(range(len(self.seen.recordings))) - found[0].but) > 1:
            but = [found[0].but | {k} for k in left]
            each = [
                self._likeliest_place(candidate, [self._without(p, some) for p in patterns], parted)
                for some in but
            ]
            best = max(each, key=lambda one: one[2])
            if best[2] <= max(found[2], self.nothing + self.of_another_origin(best[0].but)):
                break
            found = best
        return self._between_places(candidate, *found)

    def _between_places(
        self, candidate: Candidate, best: Pattern, most: float, mean: float
    ) -> tuple[Pattern, float, float]:
        """The likeliest angle between those that were looked at."""
        name = next(iter(candidate.shapes), "")
        places = _places(candidate.parameter(name).si, best.values[name]) if name else np.empty(0)
        if places.size < FINER:
            return best, most, mean

        def at(place: float) -> Pattern:
            return self._without(self._pattern(candidate, best.values | {name: place}), best.but)

        near = places[FINER - 1], places[FINER + 1]
        exact = {"xatol": EXACT * (near[1] - near[0])}
        found = minimize_scalar(lambda place: -self.ln_evidence([at(place)]), bounds=near, options=exact)
        return (at(found.x), -found.fun, mean) if -found.fun > most else (best, most, mean)

    def _likeliest_place(
        self, candidate: Candidate, patterns: Sequence[Pattern], parted: bool
    ) -> tuple[Pattern, float, float]:
        gains, count = [self.ln_evidence([one]) for one in patterns], len(patterns)
        best = patterns[int(np.argmax(gains))]
        if finer := self.patterns(candidate, best)[1:]:
            patterns = [self._without(p, best.but) for p in finer]
            gains, count = [self.ln_evidence([one]) for one in patterns], FINER * count
            best = patterns[int(np.argmax(gains))]
        most, mean = max(gains), float(logsumexp(gains) - np.log(count))
        each = [
            (most, best),
            *(self._parted(candidate, best, most) if parted and most > self.nothing else ()),
        ]
        sized, best = max(each, key=lambda one: one[0])
        return best, sized, mean - most + float(ln_mean([gain for gain, _ in each]))

    def _parted(self, candidate: Candidate, pattern: Pattern, gain: float) -> list[tuple[float, Pattern]]:
        """Lines at sizes at which teeth part, an error being larger than their deflection, behind ln of their evidence.

        Lines are in no proportion to the error then. Its parts are as in a small one that is the likeliest. They are
        worth more than what an error of its form leaves.
        """
        small, found, near = self.start([pattern]), [], self.seen.known.near
        enough = gain + near**2 * (gain - self.nothing)
        parts = np.array([small[name] / size for name, size in pattern.amplitudes])
        parts /= np.abs(parts).max() or 1.0
        linear = np.tensordot(parts, pattern.lines, axes=1)
        for size in SIZES[SIZES <= 1][::-1]:
            values = {n: size * p * most for p, (n, most) in zip(parts, pattern.amplitudes, strict=True)}
            one = self._together(candidate, pattern, values)
            if np.linalg.norm(one.lines - size * linear) <= near * size * np.linalg.norm(linear):
                break
            found.append((self.ln_evidence([one]), one))
        return [one for one in found if one[0] > enough]

    def _together(self, candidate: Candidate, pattern: Pattern, values: dict[str, float]) -> Pattern:
        """A pattern with its amplitudes at these values."""
        at = self.values | pattern.values | values
        changed = self.seen.model_lines(candidate.extended.assembly, at) - self.plain
        lines = (changed * self._gain[0] * self.used)[None]
        one = replace(pattern, lines=lines, amplitudes=tuple(values.items()), parted=True)
        return self._without(one, pattern.but)

    def _without(self, pattern: Pattern, but: frozenset[int]) -> Pattern:
        """A pattern without its lines in some recordings, whose lines may be anything."""
        return replace(pattern, lines=pattern.lines * ~np.isin(self.recording, list(but))[:, None], but=but)

    def ln_in_some(self) -> float:
        """ln of the evidence that lines are anything in some recordings, over that of noise alone."""
        return self.nothing + float(
            np.sum(np.logaddexp(0.0, np.array(self._apart) - np.log(APART)) - np.log(2.0))
        )

    @cached_property
    def nothing(self) -> float:
        """ln of the evidence of the effects that the model has already."""
        return self.ln_evidence([])

    def of_another_origin(self, recordings: Iterable[int] = ()) -> float:
        """ln of the evidence that lines of some recordings are anything, with the prior."""
        return sum(self._apart[k] for k in recordings)

    @cached_property
    def _apart(self) -> list[float]:
        """What lines of each recording are likelier as anything than as noise, ln, with the prior."""
        found = []
        for k in range(len(self.seen.recordings)):
            others = frozenset(range(len(self.seen.recordings))) - {k}
            own = [replace(self._without(p, others), but=frozenset()) for p in self.anything()]
            found.append(float(ln_mean([self.ln_evidence([p]) for p in own]) - self.nothing + np.log(APART)))
        return found

    def ln_evidence(self, patterns: Sequence[Pattern], near: Sequence[Pattern] = ()) -> float:
        """ln of the probability of the lines with some patterns over that of noise alone.

        Parameters
        ----------
        patterns : sequence of Pattern
        near : sequence of Pattern
            Those of them that are looked at about their likeliest sizes only.
        """
        sizes = [self._likely_sizes(p) if p in near else np.arange(SIZES.size) for p in patterns]
        grid = np.asarray(SIZES[np.array(list(product(*sizes)), dtype=int)], dtype=float)
        ln_count = len(patterns) * np.log(SIZES.size)
        but = frozenset().union(*(p.but for p in patterns))
        patterns = [self._without(p, but) for p in patterns] if but else patterns
        found = [logsumexp(self._coherent(patterns, grid, *answer)[0]) - ln_count for answer in ANSWERS]
        for apart in self.free:
            each = self._each_group(patterns, grid, apart)
            found.append(np.sum(logsumexp(each, axis=1) - ln_count))
        return float(logsumexp(found) - np.log(len(found))) + self.of_another_origin(but)

    def _likely_sizes(self, pattern: Pattern) -> NDArray[np.intp]:
        """Numbers of the sizes that are not unlikely in every form of the answers."""
        if pattern not in self._sizes:
            grid = SIZES[:, None]
            each = [self._coherent([pattern], grid, *answer)[0] for answer in ANSWERS]
            each += list(self._each_group([pattern], grid, self.free[0]))
            likely = np.any([ln > ln.max() - 3.0 for ln in each], axis=0)
            self._sizes[pattern] = np.flatnonzero(likely)
        return self._sizes[pattern]

    def _groups(self, patterns: Sequence[Pattern], apart: NDArray[np.intp]) -> Iterable[Group]:
        """Lines that patterns have, by harmonic and what sets them apart, (rows, lines)."""
        shown = self._shown(*patterns)
        for h, k in product(np.unique(self.seen.known.harmonic), np.unique(apart)):
            row, line = np.nonzero(shown & (self.seen.known.harmonic == h) & (apart == k))
            if row.size:
                yield row, line

    def _coherent(
        self, patterns: Sequence[Pattern], grid: Array, answer: float, own: float
    ) -> tuple[Array, Array]:
        """ln evidence at each row of sizes with amplitudes that all lines share, and these amplitudes."""
        columns = sum(p.lines.shape[0] for p in patterns if p.use)
        ln, inner = np.zeros(len(grid)), np.zeros((len(grid), columns, columns)) + np.eye(columns)
        cross = np.zeros((len(grid), columns))
        for group in self._groups(patterns, self.seen.speed[:, None]):
            errors = self._errors(group, answer * self.seen.known.unlike[group[1]], own)
            part, white, left = self._whitened(patterns, grid, group, errors)
            ln += part
            inner += 2 * np.einsum("tnq,tnr->tqr", white.conj(), white).real
            cross += 2 * np.einsum("tnq,tn->tq", white.conj(), left).real
        amplitudes = np.linalg.solve(inner, cross[..., None])[..., 0]
        ln += 0.5 * np.sum(cross * amplitudes, axis=1) - 0.5 * np.linalg.slogdet(inner)[1]
        return np.asarray(ln), np.asarray(amplitudes)

    def _each_group(self, patterns: Sequence[Pattern], grid: Array, apart: NDArray[np.intp]) -> Array:
        """ln evidence of what answers for itself, by harmonic and what sets lines apart, (groups, sizes)."""
        found = []
        for group in self._groups(patterns, apart):
            # Whatever a pattern's own size, its lines are as strong as any there may be.
            most = self.strongest[group].max()
            own = [np.abs(p.lines[:, *group]).max() for p in patterns]
            scaled = grid * [most / size if size else 1.0 for size in own]
            errors = self._errors(group, np.ones(group[0].size), 1.0)
            found.append(self._whitened(patterns, scaled, group, errors)[0])
        return np.reshape(found, (-1, len(grid)))

    def _whitened(
        self, patterns: Sequence[Pattern], grid: Array, group: Group, errors: Array
    ) -> tuple[Array, Complex, Complex]:
        """ln evidence without common amplitudes at each size, lines of each amplitude and what is left, whitened."""
        had, variance, measured = self._had[group], self.variance[group], self.seen.amplitude[group]
        lines = [p.lines[:, *group] for p in patterns]
        alone = sum(
            (
                t[:, None] ** 2 * np.abs(own[0]) ** 2
                for t, p, own in zip(grid.T, patterns, lines, strict=True)
                if not p.use
            ),
            np.tile(variance, (len(grid), 1)),
        )
        ln = np.full(len(grid), np.sum(np.abs(measured) ** 2 / variance + np.log(variance)))
        # Lines that are anything alone are independent of the others.
        of_effects = [own for p, own in zip(patterns, lines, strict=True) if p.use]
        size = np.abs(had) ** 2 + sum(np.sum(np.abs(own) ** 2, axis=0) for own in of_effects)
        both, rest = size > SEEN * variance, size <= SEEN * variance
        ln -= np.sum(np.abs(measured[rest]) ** 2 / alone[:, rest] + np.log(alone[:, rest]), axis=1)
        errors, y = errors[np.ix_(both, both)], (measured - had)[both]
        use, own = [bool(p.use) for p in patterns], [part[:, both] for part in lines]
        covariance = [
            part.T @ part.conj() * errors if named else np.diag(np.abs(part[0]) ** 2)
            for named, part in zip(use, own, strict=True)
        ] or [0 * errors]
        columns = [(k, line) for k, part in enumerate(own) if use[k] for line in part]
        right = np.stack([y, *(line for _, line in columns)], axis=1)
        noise = np.diag(variance[both]) + np.outer(had[both], had[both].conj()) * errors
        white: Complex = np.zeros((len(grid), *right.shape), complex)
        # In the principal axes of the last pattern's errors all its sizes cost little more than one.
        last = grid[:, -1:] if patterns else np.zeros((len(grid), 1))
        sizes, which = np.unique(grid[:, :-1], axis=0, return_inverse=True)
        for k, others in enumerate(sizes):
            root = np.linalg.cholesky(noise + sum(t**2 * c for t, c in zip(others, covariance)))
            half = np.linalg.solve(root, covariance[-1])
            power, axes = np.linalg.eigh(np.linalg.solve(root, half.conj().T))
            at = which.ravel() == k
            total = 1 + last[at] ** 2 * np.maximum(power, 0.0)
            white[at] = axes.conj().T @ np.linalg.solve(root, right) / np.sqrt(total)[..., None]
            ln[at] -= np.sum(np.log(total), axis=1) + 2 * np.sum(np.log(np.diagonal(root).real))
        white[..., 1:] *= grid[:, None, [k for k, _ in columns]]
        left = white[..., 0]
        return np.asarray(ln - np.sum(np.abs(left) ** 2, axis=1)), white[..., 1:], left

    def _errors(self, group: Group, response: Array, own: float) -> Array:
        """Covariance of the relative errors of an effect's lines."""
        known, (row, line) = self.seen.known, group
        harmonic, passages = known.harmonic[line], known.passages[line]
        one_answer = same(self.seen.speed[row], harmonic, known.mode[line]) * resonance(known.frame[line])
        one_answer = one_answer * (1 - own + own * same(self.recording[row]))
        away = known.far[line]
        side = same(self.seen.path[row], harmonic, np.sign(passages))
        unsure = self._gain[1][group]
        return (
            np.outer(response, response) * one_answer
            + known.path**2 * side * np.minimum(away[:, None], away)
            + np.outer(unsure, unsure) * same(self.seen.path[row], harmonic)
            + known.near**2 * (same(harmonic, known.frame[line]) + np.eye(row.size))
        )

    @cached_property
    def _as_tone(self) -> Array:
        """ln of the evidence that a line is a tone of the background in recordings at one speed, (speeds, lines)."""
        measured = np.abs(self.seen.amplitude) ** 2
        with_tone = self.variance + (SIZES[:, None, None] * self.strongest) ** 2
        gain = measured / self.variance - measured / with_tone - np.log(with_tone / self.variance)
        both = gain.reshape(SIZES.size, *self._by_recording).sum(axis=2)
        return np.asarray(self._at_speed @ (logsumexp(both, axis=0) - np.log(SIZES.size)))

    def tones(self, patterns: Sequence[Pattern]) -> tuple[float, list[str]]:
        """Tones of the background beside some patterns: ln of their prior times evidence, and where they are."""
        but = frozenset().union(*(p.but for p in patterns))
        free = self.used & ~self._shown(*patterns) & ~np.isin(self.recording, list(but))[:, None]
        taken = self._at_speed @ ~free.reshape(self._by_recording).all(axis=1)
        gain = np.where(taken, 0.0, self._as_tone + np.log(TONE / self.used.sum()))
        likely = np.argwhere((gain > 0) & (gain >= np.sort(gain, axis=None)[-TONES]))
        order, names = self.seen.known.order, np.array(self.seen.recordings)
        where = [f"order {order[n]:.5g} in {' and '.join(names[self._at_speed[k] > 0])}" for k, n in likely]
        return float(gain[tuple(likely.T)].sum()), where

    def visible(self, pattern: Pattern, needed: float) -> float:
        """Size of the first amplitude, SI, whose lines gain `needed` in four cases of five."""
        chi2 = 2 * float(np.sum(np.abs(pattern.lines[0]) ** 2 / self.variance))
        price = np.log(SIZES.size) + 0.5 * np.log1p(2 * needed)
        return float(
            (np.sqrt(2 * (needed + price)) + ONE_SIDED_80) / np.sqrt(chi2) * pattern.amplitudes[0][1]
        )

    def start(self, patterns: Sequence[Pattern]) -> dict[str, float]:
        """Likeliest values of the parameters of some effects, SI."""
        many = np.array(list(product(*[SIZES] * len(patterns))))
        ln, amplitudes = self._coherent(patterns, many, *ANSWERS[0])
        best = int(np.argmax(ln))
        found, k = {}, 0
        for size, pattern in zip(many[best], patterns, strict=True):
            found.update(pattern.values)
            own = size * amplitudes[best, k : k + len(pattern.lines)]
            parts = np.ones(len(pattern.amplitudes)) if pattern.parted else own
            found.update({n: float(p * v) for p, (n, v) in zip(parts, pattern.amplitudes, strict=True)})
            k += own.size
        return found


def _places(parameter: Any, about: float | None = None) -> Array:
    """Of a shape parameter: all around where its domain says that it is an angle; or on both sides of one place."""
    reach = parameter.max - parameter.min
    if parameter.lower > parameter.min - reach:
        return np.linspace(parameter.min, parameter.max, ALONG) if about is None else np.array([about])
    if about is None:
        return np.linspace(parameter.min, parameter.max, AROUND, endpoint=False)
    return about + reach / AROUND * np.arange(-FINER, FINER + 1) / FINER
