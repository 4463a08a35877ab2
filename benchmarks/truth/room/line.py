"""One axis of the grid: polynomials through Legendre-Gauss-Lobatto points on elements in a row."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

Real = NDArray[np.floating]

LONGEST_ELEMENT_M = 0.62
_ORDERS = (3, 9)
_POINTS_PER_M = 15.0  # eight to nine per wavelength at 600 Hz


def gauss_lobatto(order: int) -> tuple[Real, Real]:
    """Points and weights of the Legendre-Gauss-Lobatto rule on [-1, 1], exact to degree 2 order - 1.

    The inner points are the zeros of the derivative of the Legendre polynomial; the weights are
    ``2 / (N (N + 1) P_N(x)^2)`` (Canuto et al., Spectral Methods, 2006, section 2.3).

    Examples
    --------
    >>> points, weights = gauss_lobatto(2)
    >>> points.round(12).tolist(), (3 * weights).round(12).tolist()
    ([-1.0, 0.0, 1.0], [1.0, 4.0, 1.0])
    """
    polynomial = legendre.Legendre.basis(order)
    points = np.concatenate([[-1.0], np.sort(polynomial.deriv().roots().real), [1.0]])
    return points, 2.0 / (order * (order + 1) * polynomial(points) ** 2)


def lagrange(nodes: Real, at: Real) -> Real:
    """Values of the Lagrange polynomials through `nodes` at the points `at`, shape (points, nodes)."""
    values = np.ones((len(at), len(nodes)))
    for i, node in enumerate(nodes):
        for k, other in enumerate(nodes):
            if k != i:
                values[:, i] *= (at - other) / (node - other)
    return values


def _slopes(nodes: Real) -> Real:
    """Derivatives of the Lagrange polynomials at their own nodes, shape (nodes, polynomials)."""
    gap = nodes[:, None] - nodes[None, :] + np.eye(len(nodes))
    product = np.prod(gap, axis=1)
    slopes = product[:, None] / product[None, :] / gap
    np.fill_diagonal(slopes, 0.0)
    np.fill_diagonal(slopes, -slopes.sum(axis=1))
    return slopes


@dataclass(frozen=True)
class Line:
    """Nodes, weights and stiffness of one axis.

    Attributes
    ----------
    nodes : array (n,)
        Coordinates, m; the ends belong to them.
    weights : array (n,)
        Integration weights, m: the diagonal mass matrix.
    stiffness : array (n, n)
        Integrals of the products of the basis functions' derivatives, 1/m.
    """

    length_m: float
    n_elements: int
    order: int
    nodes: Real
    weights: Real
    stiffness: Real

    def basis(self, at: Real) -> Real:
        """Values of all basis functions at the coordinates `at`, shape (points, nodes)."""
        return self._at(at, lagrange)

    def slopes(self, at: Real) -> Real:
        """Derivatives of all basis functions at the coordinates `at`, shape (points, nodes), 1/m."""
        return self._at(at, lambda nodes, x: lagrange(nodes, x) @ _slopes(nodes))

    def _at(self, at: Real, polynomials: Callable[[Real, Real], Real]) -> Real:
        at = np.atleast_1d(np.asarray(at, float))
        size = self.length_m / self.n_elements
        own = np.clip((at / size).astype(int), 0, self.n_elements - 1)
        values = np.zeros((len(at), len(self.nodes)))
        for element in np.unique(own):
            rows = np.flatnonzero(own == element)
            first = element * self.order
            inside = slice(first, first + self.order + 1)
            values[rows, inside] = polynomials(self.nodes[inside], at[rows])
        return values


def line(length_m: float) -> Line:
    """The grid along an edge of the given length, fine enough for 800 Hz."""
    n_elements = int(np.ceil(length_m / LONGEST_ELEMENT_M))
    size = length_m / n_elements
    order = int(np.clip(np.ceil(_POINTS_PER_M * size), *_ORDERS))
    points, weights = gauss_lobatto(order)
    slopes = _slopes(points)
    local = 2.0 / size * slopes.T @ (weights[:, None] * slopes)
    n = n_elements * order + 1
    nodes, mass, stiffness = np.zeros(n), np.zeros(n), np.zeros((n, n))
    for element in range(n_elements):
        part = slice(element * order, element * order + order + 1)
        nodes[part] = size * (element + (points + 1.0) / 2.0)
        mass[part] += size / 2.0 * weights
        stiffness[part, part] += local
    return Line(length_m, n_elements, order, nodes, mass, stiffness)
