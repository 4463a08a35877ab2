"""Green's function of a box with locally reacting walls: few modes exactly, the rest quasi-statically.

With ``exp(+j w t)`` and ``dp/dn = -j k beta p`` on the walls, the field of a source at ``s`` is

    G(r, s) = sum_N Psi_N(r) Psi_N(s) / (Lambda_N (K_N^2 - k^2)),

where ``Psi_N`` is a product of three axis modes (`specan.models.room.box_field`). The sum is taken at few lines only
(`specan.models.room.frequency_interpolation`), and carried to all others by the poles of the modes that resonate in
the band (`specan.models.room.resonances`); what lies above the truncation is added by
`specan.models.room.static_correction`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from specan.models.room.axis_modes import AxisModes, axis_modes
from specan.models.room.frequency_interpolation import interpolations
from specan.models.room.port import Port, ball_mean, disc_mean, point
from specan.models.room.resonances import Resonances, resonances
from specan.models.room.soft_axis import resonances_across
from specan.models.room.static_correction import StaticCorrection, join, static_correction

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

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
    """

    lengths: tuple[float, float, float]
    modes: Modes
    k2: Complex
    soft: Complex
    drawn: tuple[float, float, float]
    k2_max: float
    counts: tuple[int, ...]
    resonances: Resonances | None = None
    _done: dict[object, Complex] = field(default_factory=dict, repr=False)

    def prepare(self, ports: Sequence[Port]) -> None:
        """Get ready for sources; here each is as cheap alone."""

    def patch(self, wall: str, position: Sequence[float] | Real, radius: float) -> Port:
        """A round patch at a position in a wall."""
        return Port(point(position), "xyz".index(wall[0]), radius)

    def place(self, wall: str, across: float, along: float, radius: float) -> Port:
        """A round patch in parts of a wall's edges."""
        axis = "xyz".index(wall[0])
        parts = [0.0, 0.0, 0.0]
        parts[axis] = float(wall[1])
        for other, part in zip((i for i in range(3) if i != axis), (across, along), strict=True):
            parts[other] = part
        here, drawn = (point(np.multiply(parts, edges)) for edges in (self.lengths, self.drawn))
        return Port(here, axis, radius, drawn=drawn)

    def coupling(self, source: Port, receivers: Sequence[Port]) -> Complex:
        """Mean of G over both ports, array (lines, receivers), 1/m."""
        for port in receivers:  # what no static_correction is added to is reciprocal to the last digit
            if (source.ball or port.ball) and (port, source) in self._done:
                self._done[source, port] = self._done[port, source]
        new = [port for port in dict.fromkeys(receivers) if (source, port) not in self._done]
        if new:
            found = self.modes.coupling(source, new)
            # A ball averages away what lies above the truncation.
            plain = [i for i, port in enumerate(new) if not port.ball]
            if not source.ball and plain:
                found[:, plain] += self._rest(source, [new[i] for i in plain])
            found = self._everywhere(source, new, found)
            self._done |= {(source, port): column for port, column in zip(new, found.T, strict=True)}
        return np.stack([self._done[source, port] for port in receivers], axis=1)

    def modal(self, source: Port, receivers: Sequence[Port]) -> Complex:
        """The modes up to the truncation alone, array (lines, receivers): all but the near field, and cheap."""
        return self._everywhere(source, receivers, self.modes.coupling(source, receivers))

    def _everywhere(self, source: Port, receivers: Sequence[Port], found: Complex) -> Complex:
        return found if self.resonances is None else self.resonances.everywhere(source, receivers, found)

    def _rest(self, source: Port, receivers: Sequence[Port]) -> Complex:
        room = (
            self.drawn,
            self.counts,
            self.k2_max,
            source.drawn or source.position,
            source.axis,
            source.radius,
        )
        places = [(room, *(port.drawn or port.position), port.radius) for port in receivers]
        new = [place for place in dict.fromkeys(places) if place not in _REMAINDERS]
        if len(_REMAINDERS) + len(new) > _KEPT:
            _REMAINDERS.clear()
            new = list(dict.fromkeys(places))
        if new:
            at = np.array([place[1:] for place in new])
            found = static_correction(*room, at[:, :3], at[:, 3])
            _REMAINDERS.update(zip(new, found.split(), strict=True))
        near = 0 if source.position[source.axis] < self.lengths[source.axis] / 2 else 1
        some = slice(None) if self.resonances is None else self.resonances.few.chosen
        return join([_REMAINDERS[p] for p in places]).at(
            self.modes.k2, self.soft[2 * source.axis + near, some]
        )


def box(
    frequency: Real,
    lengths: tuple[float, float, float],
    k2: Complex,
    soft: Complex,
    drawn: tuple[float, float, float],
    k_max: float,
    counts: tuple[int, ...],
) -> BoxField:
    """A box with `counts` modes along its edges, most of them at few lines where these tell the others.

    Parameters
    ----------
    frequency : array (lines,)
    lengths, k2, soft, drawn, counts
        See `BoxField`, `Modes`.
    k_max : float
        Largest wave number of the band for the drawn room, 1/m.
    """
    k2_max = max(k_max, float(np.sqrt(k2).real.max())) ** 2
    near = near_counts(drawn, k_max)
    choices = list(interpolations(frequency))
    for few in choices:
        if few.meets(soft.T):
            axes = _axes(lengths, soft[:, few.chosen], counts)
            walls = _dimensionless(lengths, soft)
            off = [i for i in range(3) if not axes[i].holds(few, near[i], *walls[i])]
            highest, poles = NEAR * float(np.sqrt(k2_max)), None
            if not off:
                poles = resonances(axes, few, k2, near, highest)
            elif (
                len(off) == 1 and few is choices[-1]
            ):  # poles far from the band are hard to find, and matter less then
                poles = resonances_across(axes, few, k2, np.stack(walls[off[0]]), off[0], near, highest)
            if poles is not None:
                return BoxField(lengths, Modes(axes, k2[few.chosen]), k2, soft, drawn, k2_max, counts, poles)
    return BoxField(lengths, Modes(_axes(lengths, soft, counts), k2), k2, soft, drawn, k2_max, counts)


def near_counts(lengths: tuple[float, ...], k_max: float) -> tuple[int, int, int]:
    """Modes along each axis beyond which none resonates below `NEAR` times the largest wave number.

    A soft wall may lower a mode by half an order.
    """
    x, y, z = (int(NEAR * k_max * length / np.pi + 0.5) + 1 for length in lengths)
    return x, y, z


def _dimensionless(lengths: tuple[float, ...], soft: Complex) -> list[tuple[Complex, Complex]]:
    """``j k beta L`` of the two walls of every axis."""
    return [(soft[2 * i] * length, soft[2 * i + 1] * length) for i, length in enumerate(lengths)]


def _axes(
    lengths: tuple[float, ...], soft: Complex, counts: Sequence[int]
) -> tuple[AxisModes, AxisModes, AxisModes]:
    walls = _dimensionless(lengths, soft)
    x, y, z = (axis_modes(lengths[i], *walls[i], counts[i]) for i in range(3))
    return x, y, z


# The static_correction depends on geometry alone; fits ask for the same geometry hundreds of times.
_REMAINDERS: dict[object, StaticCorrection] = {}
_KEPT = 4000


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
    """

    axes: tuple[AxisModes, AxisModes, AxisModes]
    k2: Complex
    _lines: dict[int, _Lines] = field(default_factory=dict, repr=False, compare=False)

    def _parts(self) -> Iterator[tuple[slice, _Lines]]:
        """The modes, a few lines at once; kept for the next port where they take little room."""
        modes = int(np.prod([axis.w.shape[1] for axis in self.axes]))
        step = max(1, _TERMS_AT_ONCE // modes)
        for first in range(0, len(self.k2), step):
            part = slice(first, first + step)
            here = self._lines.get(first) or _Lines.of(self.axes, self.k2, part)
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


_ALONG = (
    (slice(None), slice(None), None, None),
    (slice(None), None, slice(None), None),
    (slice(None), None, None, slice(None)),
)


def _along(axes: Sequence[AxisModes], port: Port) -> list[Complex]:
    """Axis functions, or the derivative along one axis, at a port; ready to be multiplied."""
    return [
        (axis.slope_at if port.slope == i else axis.at)(np.array([port.position[i]]))[..., 0]
        for i, axis in enumerate(axes)
    ]


@dataclass
class _Lines:
    """The modes at some lines."""

    q2: tuple[Complex, Complex, Complex]  # squared wave numbers of the axes, ready to be added
    norm: tuple[Complex, Complex, Complex]
    distance: Complex  # K_N^2 - k^2, array (lines, nx, ny, nz)
    k2: Complex
    _means: dict[tuple[int, float, bool], NDArray] = field(default_factory=dict)

    @classmethod
    def of(cls, axes: Sequence[AxisModes], k2: Complex, part: slice) -> _Lines:
        q = [(axis.w[part] / axis.length**2)[where] for axis, where in zip(axes, _ALONG, strict=True)]
        norm = [axis.norm[part][where] for axis, where in zip(axes, _ALONG, strict=True)]
        own = k2[part][:, None, None, None]
        return cls((q[0], q[1], q[2]), (norm[0], norm[1], norm[2]), (q[0] - own) + q[1] + q[2], own)

    def amplitudes(self, along: Sequence[Complex], source: Port) -> Complex:
        """Psi_N(source) / (Lambda_N (K_N^2 - k^2)), array (lines, nx, ny, nz)."""
        at = [x[where] / norm for x, norm, where in zip(along, self.norm, _ALONG, strict=True)]
        found: Complex = self._product(at, source) / self.distance
        return found

    def port_sum(self, amplitudes: Complex, along: Sequence[Complex], port: Port) -> Complex:
        """Sum of the modes over a patch, a ball, or of a derivative, array (lines,)."""
        found: Complex = np.einsum(
            "fxyz,fxyz->f",
            amplitudes,
            np.broadcast_to(
                self._product([x[w] for x, w in zip(along, _ALONG, strict=True)], port), amplitudes.shape
            ),
        )
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
        key = (port.axis, port.radius, port.ball)
        if key not in self._means:
            if port.ball:
                self._means[key] = ball_mean(self.distance + self.k2, port.radius)
            else:
                i, j = (axis for axis in range(3) if axis != port.axis)
                self._means[key] = disc_mean(self.q2[i] + self.q2[j], port.radius)
        return self._means[key]
