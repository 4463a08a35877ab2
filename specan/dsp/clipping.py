"""Whether a signal was cut off at a level that nobody stated."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from specan.arrays import Flags, Real

# Values closer than this part of the span are one value: coarser than the last bits of a computed signal,
# finer than the step of a 24-bit converter (6e-8 of its range).
SAME = 1e-9
FEWEST = 3  # samples on the rail
# A sine that is rounded to steps has at most 1 / (sqrt 2 - 1) = 2.41 times as many samples on its top step
# as on the next one, and 1 / (sqrt 9 - 1) = 0.5 times as many as on the next eight.
PER_LEVEL, PER_EIGHT, STEPS = 2.5, 2.0, 8
# Samples of a tone whose period is nearly a whole number of samples repeat for a while: one or two of a period.
ALONE = 10.0  # times as many as on any other value, where no three stand together on the rail
LEVELS = 32  # below the rail that are looked at
NEAR = 0.02  # of the span: where they are sought first
MOVING = 0.75  # of the neighbours of rests on the rail
# A repeating tone falls short of the sine through its other samples by so many times what these are away from it, and
# by this part of the span at least: harmonics that are none of clipping are as large there as elsewhere.
SHORT, SEEN = 100.0, 1e-4


def is_cut_off(samples: Real, top: float, span: float) -> bool:
    r"""Whether a signal stays at its largest value `top`, at full scale or below it.

    A converter or an amplifier that saturates gives the same value again and again, far more often than the
    values just below it. Near the top of an unclipped signal the density grows downwards: a sine that is
    rounded to steps q spends a time in proportion to :math:`\sqrt{k} - \sqrt{k-1}` on its k-th step from the
    top, noise less on the first than on the second. So the signal is cut off where `top` holds clearly more
    samples than any single value below it and than the eight steps below it together, and where it arrives
    there on the move: a slow signal that is rounded to steps dwells on each of them.

    Two values are no evidence (a square wave), nor is a rail at zero (a signal of one sign), nor a signal of
    a few steps. A tone whose samples repeat exactly, such as 1 kHz at 8 kHz without noise, holds any value again
    and again. It is cut off where its samples on the rails fall short of the one sine that all others are on.

    Parameters
    ----------
    samples : array (n,)
        Finite; for the lower rail with the sign turned.
    top : float
        Largest value of the whole record; `samples` may hold less.
    span : float
        Largest minus smallest value of the record.

    Examples
    --------
    >>> sine = np.sin(2 * np.pi * 50 * np.arange(5000) / 51200)
    >>> is_cut_off(sine, sine.max(), 2.0), is_cut_off(np.minimum(sine, 0.95), 0.95, 1.95)
    (False, True)
    """
    same = SAME * span
    on_rail = samples >= top - same
    count = int(np.count_nonzero(on_rail))
    if count < FEWEST or abs(top) <= same:
        return False
    if _falls_short(samples, on_rail, top, span):
        return True
    depth = top - samples[~on_rail]
    levels, holds = _levels(depth[depth <= NEAR * span], same)
    if levels.size < LEVELS:
        levels, holds = _levels(depth, same)
    if levels.size < 2:
        return False
    most = int(holds[:-1][:LEVELS].max())  # the last one may be the other rail
    if count <= (PER_LEVEL if longest_run(on_rail) >= FEWEST else ALONE) * most:
        return False
    # Few different values repeat exactly (a computed, periodic signal): there is no step to speak of.
    gaps = np.diff(levels[:LEVELS], prepend=0.0)
    step = float(gaps.min())
    if levels.size < LEVELS and depth.size > LEVELS * levels.size:
        if gaps.max() - step <= 2 * same:  # rounded to a few steps: too coarse to tell
            return False
    elif depth.max() <= 2 * STEPS * step or count <= PER_EIGHT * np.count_nonzero(depth <= STEPS * step):
        return False
    return _moving(samples, on_rail, samples <= top - span + same, same)


def _falls_short(samples: Real, on_rail: Flags, top: float, span: float) -> bool:
    """Whether one period of a signal that repeats exactly is a sine but for its rails, which are inside of it."""
    count, first = _period(samples, on_rail, SAME * span), int(np.argmax(on_rail))
    period, high = samples[first : first + count], on_rail[first : first + count]
    free = ~high & (period > top - span * (1.0 - SAME))
    if np.count_nonzero(free) < 4:  # a sine about a mean goes through any three
        return False
    line = 1 + int(np.argmax(np.abs(np.fft.rfft(period)[1:])))
    angle = 2.0 * np.pi * line / count * np.arange(count)
    base = np.stack([np.cos(angle), np.sin(angle), np.ones(count)], axis=1)
    amounts = np.linalg.lstsq(base[free], period[free], rcond=None)[0]
    sine = base @ amounts
    # Half a period later a sine is the same with the other sign: of these values, amplitude and phase take two.
    if _levels(np.abs(period[free] - amounts[-1]), 1e-6 * span)[0].size < 3:
        return False
    away = float(np.abs(period - sine)[free].max())
    short = (sine - period)[high]
    return bool(short.min() >= -SHORT * away and short.max() > max(SHORT * away, SEEN * span))


def _period(samples: Real, on_rail: Flags, same: float) -> int:
    """After how many samples all of them repeat, three times at least; 0 if they do not."""
    places = np.flatnonzero(on_rail)
    steps = (places - places[0])[1:]
    steps = steps[3 * steps <= samples.size]
    beginning = samples[: min(16, samples.size // 3)]
    alike = np.abs(samples[steps[:, None] + np.arange(beginning.size)] - beginning).max(axis=1, initial=0.0)
    for step in steps[alike <= same].tolist():
        if np.abs(samples[step:] - samples[:-step]).max() <= same:
            return int(step)
    return 0


def _levels(depth: Real, same: float) -> tuple[Real, NDArray[np.int64]]:
    """Different values in increasing order, and how many samples each holds."""
    ordered = np.sort(depth)
    first = np.flatnonzero(np.diff(ordered, prepend=-np.inf) > same)
    return ordered[first], np.diff(first, append=ordered.size)


def _moving(samples: Real, on_rail: Flags, on_other: Flags, same: float) -> bool:
    """Whether most neighbours of the rests on the rail, but those on the other rail, differ from their next ones."""
    entered = np.flatnonzero(on_rail[2:] & ~on_rail[1:-1]) + 1
    left = np.flatnonzero(on_rail[:-2] & ~on_rail[1:-1]) + 1
    near, beyond = np.append(entered, left), np.append(entered - 1, left + 1)
    between = ~on_other[near]
    moves = np.abs(samples[near] - samples[beyond])[between] > same
    return bool(moves.size and np.mean(moves) >= MOVING)


def longest_run(holds: Flags) -> int:
    """Length of the longest run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], holds, [False]))))
    return int((edges[1::2] - edges[::2]).max()) if edges.size else 0
