"""At which frequencies what a model of rates leaves of a recording follows the inputs: there it lacks something."""

from __future__ import annotations

import numpy as np
from scipy.signal import coherence, welch

from specan.models.rates import TIME
from specan.study.estimation.fit import Fit
from specan.study.estimation.problem import Problem
from specan.study.localisation.localise import Block, Localisation, tested
from specan.study.observation import Array, Variable
from specan.study.observation.time import TimeObservation

SEGMENTS = 8  # of a recording, before their overlap


def localise(problem: Problem, best: Fit) -> Localisation:
    """Bands in which the residual is coherent with an input, and whether it is white.

    Parameters
    ----------
    problem : Problem
    best : Fit
        Its minimum.
    """
    blocks, notes = [], []
    for o, predicted in zip(problem.observations, problem.plain(best.theta), strict=True):
        assert isinstance(o, TimeObservation)
        rates = problem.assembly.model.rates
        inputs = rates.inputs if rates else {}
        for name, chains in o.chains.items():
            rows = max(chains, key=lambda chain: chain.size)
            if rows.size < 16 * SEGMENTS:
                continue
            gap = (predicted - o.measured)[rows]
            unit = problem.assembly.model.observables[name].unit
            found = following(
                gap, {n: o.conditions[c][rows] for n, c in inputs.items()}, o.conditions[TIME][rows]
            )
            if found:
                low, high, share, source, p_value = found
                notes.append(
                    f"{100 * share:.0f} % of the residual of {name} at {low:.3g} to {high:.3g} Hz follows {source}"
                )
                size = float(np.sqrt(np.mean(gap**2)))
                where = {"frequency_hz": f"{low:.3g} to {high:.3g} Hz"}
                words = {"frequency_hz": Variable("frequency")}
                blocks.append(
                    Block(where, name, rows.size, 0.0, p_value, 0.0, 0.0, size, unit, variables=words)
                )
            else:
                notes.append(f"the residual of {name} does not follow {' or '.join(inputs) or 'an input'}")
            if name in o.noise:
                notes.append(f"the noise of {name} is {o.noise[name].words}")
            left = o.whiten(predicted - o.measured)[rows]
            lag = float(left[1:] @ left[:-1]) / max(float(left @ left), 1e-300)
            white = abs(lag) < 4 / np.sqrt(gap.size)
            what = "white" if white else "correlated"
            notes.append(f"the residual of {name} is {what} from sample to sample ({lag:.2f})")
    return Localisation(tuple(tested(blocks)), (), tuple(notes))


def following(
    gap: Array, inputs: dict[str, Array], time: Array
) -> tuple[float, float, float, str, float] | None:
    """The band around the largest power of the residual that follows an input: ends, share, input, its probability."""
    rate, size = 1 / float(time[1] - time[0]), 2 * gap.size // (SEGMENTS + 1)
    found = []
    for name, values in inputs.items():
        if not np.ptp(values):
            continue
        f, left = welch(gap, rate, nperseg=size)
        with np.errstate(invalid="ignore"):  # where neither has power
            _, shared = coherence(values, gap, rate, nperseg=size)
        along = np.where(shared > 0.2, shared * left, 0.0)  # coherence from which bands are named
        along[:2] = 0.0
        k = int(np.argmax(along))
        p = float((1 - shared[k]) ** (SEGMENTS - 1) * f.size)
        if not along[k] > 0 or p > 1e-4:
            continue
        ends = np.flatnonzero(along <= 0.05 * along[k])
        low, high = ends[ends < k].max() + 1, ends[ends > k].min(initial=f.size) - 1
        share = float(np.sum(along[low : high + 1]) / np.sum(left[low : high + 1]))
        found.append((float(along[k]), (float(f[low]), float(f[high]), share, name, p)))
    return max(found)[1] if found else None
