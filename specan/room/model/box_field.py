"""Green's function of a box with locally reacting walls: few modes exactly, the rest quasi-statically.

With ``exp(+j w t)`` and ``dp/dn = -j k beta p`` on the walls, the field of a source at ``s`` is

    G(r, s) = sum_N Psi_N(r) Psi_N(s) / (Lambda_N (K_N^2 - k^2)),

where ``Psi_N`` is a product of three axis modes (`specan.room.model.modal_sum`). The sum is taken at few lines only
(`specan.room.model.frequency_interpolation`), and carried to all others by the poles of the modes that resonate in
the band (`specan.room.model.resonances`); what lies above the truncation is added by
`specan.room.model.static_correction`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.arrays import Complex, Real
from specan.room.model.axis_modes import AxisModes, axis_modes
from specan.room.model.frequency_interpolation import interpolations
from specan.room.model.leaning_walls import LEANS, LeaningWall
from specan.room.model.modal_sum import Modes
from specan.room.model.port import Port, beyond, point
from specan.room.model.resonances import Resonances, resonances
from specan.room.model.static_correction import corrections_at, static_correction

PLANE_WAVES = 2  # of a leaning wall, beside those that travel along it
NEAR = 1.25  # times the largest wave number, up to which modes may resonate in the band


@dataclass
class BoxField:
    """The box at given lines; couplings between ports are computed on demand.

    Attributes
    ----------
    lengths : tuple of float
        Edges in m.
    modes : Modes
        At the few lines of `resonances`; at all where there are none.
    k2 : array (lines,)
        Squared wave number with the air's attenuation in it, 1/m^2.
    soft : array (6, lines)
        ``j k beta`` of the walls x0, x1, y0 ... in 1/m.
    drawn : tuple of float
        Edges as drawn, m: what lies above the truncation is taken from the room as it is drawn. An edge
        that is off by a percent changes that by some hundredths of a percent of the field.
    k2_max : float
        Largest squared wave number for which the static_correction is to hold.
    counts : tuple of int
        Modes along the edges at the truncation.
    resonances : Resonances, optional
        What carries the sum from few lines to all.
    leaning : tuple of LeaningWall
        Walls that do not stand upright.
    """

    lengths: tuple[float, float, float]
    modes: Modes
    k2: Complex
    soft: Complex
    drawn: tuple[float, float, float]
    k2_max: float
    counts: tuple[int, ...]
    resonances: Resonances | None = None
    leaning: tuple[LeaningWall, ...] = ()
    _done: dict[object, Complex] = field(default_factory=dict, repr=False)

    def prepare(self, ports: Sequence[Port]) -> None:
        """Get ready for sources; here each is as cheap alone."""

    def patch(self, wall: str, position: Sequence[float] | Real, radius: float) -> Port:
        """A round patch at a position in a wall."""
        return Port(point(position), "xyz".index(wall[0]), radius)

    def place(self, wall: str, across: float, along: float, radius: float) -> Port:
        """A round patch in parts of a wall's edges."""
        axis = "xyz".index(wall[0])
        parts = np.insert([float(across), float(along)], axis, float(wall[1]))
        here, drawn = (point(np.multiply(parts, edges)) for edges in (self.lengths, self.drawn))
        return Port(here, axis, radius, drawn=drawn)

    def coupling(self, source: Port, receivers: Sequence[Port]) -> Complex:
        """Mean of G over both ports, array (lines, receivers), 1/m."""
        new = []
        for port in dict.fromkeys(receivers):
            if (source, port) in self._done:
                continue
            # Reciprocity; patches that are large, as pistons, are asked first: what lies across the axis that is summed
            # in closed form is taken for a patch along it.
            if (port, source) in self._done:
                self._done[source, port] = self._done[port, source]
            else:
                new.append(port)
        if new:
            found = self.modes.coupling(source, new)
            # A ball averages away what lies above the truncation, but for its own field.
            plain = [i for i, port in enumerate(new) if not port.ball]
            if not source.ball and plain:
                found[:, plain] += self._rest(source, [new[i] for i in plain])
            elif source.ball and source in new:
                found[:, new.index(source)] += beyond(source, self._top)
            found = self._everywhere(source, new, found)
            for wall in self.leaning:
                found += wall.change(source, new)
            self._done |= {(source, port): column for port, column in zip(new, found.T, strict=True)}
        return np.stack([self._done[source, port] for port in receivers], axis=1)

    @property
    def _top(self) -> tuple[float, ...]:
        """Wave number along each edge half way between the last mode that is kept and the next."""
        return tuple(np.pi * (n - 0.5) / edge for n, edge in zip(self.counts, self.drawn, strict=True))

    def modal(self, source: Port, receivers: Sequence[Port]) -> Complex:
        """The modes up to the truncation alone, array (lines, receivers): all but the near field, and cheap."""
        return self._everywhere(source, receivers, self.modes.coupling(source, receivers))

    def mode_slopes(
        self, sources: Sequence[tuple[Port, Complex]], receivers: Sequence[Port], modes: NDArray[np.intp]
    ) -> Iterator[tuple[Complex, Complex]]:
        """What relative changes of each mode's frequency and decay rate change of what some sources make.

        Parameters
        ----------
        sources : sequence of (Port, array (lines,))
            With their strengths.
        receivers : sequence of Port
        modes : array of int (n, 3)
            Numbers of the modes along the edges.

        Yields
        ------
        slope : array (receivers, lines)
            With the squared wave number of the mode.
        sizes : array (2,)
            What the two changes make of that.
        """
        found, numbers = self.resonances, modes.T
        sizes = _mode_sizes(self.lengths, self.modes, numbers)
        lacks = self.modes.lacks(numbers) + self.modes.k2[:, None]  # K^2, smooth
        if found is not None:
            lacks = found.few.everywhere(lacks)
        lacks -= self.k2[:, None]
        if self.modes.moved is not None:
            lacks += self.modes.moved[1]
        products = [self.modes.products(port, receivers, numbers) for port, _ in sources]
        for n, size in enumerate(sizes.T):
            slope = np.zeros((len(self.k2), len(receivers)), dtype=complex)
            for (_, strength), product in zip(sources, products, strict=True):
                one = product[..., n] if found is None else found.few.everywhere(product[..., n])
                slope -= strength[:, None] * one
            yield (slope / lacks[:, n, None] ** 2).T, size

    def _everywhere(self, source: Port, receivers: Sequence[Port], found: Complex) -> Complex:
        return found if self.resonances is None else self.resonances.everywhere(source, receivers, found)

    def _rest(self, source: Port, receivers: Sequence[Port]) -> Complex:
        room = (self.drawn, self.counts, self.k2_max, source.axis)
        places = [(port.drawn or port.position, port.radius) for port in (source, *receivers)]
        coefficients = np.array([static_correction(*room, places[0], place) for place in places[1:]])
        near = 0 if source.position[source.axis] < self.lengths[source.axis] / 2 else 1
        some = slice(None) if self.resonances is None else self.resonances.few.chosen
        wall = self.soft[2 * source.axis + near, some]
        return corrections_at(coefficients, self.k2_max, self.modes.k2, wall)


def box(
    frequency: Real,
    lengths: tuple[float, float, float],
    k2: Complex,
    soft: Complex,
    drawn: tuple[float, float, float],
    k_max: float,
    counts: tuple[int, ...],
    modes: NDArray[np.intp] | None = None,
    shift: Real | None = None,
) -> BoxField:
    """A box with `counts` modes along its edges, most of them at few lines where these tell the others.

    Parameters
    ----------
    frequency : array (lines,)
    lengths, k2, soft, drawn, counts
        See `BoxField`, `Modes`.
    k_max : float
        Largest wave number of the band for the drawn room, 1/m.
    modes : array of int (n, 3), optional
        Numbers along the edges of modes that are not where the box has them.
    shift : array (2, n), optional
        Relative changes of their natural frequencies and decay rates.
    """
    k2_max = max(k_max, float(np.sqrt(k2).real.max())) ** 2
    # Beyond these counts no mode resonates below NEAR times k_max; a soft wall may lower one by half an order.
    near = tuple(int(NEAR * k_max * length / np.pi + 0.5) + 1 for length in drawn)
    for few in interpolations(frequency):
        if few.meets(soft.T):
            axes = _axes(lengths, soft[:, few.chosen], counts)
            some = _moved(Modes(axes, k2[few.chosen]), lengths, modes, shift)
            walls = _dimensionless(lengths, soft)
            if all(axes[i].holds(few, near[i], *walls[i]) for i in range(3)):
                poles = resonances(axes, few, k2, near, NEAR * float(np.sqrt(k2_max)), some.moved)
                return BoxField(lengths, some, k2, soft, drawn, k2_max, counts, poles)
    every = _moved(Modes(_axes(lengths, soft, counts), k2), lengths, modes, shift)
    return BoxField(lengths, every, k2, soft, drawn, k2_max, counts)


def with_leans(box: BoxField, slopes: Real) -> BoxField:
    """The box with some of its walls leaning, each by its slope along an edge, array of `LEANS`."""
    acting = np.flatnonzero(slopes)
    if not acting.size:
        return box
    w = []
    for axis, length in zip(box.modes.axes, box.lengths, strict=True):
        some = axis.w[:, : int(np.sqrt(box.k2_max) * length / np.pi) + PLANE_WAVES]
        w.append(some if box.resonances is None else box.resonances.few.everywhere(some))
    walls = [LeaningWall(LEANS[n], float(slopes[n]), box.lengths, box.k2, box.soft, w) for n in acting]
    return replace(box, leaning=tuple(walls), _done={})


def _mode_sizes(lengths: tuple[float, ...], sum_: Modes, numbers: NDArray[np.intp]) -> Complex:
    """What relative changes of frequency and decay rate make of squared wave numbers (2, n), 1/m^2.

    A mode of squared wave number ``K^2 = k_0^2 + j b`` rings where ``k = k_0``, and decays by ``b``.
    """
    rigid = np.sum((np.pi * numbers.T / np.array(lengths)) ** 2, axis=1)
    decay, k = sum_.lacks(numbers).imag, np.sqrt(sum_.k2).real
    at_resonance = [np.interp(np.sqrt(k0), k, part) for k0, part in zip(rigid, decay.T, strict=True)]
    return np.stack([2 * rigid + 0j, 1j * np.array(at_resonance)])


def _moved(sum_: Modes, lengths: tuple[float, ...], modes: Any, shift: Any) -> Modes:
    """The modes with some of them shifted."""
    if modes is None or not np.any(shift):
        return sum_
    return replace(sum_, moved=(modes.T, np.sum(_mode_sizes(lengths, sum_, modes.T) * shift, axis=0)))


def _dimensionless(lengths: tuple[float, ...], soft: Complex) -> Complex:
    """``j k beta L`` of the two walls of every axis, array (3, 2, lines)."""
    return np.asarray(soft.reshape(3, 2, -1) * np.reshape(lengths, (3, 1, 1)))


def _axes(lengths: tuple[float, ...], soft: Complex, counts: Sequence[int]) -> tuple[AxisModes, ...]:
    walls = _dimensionless(lengths, soft)
    return tuple(axis_modes(lengths[i], walls[i, 0], walls[i, 1], counts[i]) for i in range(3))
