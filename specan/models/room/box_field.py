"""Green's function of a box with locally reacting walls: few modes exactly, the rest quasi-statically.

With ``exp(+j w t)`` and ``dp/dn = -j k beta p`` on the walls, the field of a source ``s`` in a box is

    G(r, r') = sum_N Psi_N(r) Psi_N(r') / (Lambda_N (K_N^2 - k^2)),

where ``Psi_N`` is a product of three axis modes. The sum converges slowly near the source, but what lies
above the truncation depends only weakly on frequency and hardly on the walls: it is taken from the
rigid box, where one axis is summed in closed form, as a polynomial in ``k^2``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specan.models.room.axis_modes import AxisModes

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

_LINES_AT_ONCE = 64  # keeps the (lines, nx, ny, nz) array in the cache


@dataclass(frozen=True)
class Disc:
    """A round patch in a wall over which source or receiver is averaged.

    `axis` is the number of the axis normal to the wall; the centre lies in that wall.
    """

    centre: tuple[float, float, float]
    axis: int
    radius: float


def disc_mean(kt2: NDArray, radius: float) -> NDArray:
    """Mean over a disc of a field with in-plane wave number squared `kt2`, relative to its centre.

    ``2 J1(z)/z`` with ``z = kt a``: the mean value property of solutions of the Helmholtz equation. As a
    power series, which serves complex arguments and needs no branch.
    """
    z = np.asarray(kt2) * (radius**2 / 4)
    term = np.ones_like(z)
    total = np.ones_like(z)
    for n in range(1, 60):
        term = term * (-z) / (n * (n + 1))
        total = total + term
        if np.max(np.abs(term)) < 1e-14:
            break
    return total


def modal_sum(
    axes: tuple[AxisModes, AxisModes, AxisModes], k2: Complex, source: Disc, receivers: Real
) -> Complex:
    """Truncated modal sum from a disc to points.

    Parameters
    ----------
    axes : three AxisModes
        Modes along x, y, z at every line.
    k2 : array (lines,)
        Squared wave number of the air, attenuation included, 1/m^2.
    source : Disc
    receivers : array (points, 3)
        Positions in m.

    Returns
    -------
    array (lines, points)
        Mean of G over the disc, 1/m.
    """
    lines = len(k2)
    out = np.empty((lines, len(receivers)), dtype=complex)
    for first in range(0, lines, _LINES_AT_ONCE):
        part = slice(first, first + _LINES_AT_ONCE)
        some = tuple(AxisModes(a.length, a.w[part], a.a0[part], a.norm[part]) for a in axes)
        amplitudes = _modal_amplitudes(some, k2[part], source)
        at = [axis.at(receivers[:, i]) for i, axis in enumerate(some)]
        along_z = amplitudes @ at[2][:, None]
        along_y = np.einsum("fxyr,fyr->fxr", along_z, at[1])
        out[part] = np.einsum("fxr,fxr->fr", along_y, at[0])
    return out


def _modal_amplitudes(axes: tuple[AxisModes, ...], k2: Complex, source: Disc) -> Complex:
    """Psi_N(source) / (Lambda_N (K_N^2 - k^2)), array (lines, nx, ny, nz)."""
    shape = [(slice(None), slice(None), None, None), (slice(None), None, slice(None), None),
             (slice(None), None, None, slice(None))]  # fmt: skip
    q2 = [axis.q2[where] for axis, where in zip(axes, shape, strict=True)]
    at = [
        (axis.at(np.array([c]))[..., 0] / axis.norm)[where]
        for axis, c, where in zip(axes, source.centre, shape, strict=True)
    ]
    in_plane = [i for i in range(3) if i != source.axis]
    mean = disc_mean(q2[in_plane[0]] + q2[in_plane[1]], source.radius)
    return at[0] * at[1] * at[2] * mean / (q2[0] + q2[1] + q2[2] - k2[:, None, None, None])


@dataclass(frozen=True)
class Remainder:
    """What a truncated modal sum lacks, as a polynomial in ``(k^2 - centre) / radius``."""

    centre: float
    radius: float
    coefficients: Real  # (order, points)

    def at(self, k2: Complex) -> Complex:
        """Values (lines, points)."""
        t = ((k2 - self.centre) / self.radius)[:, None]
        total = np.zeros((len(k2), self.coefficients.shape[1]), dtype=complex)
        for row in self.coefficients[::-1]:
            total = total * t + row
        return total


def remainder(
    lengths: tuple[float, float, float],
    counts: tuple[int, int, int],
    k2_max: float,
    source: Disc,
    receivers: Real,
    receiver_disc: Disc | None = None,
    order: int = 4,
) -> Remainder:
    """Rigid-box field above the truncation `counts`, for ``0 <= k^2 <= k2_max``.

    The axis normal to the source's wall is summed in closed form,
    ``cosh(kappa (L - x)) / (kappa sinh(kappa L))``, the other two as modes until they have died out. The
    values at points on a circle in the plane of k^2 give the Taylor coefficients (Cauchy's formula);
    off the real axis no mode is near.
    """
    centre, radius = k2_max / 2, 0.6 * k2_max
    angles = 2 * np.pi * (np.arange(2 * order + 4) + 0.5) / (2 * order + 4)
    nodes = centre + radius * np.exp(1j * angles)
    values = np.stack([_above(lengths, counts, node, source, receivers, receiver_disc) for node in nodes])
    powers = np.exp(-1j * np.outer(np.arange(order + 1), angles))
    return Remainder(centre, radius, (powers @ values / len(nodes)).real)


def _above(
    lengths: tuple[float, float, float],
    counts: tuple[int, int, int],
    k2: complex,
    source: Disc,
    receivers: Real,
    receiver_disc: Disc | None,
) -> Complex:
    normal = source.axis
    i, j = (axis for axis in range(3) if axis != normal)
    distance = np.abs(receivers[:, normal] - source.centre[normal])
    # A mode with in-plane wave number kappa reaches exp(-kappa x); the disc's own mean falls like
    # (kappa a)^-1.5, squared where the receiver is a disc too.
    reach = min(30.0 / max(float(distance.min()), 1e-9), 120.0 / source.radius)
    m = np.arange(int(reach * lengths[i] / np.pi) + counts[i] + 1)
    n = np.arange(int(reach * lengths[j] / np.pi) + counts[j] + 1)
    qm, qn = np.pi * m / lengths[i], np.pi * n / lengths[j]
    kt2 = qm[:, None] ** 2 + qn**2
    kept = kt2 <= max(reach, qm[counts[i]], qn[counts[j]]) ** 2
    weight = np.where(m == 0, 1.0, 2.0)[:, None] * np.where(n == 0, 1.0, 2.0) / (lengths[i] * lengths[j])
    weight = weight * _bessel_mean(kt2, source.radius)
    if receiver_disc is not None:
        weight = weight * _bessel_mean(kt2, receiver_disc.radius)
    weight = weight * np.cos(qm * source.centre[i])[:, None] * np.cos(qn * source.centre[j])
    low = (m < counts[i])[:, None] & (n < counts[j])
    out = np.empty(len(receivers), dtype=complex)
    for r, point in enumerate(receivers):
        along = _closed_form(lengths[normal], kt2, kept, k2, distance[r])
        along[low] -= _modes_of_axis(lengths[normal], counts[normal], kt2[low] - k2, distance[r])
        field = weight * along * np.cos(qm * point[i])[:, None] * np.cos(qn * point[j])
        out[r] = field[kept].sum()
    return out


def _bessel_mean(kt2: Real, radius: float) -> Real:
    from scipy.special import j1

    z = np.sqrt(kt2) * radius
    return np.where(z < 1e-8, 1.0, 2 * j1(z) / np.where(z < 1e-8, 1.0, z))


def _closed_form(length: float, kt2: Real, kept: NDArray[np.bool_], k2: complex, x: float) -> Complex:
    """Rigid axis summed over all its modes, at distance `x` from the wall that holds the source."""
    kappa = np.sqrt(kt2[kept] - k2 + 0j)
    decay = np.exp(-2 * kappa * length)
    out = np.zeros(kt2.shape, dtype=complex)
    out[kept] = (np.exp(-kappa * x) + np.exp(-kappa * (2 * length - x))) / (kappa * (1 - decay))
    return out


def _modes_of_axis(length: float, count: int, gap: Complex, x: float) -> Complex:
    """The first `count` terms of the same sum."""
    n = np.arange(count)
    weight = np.where(n == 0, 1.0, 2.0) / length * np.cos(np.pi * n * x / length)
    found: Complex = (weight / ((np.pi * n / length) ** 2 + gap[:, None])).sum(axis=1)
    return found
