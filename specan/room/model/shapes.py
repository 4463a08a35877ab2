"""Shapes of the modes of a box at the places where sound enters, leaves or is picked up."""

from __future__ import annotations

from collections.abc import Sequence
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
