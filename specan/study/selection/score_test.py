"""Score test: chi-square reduction of every candidate and pair by linear algebra, without a refit.

With Q an orthonormal basis of the base's whitened Jacobian and j~ = (I - Q Q^T) j a candidate's signature,
chi-square falls by (j~^T r)^2 / (j~^T j~) at the multiple -j~^T r / j~^T j~ of the signature: the modification
index and the expected parameter change (Saris, Satorra & van der Veld 2009, SEM 16:561). On a boundary the
multiple is held to what the domain allows.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from specan.arrays import Real
from specan.models import Use
from specan.result import gathered
from specan.study.estimation.linear import Projection
from specan.study.selection.signatures import Signature


@dataclass(frozen=True, eq=False)
class Scored:
    """A signature with what it promises.

    Attributes
    ----------
    chi2_reduction : float
        Fall in chi-square that the linearised refit promises.
    expected_change : array, (q,)
        Multiple of the signature at which it is reached.
    """

    signature: Signature
    chi2_reduction: float
    expected_change: Real

    @property
    def use(self) -> Use:
        """The candidate."""
        return self.signature.use

    @property
    def amplitudes(self) -> int:
        """Number of columns."""
        return len(self.signature.names)

    @property
    def count(self) -> int:
        """Number of parameters that it stands for: its amplitudes and shapes."""
        return self.amplitudes + len(self.signature.shapes)


def score(fit: Projection, found: Iterable[Signature]) -> list[Scored]:
    """Score every signature, those first that promise most; those collinear with its Jacobian are left out.

    Parameters
    ----------
    fit : Projection
        The base.
    found : iterable of Signature
    """
    scored = []
    for signature in found:
        columns = signature.columns
        projected = fit.project_out(columns)
        # 1e-6: share of a signature, in chi-square, below which it is collinear with the base's Jacobian
        if not np.sum(projected**2) > 1e-6 * np.sum(columns**2):
            continue
        if projected.shape[1] == 1:
            (column,), (low, high) = projected.T, signature.multiplier_bounds
            along, size = float(column @ fit.residual), float(column @ column)
            # 1.0: chi-square that a signature must be able to leave at some size in its domain
            if size * max(abs(low), abs(high)) ** 2 < 1.0:
                continue
            multiple = min(max(-along / size, low), high)
            gain = -2 * multiple * along - multiple**2 * size
            scored.append(Scored(signature, gain, np.array([multiple])))
        else:
            multiple_q, *_ = np.linalg.lstsq(projected, -fit.residual, rcond=1e-9)
            gain = float(fit.residual @ fit.residual - np.sum((fit.residual + projected @ multiple_q) ** 2))
            scored.append(Scored(signature, gain, np.asarray(multiple_q, dtype=float)))
    return sorted(scored, key=lambda s: -s.chi2_reduction)


def best_of_each(scored: Sequence[Scored]) -> dict[Use, list[Scored]]:
    """Signatures of each candidate, and candidates by their best, in the order of `score`: best first."""
    return gathered((item.use, item) for item in scored)


def different(items: Sequence[Scored], count: int) -> list[Scored]:
    """The best signature of a candidate and the best of those that point elsewhere, in shape or size."""
    taken = [items[0]]
    for item in items[1:]:
        if len(taken) == count:
            break
        same = item.signature.place in [t.signature.place for t in taken]
        # 0.95: of the gain of another start: too near to it to lead elsewhere
        if item.chi2_reduction < 0.95 * taken[-1].chi2_reduction and not same:
            taken.append(item)
    return taken
