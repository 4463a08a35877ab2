"""Systems of a reduced room, one a line: solved directly where small, else by iteration, all lines at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

DIRECT = 160  # vectors up to which a direct solution is the faster one
WINDOW = 64  # vectors whose squared wave numbers are the nearest to a line's: solved together, exactly
_TOLERANCE = 1e-8  # of the residual
_MOST = 48  # iterations; lines that need more are solved directly
_AT_ONCE = 64  # lines that are held together


@dataclass(frozen=True, eq=False)
class Lines:
    """``(diag(values) - k2 + sum_g soft_g walls_g) x = load`` for each line.

    Attributes
    ----------
    values : array (n,)
    walls : array (groups, n, n)
    k2 : array (lines,)
    soft : array (groups, lines)
    """

    values: Real
    walls: Real
    k2: Complex
    soft: Complex

    def solve(self, loads: Real) -> Complex:
        """Solutions (lines, n, sources) for loads (n, sources)."""
        parts = [slice(i, i + _AT_ONCE) for i in range(0, len(self.k2), _AT_ONCE)]
        one = self._direct if len(self.values) <= DIRECT else self._by_iteration
        return np.concatenate([one(part, loads) for part in parts])

    def _direct(self, part: slice | NDArray[np.intp], loads: Real) -> Complex:
        size = len(self.values)
        soft, flat = self.soft[:, part].T, self.walls.reshape(len(self.walls), -1)
        matrix = np.empty((len(soft), size, size), dtype=complex)
        matrix.real = (soft.real @ flat).reshape(matrix.shape)
        matrix.imag = (soft.imag @ flat).reshape(matrix.shape)
        matrix[:, np.arange(size), np.arange(size)] += self.values - self.k2[part, None]
        return np.linalg.solve(matrix, loads[None]).astype(complex, copy=False)

    def _by_iteration(self, part: slice, loads: Real) -> Complex:
        lines = np.arange(len(self.k2))[part]
        near = np.argsort(np.abs(self.values - self.k2[part, None].real), axis=1)[:, :WINDOW]
        block = np.einsum(
            "gl,glij->lij", self.soft[:, part], self.walls[:, near[:, :, None], near[:, None, :]]
        )
        away = self.values - self.k2[part, None]
        places = np.arange(len(lines))[:, None]
        block[:, np.arange(WINDOW), np.arange(WINDOW)] += away[places, near]
        inverse = np.linalg.inv(block)
        far = 1 / (away + np.einsum("gl,gii->li", self.soft[:, part], self.walls))
        out = np.zeros((len(lines), len(self.values), loads.shape[1]), dtype=complex)

        def apply(x: Complex) -> Complex:
            pushed = np.array([x.real @ wall + 1j * (x.imag @ wall) for wall in self.walls])
            return away * x + np.einsum("gl,gli->li", self.soft[:, part], pushed)

        def precondition(x: Complex) -> Complex:
            y = far * x
            y[places, near] = (inverse @ x[places, near][..., None])[..., 0]
            return y

        for i in np.flatnonzero(loads.any(axis=0)):
            load = loads[:, i]
            x, done = gmres(apply, precondition, np.broadcast_to(load, away.shape).astype(complex))
            out[..., i] = x
            if not done.all():
                out[~done, :, i] = self._direct(lines[~done], load[:, None])[..., 0]
        return out


def gmres(
    apply: Callable[[Complex], Complex], precondition: Callable[[Complex], Complex], right: Complex
) -> tuple[Complex, NDArray[np.bool_]]:
    """Generalised minimal residuals for several systems at once (Saad and Schultz 1986, flexible form).

    Parameters
    ----------
    apply, precondition : callable
        Matrix, and an approximate inverse, applied to rows (systems, n).
    right : array (systems, n)
        None of them zero.

    Returns
    -------
    x : array (systems, n)
    done : array of bool
        Which residuals are small enough.
    """
    size = np.linalg.norm(right, axis=1)
    basis, steps = [right / size[:, None]], []
    table = np.zeros((len(right), _MOST + 1, _MOST), dtype=complex)
    for j in range(_MOST):
        steps.append(precondition(basis[j]))
        new = apply(steps[j])
        for _ in range(2):  # twice is enough
            known = np.stack(basis, axis=1)
            share = np.einsum("sjn,sn->sj", known.conj(), new)
            new = new - np.einsum("sjn,sj->sn", known, share)
            table[:, : j + 1, j] += share
        length = np.linalg.norm(new, axis=1)
        table[:, j + 1, j] = length
        basis.append(new / np.where(length > 0, length, 1.0)[:, None])
        if j % 4 == 3 or j == _MOST - 1:
            weights, left = _least_squares(table[:, : j + 2, : j + 1])
            if left.max() < _TOLERANCE:
                break
    found: Complex = np.einsum("sjn,sj->sn", np.stack(steps, axis=1), weights) * size[:, None]
    return found, left < _TOLERANCE


def _least_squares(table: Complex) -> tuple[Complex, Real]:
    """Weights of the steps that leave the smallest part of the right side, and that part."""
    q, r = np.linalg.qr(table)
    r = r + 1e-30 * np.eye(r.shape[-1])  # a system that is solved already steps no further
    weights = np.linalg.solve(r, q[:, :1].conj().transpose(0, 2, 1))
    left = -(table @ weights)[..., 0]
    left[:, 0] += 1
    return weights[..., 0], np.linalg.norm(left, axis=1)
