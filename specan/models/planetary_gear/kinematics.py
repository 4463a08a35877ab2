"""Orders of a set with a fixed ring, counted per turn of the carrier: arithmetic on tooth numbers."""

from __future__ import annotations

from fractions import Fraction
from math import lcm

import numpy as np
from numpy.typing import NDArray

from specan.models.planetary_gear.geometry import mesh_phases
from specan.models.planetary_gear.rig import Gear


def sun_order(gear: Gear) -> Fraction:
    """Turns of the sun against the carrier.

    Examples
    --------
    >>> sun_order(Gear(z_sun=24, z_planet=21, z_ring=66, module_mm=2.0))
    Fraction(11, 4)
    """
    return Fraction(gear.z_ring, gear.z_sun)


def planet_order(gear: Gear) -> Fraction:
    """Turns of a planet against the carrier."""
    return Fraction(gear.z_ring, gear.z_planet)


def repeat_turns(gear: Gear) -> int:
    """Turns of the carrier after which all teeth meet again as they did.

    Examples
    --------
    >>> repeat_turns(Gear(z_sun=24, z_planet=21, z_ring=66, module_mm=2.0))
    28
    """
    return lcm(sun_order(gear).denominator, planet_order(gear).denominator)


def carrier_speed_ratio(gear: Gear) -> float:
    """Speed of the carrier over that of the sun: z_sun / (z_sun + z_ring)."""
    return gear.z_sun / (gear.z_sun + gear.z_ring)


def mesh_line_strength(gear: Gear, orders: NDArray[np.int64]) -> NDArray[np.float64]:
    """How far the planets' contributions to a sensor on the ring add up at integer orders, from 0 to 1.

    A planet passes the sensor once a turn, so its mesh harmonic h appears with all sidebands, at whole orders n; the
    contribution of the planet at psi_i with the mesh phase gamma_i has the phase 2 pi h gamma_i + (n - h z_ring) psi_i.
    With gamma_i = z_ring psi_i / 2 pi that is n psi_i for every h: the lines are those n for which exp(j n psi_i)
    adds up over the planets (Inalpolat and Kahraman, J. Sound Vib. 323 (2009) 677, all five cases).

    Examples
    --------
    >>> article = Gear(z_sun=24, z_planet=21, z_ring=66, module_mm=2.0)
    >>> mesh_line_strength(article, np.arange(63, 70)).round(6).tolist()
    [1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]
    """
    from specan.models.planetary_gear.geometry import planet_angles

    places = planet_angles(gear)
    return np.abs(np.exp(1j * np.outer(orders, places)).mean(axis=1))


def kind_of_phasing(gear: Gear) -> str:
    """In phase, sequentially phased, counter-phased, or unequally spaced.

    Parker, A physical explanation for the effectiveness of planet phasing, J. Sound Vib. 236 (2000) 561.

    Examples
    --------
    >>> kind_of_phasing(Gear(z_sun=24, z_planet=21, z_ring=66, module_mm=2.0))
    'in phase'
    """
    if gear.planet_angles_deg is not None:
        steps = np.diff(np.sort(np.asarray(gear.planet_angles_deg) % 360))
        if not np.allclose(steps, 360.0 / gear.planets):
            return "unequally spaced"
    phases = mesh_phases(gear)[1]
    apart = (phases - phases[0]) % 1.0
    if np.allclose(np.minimum(apart, 1 - apart), 0.0):
        return "in phase"
    if gear.planets % 2 == 0 and np.allclose(np.abs((2 * apart + 0.5) % 1.0 - 0.5), 0.0):
        return "counter-phased"
    return "sequentially phased"
