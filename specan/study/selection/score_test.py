"""Score test: chi-square reduction of every candidate and pair by linear algebra, without a refit.

With Q an orthonormal basis of the base's whitened Jacobian and j~ = (I - Q Q^T) j a candidate's signature,
chi-square falls by (j~^T r)^2 / (j~^T j~) at the multiple -j~^T r / j~^T j~ of the signature: the modification
index and the expected parameter change (Saris, Satorra & van der Veld 2009, SEM 16:561). On a boundary the
multiple is held to what the domain allows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specan.models import Use
from specan.study.estimation.linear import Projection, orthonormal
from specan.study.estimation.problem import Problem
from specan.study.selection.signatures import Signature
from specan.study.selection.significance import MultipleTestingFamily

Array = NDArray[np.float64]

INVISIBLE = 1e-6  # share of a signature, in chi-square, below which it is collinear with the base's Jacobian
WORTH_A_TEST = 1.0  # chi-square that a signature must be able to leave at some size in its domain
PER_CANDIDATE = 12  # signatures of a candidate that are tried in pairs
SAME_GAIN = 0.95  # of the gain of another start: too near to it to lead elsewhere


def row_weights(problem: Problem) -> Array:
    """Weight of each row: correlated lines are worth fewer than they are, priors are what they are."""
    parts = [np.full(o.n, np.sqrt(o.n_effective / o.n)) for o in problem.observations]
    return np.concatenate([*parts, np.ones(len(problem.pseudo_rows))])


@dataclass(frozen=True, eq=False)
class Scored:
    """A signature with what the parameters of the base cannot produce of it.

    Attributes
    ----------
    projected : array, (n_rows, q)
        Columns orthogonal to the base's Jacobian.
    chi2_reduction : float
        Fall in chi-square that the linearised refit promises.
    expected_change : array, (q,)
        Multiple of the signature at which it is reached.
    """

    signature: Signature
    projected: Array
    chi2_reduction: float
    expected_change: Array

    @property
    def use(self) -> Use:
        """The candidate."""
        return self.signature.use

    @property
    def amplitudes(self) -> int:
        """Number of columns."""
        return self.projected.shape[1]

    @property
    def count(self) -> int:
        """Number of parameters that it stands for: its amplitudes and shapes."""
        return self.amplitudes + len(self.signature.shapes)


def score(fit: Projection, found: Sequence[Signature], weights: Array) -> list[Scored]:
    """Score every signature; those collinear with its Jacobian are left out.

    Parameters
    ----------
    fit : Projection
        The base, its rows weighted.
    found : sequence of Signature
    weights : array
        Weights of the rows.
    """
    scored = []
    for signature in found:
        columns = signature.columns * weights[:, None]
        projected = fit.project_out(columns)
        if (
            not np.sum(projected**2) > INVISIBLE * np.sum(columns**2)
            or _most(projected, signature) < WORTH_A_TEST
        ):
            continue
        if projected.shape[1] == 1:
            gain, multiple = _one(projected[:, 0], fit.residual, signature.multiplier_bounds)
            scored.append(Scored(signature, projected, gain, np.array([multiple])))
        else:
            multiple_q, *_ = np.linalg.lstsq(projected, -fit.residual, rcond=1e-9)
            gain = float(fit.residual @ fit.residual - np.sum((fit.residual + projected @ multiple_q) ** 2))
            scored.append(Scored(signature, projected, gain, np.asarray(multiple_q, dtype=float)))
    return scored


def _most(projected: Array, signature: Signature) -> float:
    """Chi-square that the signature can leave at the far end of its domain."""
    if projected.shape[1] > 1:
        return np.inf
    return (
        float(projected[:, 0] @ projected[:, 0]) * max(abs(end) for end in signature.multiplier_bounds) ** 2
    )


def _one(projected: Array, residual: Array, multiplier_bounds: tuple[float, float]) -> tuple[float, float]:
    along, size = float(projected @ residual), float(projected @ projected)
    multiple = min(max(-along / size, multiplier_bounds[0]), multiplier_bounds[1])
    return -2 * multiple * along - multiple**2 * size, multiple


def best_of_each(scored: Sequence[Scored]) -> dict[Use, list[Scored]]:
    """Signatures of each candidate, best first; candidates by their best, best first."""
    table: dict[Use, list[Scored]] = {}
    for item in sorted(scored, key=lambda s: -s.chi2_reduction):
        table.setdefault(item.use, []).append(item)
    return table


def family(scored: Sequence[Scored]) -> MultipleTestingFamily:
    """All directions that were tried, for the family-wise level."""
    single = [s for s in scored if s.amplitudes == 1]
    directions = [s.projected[:, 0] / np.linalg.norm(s.projected[:, 0]) for s in single]
    rows = scored[0].projected.shape[0] if scored else 0
    return MultipleTestingFamily(
        np.column_stack(directions) if directions else np.zeros((rows, 0)),
        np.array([s.signature.one_sided for s in single], dtype=bool),
        len(scored) - len(single),
    )


@dataclass(frozen=True, eq=False)
class ScoredPair:
    """Two signatures together."""

    first: Scored
    second: Scored
    chi2_reduction: float

    @property
    def uses(self) -> frozenset[Use]:
        """The two candidates."""
        return frozenset({self.first.use, self.second.use})


def score_pairs(fit: Projection, scored: Sequence[Scored]) -> list[ScoredPair]:
    """Best pair of signatures for every two candidates, best first.

    Two effects of opposite sign can each be invisible alone, so that a search that adds one at a time
    never starts; all pairs are tried. Of each candidate the signatures that differ most in direction are
    taken, `PER_CANDIDATE` at most, the best one always.
    """
    kept = [s for items in best_of_each(scored).values() for s in _spread(items, PER_CANDIDATE)]
    single = [s for s in kept if s.amplitudes == 1]
    best: dict[frozenset[Use], ScoredPair] = {}
    if len(single) > 1:
        _pairs_of_single(fit, single, best)
    for several in (s for s in kept if s.amplitudes > 1):
        for other in kept:
            if other.use != several.use:
                _pair_of_subspaces(fit, several, other, best)
    return sorted(best.values(), key=lambda pair: -pair.chi2_reduction)


def _spread(items: Sequence[Scored], count: int) -> list[Scored]:
    """The best signature and those that differ most from the ones taken already."""
    taken = [items[0]]
    if items[0].amplitudes > 1:
        return list(items[:count])
    units = np.column_stack([s.projected[:, 0] / np.linalg.norm(s.projected[:, 0]) for s in items])
    cosine_to_taken = np.abs(units.T @ units[:, 0])
    while len(taken) < min(count, len(items)):
        k = int(np.argmin(cosine_to_taken))
        if cosine_to_taken[k] > 0.999:
            break
        taken.append(items[k])
        cosine_to_taken = np.maximum(cosine_to_taken, np.abs(units.T @ units[:, k]))
    return taken


def _pairs_of_single(
    fit: Projection, single: Sequence[Scored], best: dict[frozenset[Use], ScoredPair]
) -> None:
    norms = np.array([np.linalg.norm(s.projected[:, 0]) for s in single])
    units = np.column_stack([s.projected[:, 0] for s in single]) / norms
    along = -(units.T @ fit.residual)
    cosine = units.T @ units
    with np.errstate(divide="ignore", invalid="ignore"):
        left = 1 - cosine**2
        first = (along[:, None] - cosine * along[None, :]) / left
        gain = along[:, None] ** 2 + (along[None, :] - cosine * along[:, None]) ** 2 / left
    reach = np.array([s.signature.multiplier_bounds for s in single]) * norms[:, None]
    allowed = (first >= reach[:, :1]) & (first <= reach[:, 1:])
    gain = np.where((left > 1e-8) & allowed & allowed.T, gain, -np.inf)
    names = {use: k for k, use in enumerate(dict.fromkeys(s.use for s in single))}
    group = np.array([names[s.use] for s in single])
    gain[group[:, None] == group[None, :]] = -np.inf
    starts = np.flatnonzero(np.diff(group, prepend=-1))
    edges = [*starts, len(single)]
    for a in range(len(starts)):
        for b in range(a + 1, len(starts)):
            part = gain[edges[a] : edges[a + 1], edges[b] : edges[b + 1]]
            i, j = np.unravel_index(int(np.argmax(part)), part.shape)
            if np.isfinite(part[i, j]):
                _keep(best, single[edges[a] + i], single[edges[b] + j], float(part[i, j]))


def _pair_of_subspaces(
    fit: Projection, first: Scored, second: Scored, best: dict[frozenset[Use], ScoredPair]
) -> None:
    basis = orthonormal(np.column_stack([first.projected, second.projected]))
    along = basis.T @ fit.residual
    _keep(best, first, second, float(along @ along))


def _keep(best: dict[frozenset[Use], ScoredPair], first: Scored, second: Scored, gain: float) -> None:
    pair = ScoredPair(first, second, gain)
    if pair.uses not in best or gain > best[pair.uses].chi2_reduction:
        best[pair.uses] = pair


def different(items: Sequence[Scored], count: int) -> list[Scored]:
    """The best signature of a candidate and the best of those that point elsewhere, in shape or size."""
    taken = [items[0]]
    for item in items[1:]:
        if len(taken) == count:
            break
        if item.chi2_reduction < SAME_GAIN * taken[-1].chi2_reduction and all(_apart(item, t) for t in taken):
            taken.append(item)
    return taken


def _apart(one: Scored, two: Scored) -> bool:
    return one.signature.shapes != two.signature.shapes or bool(
        np.any(one.signature.size != two.signature.size)
    )
