"""Sum over the modes of a box, products of three axis modes, at every line that is asked for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.arrays import Complex
from specan.room.model.axis_modes import AxisModes, norms, slopes, waves
from specan.room.model.port import Port


@dataclass(frozen=True, eq=False)
class Shapes:
    """Some modes of a box: products of three axis functions.

    Attributes
    ----------
    lengths : tuple of float
        Edges, m; negative along an axis that is counted from its far end.
    w, a0 : three arrays
        Squared dimensionless wave numbers and first walls along the edges; see `AxisModes`. The arrays go together: a
        mode an element, or each axis along a dimension of its own.
    """

    lengths: Sequence[float]
    w: Sequence[Complex]
    a0: Sequence[Complex]
    _means: dict[tuple[Any, ...], NDArray] = field(default_factory=dict, repr=False)
    _at: dict[Port, Complex] = field(default_factory=dict, repr=False)

    @classmethod
    def of(cls, axes: Sequence[AxisModes], orders: NDArray[np.intp]) -> Shapes:
        """Modes of the given orders (3, modes), at the lines of the axes."""
        return cls(
            [axis.length for axis in axes],
            [axis.w[:, n] for axis, n in zip(axes, orders, strict=True)],
            [axis.a0 for axis in axes],
        )

    @cached_property
    def squares(self) -> list[Complex]:
        """Squared wave numbers along the edges, 1/m^2."""
        return [w / length**2 for w, length in zip(self.w, self.lengths, strict=True)]

    @cached_property
    def norm(self) -> Complex:
        """Integral of the squared shapes over the box, m^3."""
        x, y, z = (length * norms(w, a0) for length, w, a0 in zip(self.lengths, self.w, self.a0, strict=True))
        return np.asarray(x * y * z)

    def at(self, port: Port) -> Complex:
        """Shapes at a port, averaged over it, or their derivative there."""
        if port not in self._at:
            self._at[port] = self._found(port)
        return self._at[port]

    def _found(self, port: Port) -> Complex:
        along = []
        for i, (length, w, a0) in enumerate(zip(self.lengths, self.w, self.a0, strict=True)):
            part = port.position[i] / length
            along.append(slopes(w, a0, part) / length if port.slope == i else waves(w, a0, part))
        if port.radius == 0:
            return np.asarray(along[0] * along[1] * along[2])
        key = (port.axis, port.radius, port.ball, port.proportions)
        if key not in self._means:
            self._means[key] = port.mean(self.squares)
        # a patch averages over two axes: what these have is multiplied before the third joins
        first, second, third = (*(i for i in range(3) if i != port.axis), port.axis)
        return np.asarray(along[first] * along[second] * self._means[key] * along[third])

    def at_all(self, ports: Sequence[Port]) -> Complex:
        """The same for several ports, the last axis."""
        places = np.array([port.position for port in ports])
        x, y, z = (
            waves(w[..., None], a0[..., None], places[:, i] / length)
            for i, (length, w, a0) in enumerate(zip(self.lengths, self.w, self.a0, strict=True))
        )
        found = np.asarray(x * y * z)
        for k, port in enumerate(ports):
            if port.radius > 0 or port.slope is not None:
                found[..., k] = self.at(port)
        return found


_TERMS_AT_ONCE = 30_000  # of the modal sum: an array (lines, nx, ny, nz) in the processor's cache
_TERMS_KEPT = 300_000  # of which what all ports share stays in memory


@dataclass(frozen=True)
class Modes:
    """Modes of the box at some lines.

    Attributes
    ----------
    axes : three axes
        Eigenvalues and eigenfunctions along the edges.
    k2 : array (lines,)
        Squared wave number with the air's attenuation in it, 1/m^2.
    moved : array of int (3, n) and array (n,), optional
        Numbers of some modes along the edges, and by how much their squared wave numbers are larger, 1/m^2.
    """

    axes: tuple[AxisModes, ...]
    k2: Complex
    moved: tuple[NDArray[np.intp], Complex] | None = None
    _lines: dict[int, tuple[Shapes, Complex]] = field(default_factory=dict, repr=False, compare=False)

    def _parts(self) -> Iterator[tuple[slice, Shapes, Complex]]:
        """Shapes of all modes and ``1 / (Lambda (K^2 - k^2))``, arrays (lines, nx, ny, nz), a few lines at once.

        They are kept for the next port where they take little room.
        """
        modes = int(np.prod([axis.w.shape[1] for axis in self.axes]))
        step = max(1, _TERMS_AT_ONCE // modes)
        for first in range(0, len(self.k2), step):
            part = slice(first, first + step)
            here = self._lines.get(first) or self._some(part)
            if modes * len(self.k2) < _TERMS_KEPT:
                self._lines[first] = here
            yield part, *here

    def _some(self, part: slice) -> tuple[Shapes, Complex]:
        w = [
            np.expand_dims(axis.w[part], [d for d in (1, 2, 3) if d != i])
            for i, axis in enumerate(self.axes, 1)
        ]
        shapes = Shapes(
            [axis.length for axis in self.axes], w, [a.a0[part][..., None, None] for a in self.axes]
        )
        x, y, z = shapes.squares
        distance = (x - self.k2[part][:, None, None, None]) + y + z
        if self.moved is not None:
            distance[:, *self.moved[0]] += self.moved[1]
        return shapes, 1 / (shapes.norm * distance)

    def coupling(self, source: Port, receivers: Sequence[Port]) -> Complex:
        """Sum of the modes, averaged over both ports: array (lines, receivers)."""
        points = np.array([port.position for port in receivers])
        at = [axis.at(points[:, i]) for i, axis in enumerate(self.axes)]
        out = np.empty((len(self.k2), len(receivers)), dtype=complex)
        special = [i for i, port in enumerate(receivers) if port.radius > 0 or port.slope is not None]
        for part, shapes, weight in self._parts():
            amplitudes = shapes.at(source) * weight
            along_z = amplitudes @ at[2][part][:, None]
            along_y = np.einsum("fxyr,fyr->fxr", along_z, at[1][part])
            out[part] = np.einsum("fxr,fxr->fr", along_y, at[0][part])
            for i in special:
                out[part, i] = np.einsum("fxyz,fxyz->f", amplitudes, shapes.at(receivers[i]))
        return out

    def products(self, source: Port, receivers: Sequence[Port], numbers: NDArray[np.intp]) -> Complex:
        """``Psi(r) Psi(s) / Lambda`` of single modes (3, n), array (lines, receivers, n)."""
        shapes = Shapes.of(self.axes, numbers)
        found = (shapes.at(source) / shapes.norm)[..., None] * shapes.at_all(receivers)
        return found.transpose(0, 2, 1)

    def lacks(self, numbers: NDArray[np.intp]) -> Complex:
        """``K^2 - k^2`` of single modes (3, n), as the box has them, array (lines, n)."""
        x, y, z = (axis.q2[:, n] for axis, n in zip(self.axes, numbers, strict=True))
        return np.asarray(x + y + z - self.k2[:, None])
