"""Sum over the modes of a box, products of three axis modes, at every line that is asked for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from specan.arrays import Complex
from specan.room.model.axis_modes import AxisModes
from specan.room.model.port import Port
from specan.room.model.resonances import Shapes

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

    axes: tuple[AxisModes, AxisModes, AxisModes]
    k2: Complex
    moved: tuple[NDArray[np.intp], Complex] | None = None
    _lines: dict[int, _Lines] = field(default_factory=dict, repr=False, compare=False)

    def _parts(self) -> Iterator[tuple[slice, _Lines]]:
        """The modes, a few lines at once; kept for the next port where they take little room."""
        modes = int(np.prod([axis.w.shape[1] for axis in self.axes]))
        step = max(1, _TERMS_AT_ONCE // modes)
        for first in range(0, len(self.k2), step):
            part = slice(first, first + step)
            here = self._lines.get(first) or _Lines.of(self, part)
            if modes * len(self.k2) < _TERMS_KEPT:
                self._lines[first] = here
            yield part, here

    def coupling(self, source: Port, receivers: Sequence[Port]) -> Complex:
        """Sum of the modes, averaged over both ports: array (lines, receivers)."""
        points = np.array([port.position for port in receivers])
        at = [axis.at(points[:, i]) for i, axis in enumerate(self.axes)]
        out = np.empty((len(self.k2), len(receivers)), dtype=complex)
        special = [i for i, port in enumerate(receivers) if port.radius > 0 or port.slope is not None]
        from_source = _along(self.axes, source)
        to_special = [_along(self.axes, receivers[i]) for i in special]
        for part, here in self._parts():
            amplitudes = here.amplitudes([x[part] for x in from_source], source)
            along_z = amplitudes @ at[2][part][:, None]
            along_y = np.einsum("fxyr,fyr->fxr", along_z, at[1][part])
            out[part] = np.einsum("fxr,fxr->fr", along_y, at[0][part])
            for i, along in zip(special, to_special, strict=True):
                out[part, i] = here.port_sum(amplitudes, [x[part] for x in along], receivers[i])
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


_ALONG = (
    (slice(None), slice(None), None, None),
    (slice(None), None, slice(None), None),
    (slice(None), None, None, slice(None)),
)


def _along(axes: Sequence[AxisModes], port: Port) -> list[Complex]:
    """Axis functions, or the derivative along one axis, at a port; ready to be multiplied."""
    return [axis.along(port.position[i], port.slope == i) for i, axis in enumerate(axes)]


@dataclass
class _Lines:
    """The modes at some lines."""

    q2: Sequence[Complex]  # squared wave numbers of the axes, ready to be added
    norm: Sequence[Complex]
    distance: Complex  # K_N^2 - k^2, array (lines, nx, ny, nz)
    _means: dict[tuple[int, float, bool, tuple[float, float, float]], NDArray] = field(default_factory=dict)

    @classmethod
    def of(cls, modes: Modes, part: slice) -> _Lines:
        each = list(zip(modes.axes, _ALONG, strict=True))
        q = [axis.q2[part][where] for axis, where in each]
        distance = (q[0] - modes.k2[part][:, None, None, None]) + q[1] + q[2]
        if modes.moved is not None:
            distance[:, *modes.moved[0]] += modes.moved[1]
        return cls(q, [axis.norm[part][where] for axis, where in each], distance)

    def amplitudes(self, along: Sequence[Complex], source: Port) -> Complex:
        """Psi_N(source) / (Lambda_N (K_N^2 - k^2)), array (lines, nx, ny, nz)."""
        at = [x[where] / norm for x, norm, where in zip(along, self.norm, _ALONG, strict=True)]
        found: Complex = self._product(at, source) / self.distance
        return found

    def port_sum(self, amplitudes: Complex, along: Sequence[Complex], port: Port) -> Complex:
        """Sum of the modes over a patch, a ball, or of a derivative, array (lines,)."""
        shape = self._product([x[w] for x, w in zip(along, _ALONG, strict=True)], port)
        found: Complex = np.einsum("fxyz,fxyz->f", amplitudes, np.broadcast_to(shape, amplitudes.shape))
        return found

    def _product(self, at: Sequence[Complex], port: Port) -> Complex:
        """Mode shapes at a port; what has two axes is multiplied before the third joins."""
        if port.radius == 0:
            return (at[0] * at[1]) * at[2]
        mean = self._mean(port)
        if port.ball:
            return (at[0] * at[1]) * at[2] * mean
        i, j = (axis for axis in range(3) if axis != port.axis)
        return (at[i] * at[j] * mean) * at[port.axis]

    def _mean(self, port: Port) -> NDArray:
        """Factor that averages the modes over a patch or ball."""
        key = (port.axis, port.radius, port.ball, port.proportions)
        if key not in self._means:
            self._means[key] = port.mean(self.q2)
        return self._means[key]
