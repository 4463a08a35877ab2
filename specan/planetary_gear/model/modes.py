"""Natural frequencies and modes of a planetary gear, whose parts may shift as well as turn or turn only."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specan.models.model import Model

Real = NDArray[np.float64]

_SMALL = 1e-6  # relative motion below which a part stands still in a mode


@dataclass(frozen=True)
class Part:
    """Carrier, ring, sun or planet: masses and bearing stiffnesses in the plane.

    Attributes
    ----------
    mass : float
        kg.
    inertia : float
        Inertia over the squared base radius (carrier: of the circle of the planets' centres), kg.
    bearing : float
        Stiffness of its bearing in every direction, N/m; of a planet, that of its pin.
    torsion : float
        Stiffness against turning over the squared radius, N/m.
    """

    mass: float
    inertia: float
    bearing: float
    torsion: float = 0.0


@dataclass(frozen=True)
class Modes:
    """Natural frequencies in Hz, rising, and the kind of each mode: rotational, translational or planet."""

    frequency_hz: Real
    kind: tuple[str, ...]
    shape: Real


def natural_modes(
    parts: Mapping[str, Part], planet_angle: Real, pressure_angle: float, sun_mesh: float, ring_mesh: float
) -> Modes:
    """Undamped modes of the linear model with 3 (planets + 3) degrees of freedom, at rest.

    J. Lin and R. G. Parker, Analytical characterization of the unique properties of planetary gear free vibration,
    J. Vib. Acoust. 121 (1999) 316, equations 1 to 11: every part has two displacements and a rotation (as arc length
    on its base circle), every mesh and pin is a spring.

    Parameters
    ----------
    parts : mapping
        ``carrier``, ``ring``, ``sun``, ``planet``.
    planet_angle : array
        rad.
    pressure_angle : float
        rad, of both meshes.
    sun_mesh, ring_mesh : float
        Mesh stiffnesses, N/m.
    """
    n = planet_angle.size
    size = 9 + 3 * n
    masses = [m for name in ("carrier", "ring", "sun") for m in _masses(parts[name])]
    masses += _masses(parts["planet"]) * n
    stiffness = np.zeros((size, size))
    for k, name in enumerate(("carrier", "ring", "sun")):
        part = parts[name]
        stiffness[[3 * k, 3 * k + 1], [3 * k, 3 * k + 1]] += part.bearing
        stiffness[3 * k + 2, 3 * k + 2] += part.torsion
    cos, sin = np.cos(pressure_angle), np.sin(pressure_angle)
    for i, place in enumerate(planet_angle):
        own = 9 + 3 * i
        before, after = place - pressure_angle, place + pressure_angle
        springs = [
            (
                sun_mesh,
                {6: -np.sin(before), 7: np.cos(before), 8: 1.0, own: -sin, own + 1: -cos, own + 2: 1.0},
            ),
            (
                ring_mesh,
                {3: -np.sin(after), 4: np.cos(after), 5: 1.0, own: sin, own + 1: -cos, own + 2: -1.0},
            ),
            (parts["planet"].bearing, {0: np.cos(place), 1: np.sin(place), own: -1.0}),
            (parts["planet"].bearing, {0: -np.sin(place), 1: np.cos(place), 2: 1.0, own + 1: -1.0}),
        ]
        for spring, stretch in springs:
            row = np.zeros(size)
            row[list(stretch)] = list(stretch.values())
            stiffness += spring * np.outer(row, row)
    root = np.sqrt(np.array(masses))
    squares, vectors = np.linalg.eigh(stiffness / np.outer(root, root))
    shape = vectors / root[:, None]
    return Modes(
        np.sqrt(np.maximum(squares, 0.0)) / (2 * np.pi), tuple(_kind(shape[:, k]) for k in range(size)), shape
    )


def torsional_frequencies(model: Model) -> Real:
    """Natural frequencies, Hz, of the set as it is fitted: parts turn only, the sun turns steadily, the ring is fixed.

    Meshes have their mean stiffness at the rig file's speed and torque. Planets that move alike take the carrier with
    them (two modes); against each other they leave it where it is (as many modes as planets less one).

    Parameters
    ----------
    model : Model
        Of a planetary set, as `build` makes it.
    """
    operation = model.settings["parsed_rig"].operation
    at = {"order": np.ones(1), "sun_speed": np.full(1, operation.sun_speed_hz),
          "carrier_torque": np.full(1, operation.carrier_torque_Nm)}  # fmt: skip
    wanted = ["mesh_stiffness", "carrier_inertia", "planet_inertia", "base_radii"]
    found = model.assemble(model.base_effects).evaluate(at, None, wanted)
    stiffness, (sun, planet, ring) = found["mesh_stiffness"][0].mean(axis=-1), found["base_radii"]
    planets = found["mesh_stiffness"].shape[-1]
    # Approach of the sun and of the ring mesh by a turn of the carrier and of a planet.
    geometry = np.array([[sun + planet, planet], [ring - planet, -planet]])
    one = geometry.T @ (stiffness[:, None] * geometry)  # of one planet with its part of the carrier
    together = one / np.array([found["carrier_inertia"] / planets, found["planet_inertia"]])[:, None]
    squares = [*np.linalg.eigvals(together).real, *[one[1, 1] / found["planet_inertia"]] * (planets - 1)]
    return np.sort(np.sqrt(np.maximum(squares, 0.0)) / (2 * np.pi))


def _masses(part: Part) -> list[float]:
    return [part.mass, part.mass, part.inertia]


def _kind(shape: Real) -> str:
    """By what the central parts do: turn alone, shift alone, or stand still."""
    central = np.abs(shape[:9])
    top = np.abs(shape).max()
    turns, shifts = central[2::3].max(), max(central[0::3].max(), central[1::3].max())
    if max(turns, shifts) < _SMALL * top:
        return "planet"
    if shifts < _SMALL * turns:
        return "rotational"
    return "translational" if turns < _SMALL * shifts else "mixed"
