"""What is known of a room's walls before anything is recorded: measured impedances, absorption coefficients."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from specan.arrays import Complex, Real
from specan.errors import RequestError
from specan.models.quantity import quantity
from specan.room.model.rig_tables import numbers, read_rows
from specan.schema import Settings

_THIN = 1e-4  # of an imaginary part, below which its share is taken at zero
Number = Annotated[float, Field(gt=0)]
REACH = 2 ** (1 / 6)  # of a band's middle: a third octave stands for its whole width
MODERATE_C = 343.0  # m/s, speed of sound by which a depth counts
SOFTEST = 1e3  # conductance beyond which an absorption coefficient is not looked for


def normal_absorption(beta: ArrayLike) -> Real:
    """Absorption coefficient at normal incidence, ``1 - |r|^2`` with ``r = (1 - beta)/(1 + beta)`` (ISO 10534-2).

    Examples
    --------
    >>> normal_absorption([1.0, 0.1, 0.1j]).round(3).tolist()
    [1.0, 0.331, 0.0]
    """
    beta = np.asarray(beta, dtype=complex)
    found: Real = 4 * beta.real / np.abs(1 + beta) ** 2
    return found


def diffuse_absorption(beta: ArrayLike) -> Real:
    r"""Absorption coefficient in a diffuse field, the mean over all angles of incidence (Paris).

    .. math:: \alpha = 2 \int_0^1 \frac{4 \mu \, \mathrm{Re} \beta}{|\mu + \beta|^2} \mu \, \mathrm{d}\mu
       = 8 g \left[1 - g \ln\frac{(1+g)^2 + b^2}{g^2 + b^2}
       + \frac{g^2 - b^2}{b} \left(\arctan\frac{1+g}{b} - \arctan\frac{g}{b}\right)\right],

    with beta = g + j b and mu the cosine of the angle (Kuttruff, Room Acoustics, ch. 2, the uniformly
    random incidence of a locally reacting wall; Paris, Philos. Mag. 5, 1928). At most 0.95, for a real
    admittance of 0.64.

    Examples
    --------
    >>> diffuse_absorption([0.64, 0.01]).round(3).tolist()
    [0.951, 0.073]
    """
    beta = np.asarray(beta, dtype=complex)
    g, b = beta.real, np.abs(beta.imag)
    thin = b < _THIN * np.maximum(g, 1e-12)
    safe = np.where(thin, 1.0, b)
    turned = np.arctan((1 + g) / safe) - np.arctan(g / safe)
    with np.errstate(all="ignore"):
        sideways = np.where(thin, g / (1 + g), (g**2 - b**2) / safe * turned)
        log = np.log(((1 + g) ** 2 + b**2) / (g**2 + b**2))
        found = 8 * g * (1 - g * log + sideways)
    return np.where(g == 0, 0.0, found)


LAWS = {"absorption_normal": normal_absorption, "absorption_diffuse": diffuse_absorption}
COLUMNS = ("frequency_hz", "z_re", "z_im", "u_z", *LAWS, "u_absorption")


class KnownWall(Settings):
    """A wall of ``[walls]``: its impedance over rho c, or an absorption coefficient, over frequency."""

    file: str | None = None
    frequency_hz: tuple[Number, ...] = ()
    z_re: tuple[float, ...] = ()
    z_im: tuple[float, ...] = ()
    u_z: Number | tuple[Number, ...] | None = None
    absorption_normal: tuple[float, ...] = ()
    absorption_diffuse: tuple[float, ...] = ()
    u_absorption: Number | tuple[Number, ...] | None = None
    depth_m: Annotated[float, Field(ge=0)] | None = None


@dataclass(frozen=True, eq=False)
class WallTable:
    """Specific admittance rho c / Z of a wall over frequency.

    Attributes
    ----------
    frequency_hz : array (n,)
    admittance : complex array (n,)
    deviation : complex array (n,)
        Standard uncertainty of the real and of the imaginary part.
    """

    frequency_hz: Real
    admittance: Complex
    deviation: Complex

    def at(self, frequency_hz: Real) -> tuple[Complex, Complex]:
        """Admittance and deviation, straight over the logarithm of frequency between the table's lines."""
        place, known = np.log(frequency_hz), np.log(self.frequency_hz)
        return np.interp(place, known, self.admittance), np.interp(place, known, self.deviation)


def wall_table(wall: str, given: KnownWall, band_hz: tuple[float, float]) -> WallTable:
    """The admittance that a rig file states of a wall.

    Parameters
    ----------
    wall : str
    given : KnownWall
    band_hz : tuple of float
        Which the table has to cover.

    Raises
    ------
    RequestError
        Nothing or two things are stated, without uncertainty, of another length, of a wall that gives energy, or not
        for the whole band.
    InputError
        The file cannot be read, or holds something else.
    """
    where = f"[walls.{wall}]"
    if given.file is not None:
        path = Path(given.file)
        wanted = f"frequency_hz, and of {', '.join(COLUMNS[1:])} those that are known"
        names, rows = read_rows(path, "frequency_hz", wanted)
        columns = {name: tuple(numbers(path, rows, name).tolist()) for name in COLUMNS if name in names}
        given = given.model_copy(update=columns)
        where = f"{Path(given.file or '').name} of wall {wall}"
    stated = [name for name in ("z_re", *LAWS) if getattr(given, name)]
    if len(stated) != 1:
        raise RequestError(
            f"{where} states {' and '.join(stated) or 'neither an impedance nor an absorption coefficient'}",
            expected="z_re and z_im, or absorption_normal, or absorption_diffuse",
        )
    frequency = np.array(given.frequency_hz, dtype=float)
    if frequency.size < 2 or np.any(np.diff(frequency) <= 0):
        raise RequestError(
            f"{where} has the frequencies {list(given.frequency_hz)[:6]}",
            expected="frequency_hz, at least two, the lowest first",
        )
    low, high = frequency[0] / REACH, frequency[-1] * REACH
    if low > band_hz[0] or high < band_hz[1]:
        raise RequestError(
            f"{where} goes from {frequency[0]:g} to {frequency[-1]:g} Hz, the band from {band_hz[0]:g} to "
            f"{band_hz[1]:g} Hz",
            expected="a table that covers the band",
            remedy="add lines, estimated and with a large uncertainty where nothing was measured, or narrow [band]",
        )
    if stated == ["z_re"]:
        return _of_impedance(where, frequency, given)
    return _of_absorption(where, frequency, given, stated[0])


def _of_impedance(where: str, frequency: Real, given: KnownWall) -> WallTable:
    z = _values(where, "z_re", given.z_re, frequency) + 1j * _values(where, "z_im", given.z_im, frequency)
    if np.any(z.real <= 0):
        first = int(np.argmax(z.real <= 0))
        raise RequestError(
            f"{where} says z_re = {z.real[first]:g} at {frequency[first]:g} Hz: such a wall would emit energy",
            expected="a real part above zero, with exp(+j w t) (a mass has a positive z_im)",
        )
    spread = _values(where, "u_z", given.u_z, frequency) / np.abs(z) ** 2  # of 1 / Z
    admittance = np.reciprocal(z.astype(complex))
    return WallTable(frequency, admittance, spread * (1 + 1j))


def _of_absorption(where: str, frequency: Real, given: KnownWall, name: str) -> WallTable:
    r"""Conductance by a coefficient; what it does not tell, the reactance, by the depth of the covering.

    At low frequencies the air in an absorber of depth d is a spring, Im beta = k d; a rigid filling leaves none of it.
    Half of that, with the same uncertainty, holds both.
    """
    alpha = _values(where, name, getattr(given, name), frequency)
    if np.any((alpha <= 0) | (alpha >= 1)):
        raise RequestError(
            f"{where} says {name} = {alpha[(alpha <= 0) | (alpha >= 1)][0]:g}",
            expected="coefficients above 0 and below 1, not percent",
        )
    if given.depth_m is None:
        raise RequestError(
            f"{where}: an absorption coefficient does not determine how a wall shifts the modes",
            expected="depth_m, the thickness of the covering with the air behind it; 0 for a hard surface",
        )
    spring = np.minimum(2 * np.pi * frequency / MODERATE_C * given.depth_m, 1.0) / 2
    u = _values(where, "u_absorption", given.u_absorption, frequency)
    low, mean, high = (_conductances(name, np.clip(alpha + s * u, 1e-4, 1.0), spring) for s in (-1, 0, 1))
    conductance = np.maximum((high - low) / 2, 1e-6)
    return WallTable(frequency, mean + 1j * spring, conductance + 1j * np.hypot(spring, conductance))


def _conductances(name: str, alpha: Real, susceptance: Real) -> Real:
    """Smaller of the two conductances that have a coefficient; of one above all, that of the softest wall."""
    grid = np.geomspace(1e-6, SOFTEST, 4000)
    found = []
    for a, b in zip(alpha, susceptance, strict=True):
        values = LAWS[name](grid + 1j * b)
        rising = slice(0, int(np.argmax(values)) + 1)
        found.append(np.interp(a, values[rising], grid[rising]))
    return np.array(found)


def _values(where: str, name: str, given: float | Sequence[float] | None, frequency: Real) -> Real:
    if given is None or np.size(given) == 0:
        raise RequestError(f"{where} lacks {name}", expected="one value per frequency")
    values = np.atleast_1d(np.asarray(given, dtype=float))
    if values.size not in (frequency.size, 1 if name.startswith("u_") else frequency.size):
        raise RequestError(
            f"{where} has {values.size} values of {name} for {frequency.size} frequencies",
            expected="one value per frequency",
        )
    return np.broadcast_to(values, frequency.shape)


def tied(walls: Sequence[str], together: Sequence[Sequence[str]]) -> dict[str, tuple[str, ...]]:
    """Walls that share an admittance, by the name that they have together: ``{"x0": ("x0",), "z0+z1": ("z0", "z1")}``.

    Raises
    ------
    RequestError
        A wall that is not one, in two groups, or alone.

    Examples
    --------
    >>> list(tied(["x0", "z0", "z1"], [["z1", "z0"]]))
    ['x0', 'z0+z1']
    """
    named = [wall for group in together for wall in group]
    for wall in named:
        if wall not in walls:
            raise RequestError(
                f"[room] tied_walls names {wall!r}", expected=f"walls of the room: {', '.join(walls)}"
            )
        if named.count(wall) > 1:
            raise RequestError(
                f"[room] tied_walls names {wall!r} twice", expected="each wall in one group at most"
            )
    if any(len(group) < 2 for group in together):
        raise RequestError(
            "[room] tied_walls has a group of one wall", expected="two walls or more per group"
        )
    group_of = {wall: tuple(w for w in walls if w in group) for group in together for wall in group}
    return {"+".join(group): group for group in (group_of.get(wall, (wall,)) for wall in walls)}


def known_tables(
    given: Mapping[str, KnownWall], groups: Mapping[str, Sequence[str]], band_hz: tuple[float, float]
) -> dict[str, WallTable]:
    """Tables of the walls of which something is known, by the names that tied walls have together.

    Raises
    ------
    RequestError
        A wall that is not one, or two tables of tied walls; see `wall_table`.
    """
    name_of = {wall: name for name, group in groups.items() for wall in group}
    found: dict[str, WallTable] = {}
    for wall, said in given.items():
        if wall not in name_of:
            raise RequestError(
                f"[walls.{wall}] is about no wall of the room", expected=f"one of {', '.join(name_of)}"
            )
        if name_of[wall] in found:
            raise RequestError(
                f"[walls.{wall}] is the second table of the tied walls {name_of[wall]}", expected="one"
            )
        found[name_of[wall]] = wall_table(wall, said, band_hz)
    return found


@quantity(unit="1", axes=("known_wall",))
def wall_data_error(frequency, wall_tables):
    """Error of what is stated of walls, in standard uncertainties, array (known walls, lines)."""
    return np.zeros((len(wall_tables), len(frequency)), dtype=complex)


@quantity(unit="1", axes=("known_wall",))
def known_admittance(frequency, wall_tables, wall_data_error):
    """Specific admittance of the walls of which something is stated, array (known walls, lines)."""
    found = wall_data_error.copy()
    for row, table in zip(found, wall_tables, strict=True):
        admittance, deviation = table.at(frequency)
        row[:] = admittance + deviation.real * row.real + 1j * deviation.imag * row.imag
    return found
