"""What may spoil the samples of a recording: hum of the mains, and values that were cut off."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from specan.dsp.clipping import SAME, is_cut_off
from specan.models.rates import TIME
from specan.study.estimation.problem import Problem
from specan.study.observation import Array
from specan.study.observation.time import TimeObservation

OFF_MAINS = 0.002  # of them, that grids leave their frequency by
MULTIPLES = 6

# Name, sentence, columns over all rows of a size of one, and ln of how many places were tried for them.
Spoilt = tuple[str, str, Array, float]


def spoilt(o: TimeObservation, off: Array) -> Iterator[Spoilt]:
    """What is looked for in the samples of each observable.

    Parameters
    ----------
    o : TimeObservation
    off : array, shape (n,)
        What a prediction leaves.
    """
    for name in o.chains:
        # Hz
        for mains in (50.0, 60.0):
            yield from _hum(o, name, off, mains)
        yield from _cut_off(o, name)


def _hum(o: TimeObservation, name: str, off: Array, mains: float) -> Iterator[Spoilt]:
    """Lines at multiples of the mains' frequency, which is the likeliest near the nominal one."""
    chains, time = o.chains[name], o.conditions[TIME]
    longest = max(chains, key=lambda rows: rows.size)
    length = float(np.ptp(time[longest]))
    count = int(min(0.45 * (longest.size - 1) / length // mains, MULTIPLES))
    if not count or length * mains < MULTIPLES:
        return
    steps = 2 * int(np.ceil(OFF_MAINS * mains * count * length)) + 1  # half a line of the highest multiple
    likeliest = mains * (1 + OFF_MAINS * np.linspace(-1, 1, steps))
    angle = 2j * np.pi * time[longest]
    power = [
        sum(abs(np.exp(k * f * angle) @ off[longest]) ** 2 for k in range(1, count + 1)) for f in likeliest
    ]
    f = likeliest[int(np.argmax(power))]
    turns = 2 * np.pi * f * time[:, None] * np.arange(1, count + 1)
    waves = np.hstack([np.cos(turns), np.sin(turns)])
    columns = np.hstack([waves * np.isin(np.arange(o.n), rows)[:, None] for rows in chains])
    text = f"there is mains hum in {name}, at {f:.4g} Hz and multiples"
    yield "hum", text, columns, float(np.log(steps))


def _cut_off(o: TimeObservation, name: str) -> Iterator[Spoilt]:
    """Samples on the largest or the least value, each rest there as the top of a parabola."""
    rows = np.concatenate(o.chains[name])
    span = float(np.ptp(o.measured[rows]))
    for sign, end in ((1, "largest"), (-1, "least")):
        samples = sign * o.measured[rows]
        top = float(samples.max())
        if not is_cut_off(samples, top, span):
            continue
        on = np.flatnonzero(samples >= top - SAME * span)
        rests = np.split(on, np.flatnonzero(np.diff(on) > 1) + 1)
        columns = np.zeros((o.n, len(rests)))
        for k, rest in enumerate(rests):
            columns[rows[rest], k] = 1 - np.linspace(-1, 1, rest.size + 2)[1:-1] ** 2
        text = f"{name} rests on its {end} value, {sign * top:.4g}, in {on.size} samples"
        yield "clipped samples", f"{text}: it is clipped there", columns, 0.0


def unspoilt(problem: Problem, theta: Array, residual: Array) -> Array:
    """A whitened residual of recordings without what may have spoilt their samples: that is no noise."""
    parts = []
    each = zip(problem.observations, problem.split(residual), problem.predictions(theta), strict=False)
    for o, left, predicted in each:
        assert isinstance(o, TimeObservation)
        columns = [o.whiten(found) for _, _, found, _ in spoilt(o, o.measured - predicted)]
        white = np.hstack([np.zeros((o.n, 1)), *columns])
        parts.append(left - white @ np.linalg.lstsq(white, left, rcond=None)[0])
    return np.concatenate(parts)
