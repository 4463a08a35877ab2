"""Modes of one axis of a box between two locally reacting walls."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from specan.arrays import Complex, Real
from specan.errors import ComputationError
from specan.models.kept import kept
from specan.room.model.frequency_interpolation import LOOKED_AT, FrequencyInterpolation, mixed

HELD = 1e-8  # step by which a mode known from few lines may be off, part of its squared wave number and one


@dataclass(frozen=True)
class AxisModes:
    """Eigenvalues and eigenfunctions along one axis, for every frequency line.

    The eigenfunction is ``X(x) = cos(q x) + (a0 / u) sin(q x)`` with ``q = u / L`` and ``w = u ** 2``.

    Attributes
    ----------
    length : float
        Length of the axis, m.
    w : array (lines, modes)
        Squared dimensionless wave numbers ``(q L) ** 2``.
    a0 : array (lines, 1)
        ``j k beta L`` of the wall at the origin, and of the other.
    norm : array (lines, modes)
        Integral of ``X ** 2`` over the axis, m.
    """

    length: float
    w: Complex
    a0: Complex
    norm: Complex
    _at: dict[bytes, Complex] = field(default_factory=dict, repr=False, compare=False)

    @property
    def q2(self) -> Complex:
        """Squared wave numbers, 1/m^2."""
        return self.w / self.length**2

    def holds(self, few: FrequencyInterpolation, count: int, a0: Complex, a1: Complex) -> bool:
        """Whether its first modes, known at few lines, are modes between walls with ``j k beta L`` of (lines,)."""
        w = mixed(few.matrix[LOOKED_AT], self.w[:, :count])
        value, slope = characteristic(w, a0[LOOKED_AT, None], a1[LOOKED_AT, None])
        return bool(np.max(np.abs(value / slope) / (1 + np.abs(w))) < HELD)

    def at(self, x: Real) -> Complex:
        """Eigenfunctions at positions `x` (m): array (lines, modes, positions)."""
        key = np.asarray(x, dtype=float).tobytes()
        if key not in self._at:
            if len(self._at) >= 4:
                self._at.clear()
            part = np.asarray(x, dtype=float) / self.length
            self._at[key] = waves(self.w[..., None], self.a0[..., None], part)
        return self._at[key]


def waves(w: Complex, a0: Complex, part: Real | float) -> Complex:
    """``cos(u s) + (a0 / u) sin(u s)`` with ``w = u ** 2``, at parts `s` of the axis; the arrays go together."""
    u = np.where(np.abs(w) < 1e-12, 1e-6, np.sqrt(w))
    wave = np.exp(1j * u * part)  # one exponential is cheaper than a sine and a cosine
    back = 1 / wave
    found: Complex = 0.5 * (wave + back) - (0.5j * a0 / u) * (wave - back)
    return found


def slopes(w: Complex, a0: Complex, part: Real | float) -> Complex:
    """Their derivatives by the part of the axis."""
    cosine, sine = _cos_sinc(w * np.square(part))
    found: Complex = a0 * cosine - w * part * sine
    return found


# A fit changes one wall or one edge at a time; the other axes stay. Zeros are always looked for from the same start:
# one that depends on what was solved before makes two processes differ in the last digits.
@kept(8)
def axis_modes(length: float, a0: Complex | float, a1: Complex | float, count: int) -> AxisModes:
    """Solve ``X'' + q^2 X = 0`` with ``X'(0) = (a0/L) X(0)`` and ``X'(L) = -(a1/L) X(L)``.

    The characteristic function is entire in ``w = (q L)^2``,

        F(w) = w S - (a0 + a1) C - a0 a1 S,   S = sin(sqrt w)/sqrt w,  C = cos(sqrt w),

    and its first `count` zeros are found together (Aberth's iteration), which keeps two of them from
    running into one.

    Parameters
    ----------
    length : float
        Length of the axis, m.
    a0, a1 : array (lines,)
        ``j k beta L`` of the walls at 0 and L, with ``dp/dn = -j k beta p`` and ``exp(+j w t)``.
    count : int
        Number of modes.

    Raises
    ------
    ComputationError
        The zeros are not found at some line.
    """
    a0, a1 = (np.atleast_1d(np.asarray(a, dtype=complex))[:, None] for a in (a0, a1))
    w = _zeros(length, a0, a1, count)
    return AxisModes(length, w, a0, length * norms(w, a0))


def _zeros(length: float, a0: Complex, a1: Complex, count: int) -> Complex:
    rigid = (np.pi * np.arange(count)) ** 2
    shift = (a0 + a1) * np.where(np.arange(count) == 0, 1.0, 2.0)  # first-order perturbation
    limit = 0.25 * np.where(np.arange(count) == 0, 8.0, 2 * np.pi**2 * np.maximum(np.arange(count), 1))
    w = rigid + shift * np.minimum(1.0, limit / np.maximum(np.abs(shift), 1e-300))
    left = _iterate(w, a0, a1, np.arange(len(w)))
    if left.size:
        w[left] = _galerkin(a0[left], a1[left], count)
        left = _iterate(w, a0, a1, left)
    if left.size:
        raise ComputationError(
            f"the wall's admittance gives no clear modes along an axis of {length:.3g} m at {left.size} lines",
            expected="zeros found within 60 iterations",
            remedy="narrow the parameters of the walls or the frequency range",
        )
    return w


def _iterate(w: Complex, a0: Complex, a1: Complex, lines: NDArray[np.intp]) -> NDArray[np.intp]:
    """Refine `w` in place at the given lines; returns those that did not settle."""
    for _ in range(60):
        step = _aberth_step(w[lines], a0[lines], a1[lines])
        w[lines] -= step
        lines = lines[np.max(np.abs(step) / (1.0 + np.abs(w[lines])), axis=1) > 1e-12]
        if not lines.size:
            break
    return lines


def _galerkin(a0: Complex, a1: Complex, count: int) -> Complex:
    """Starting values from a cosine expansion, for walls so soft that the rigid modes are no guide."""
    n = np.arange(3 * count)
    weight = np.sqrt(np.where(n == 0, 1.0, 2.0))
    near, far = np.outer(weight, weight), np.outer(weight * (-1.0) ** n, weight * (-1.0) ** n)
    matrices = a0[..., None] * near + a1[..., None] * far
    matrices[:, n, n] += (np.pi * n) ** 2
    values = np.linalg.eigvals(matrices)
    order = np.argsort(values.real, axis=1)
    found: Complex = np.take_along_axis(values, order, axis=1)[:, :count]
    return found


def _aberth_step(w: Complex, a0: Complex, a1: Complex) -> Complex:
    value, slope = characteristic(w, a0, a1)
    newton = value / slope
    gap = w[:, :, None] - w[:, None, :] + 1e-30  # two starting values may coincide
    gap[:, np.arange(w.shape[1]), np.arange(w.shape[1])] = np.inf
    # Far from a zero the repulsion matters, near it Newton's step is left as it is.
    correction = 1.0 - newton * np.sum(1.0 / gap, axis=2)
    far = np.abs(newton) > 0.05 * (1.0 + np.min(np.abs(gap), axis=2))
    step = np.where(far, newton / correction, newton)
    longest = 1.0 + np.sqrt(np.abs(w))
    return step * np.minimum(1.0, 3 * longest / np.maximum(np.abs(step), 1e-300))


def characteristic(w: Complex, a0: Complex, a1: Complex) -> tuple[Complex, Complex]:
    """``F(w) = w S - (a0 + a1) C - a0 a1 S`` and its derivative; see `axis_modes`."""
    cosine, sine = _cos_sinc(w)
    slope_sine = np.where(np.abs(w) < 1e-4, -1 / 6 + w / 60, (cosine - sine) / (2 * np.where(w == 0, 1, w)))
    value = w * sine - (a0 + a1) * cosine - a0 * a1 * sine
    return value, sine + (w - a0 * a1) * slope_sine + (a0 + a1) * sine / 2


def norms(w: Complex, a0: Complex) -> Complex:
    """Integral of the squared eigenfunction over the axis, divided by the length."""
    cosine, sine = _cos_sinc(w)
    w = np.where(w == 0, 1e-300, w)
    ratio = a0**2 / w
    return 0.5 * (1 + ratio + (1 - ratio) * sine * cosine) + a0 * sine**2


def _cos_sinc(w: Complex) -> tuple[Complex, Complex]:
    """``cos(sqrt w)`` and ``sin(sqrt w)/sqrt w``; both are even in the root, so its branch is free."""
    u = np.sqrt(w)
    # of real arrays: a complex sine costs three times as much
    turn, growth = np.ascontiguousarray(u.real), np.ascontiguousarray(u.imag)
    sine, cosine, rise, fall = np.sin(turn), np.cos(turn), np.cosh(growth), np.sinh(growth)
    small = np.abs(u) < 1e-6
    whole = sine * rise + 1j * (cosine * fall)
    return cosine * rise - 1j * (sine * fall), np.where(small, 1.0 - w / 6, whole / np.where(small, 1.0, u))
