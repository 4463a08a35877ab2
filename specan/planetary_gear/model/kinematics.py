"""Orders of a set with a fixed ring, counted per turn of the carrier: arithmetic on tooth numbers; and its lines."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from math import lcm
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.arrays import Real
from specan.models.model import Model
from specan.planetary_gear.model.geometry import mesh_phases, planet_angles
from specan.planetary_gear.model.rig import Gear, Rig

# Uncertainty of the answer to unlike planets about each harmonic, over that of the rig file: against springs of another
# form over the pitch lines were right within a tenth about the first, within a factor 3 about the others.
UNLIKE = (1.0, 2.0, 2.0)
# Passages of the planets from which on a path is as little known as it gets.
FAR = 3


@dataclass(frozen=True, eq=False)
class OrderLines:
    """Order lines of vibration sensors, counted per turn of the carrier.

    Attributes
    ----------
    order : array (lines,)
        Orders that the machine can show.
    harmonic : array of int (lines,)
        Number of the harmonic that each belongs to: what lies between machine and sensor gives the lines of one
        harmonic one unknown gain.
    passages : array of int (lines,)
        How many passages of a planet a turn it lies beside what a single planet's meshes would have there.
    mode : array of int (lines,)
        Kind of the modes that are heard there: 0 all planets move alike, and the central members turn; 1 these move to
        a side; from 2 on the planets move alone (Lin and Parker, J. Vib. Acoust. 121 (1999) 316).
    family : array of str (lines,)
        What each line is called together with those of the other harmonics: ``66h+-3.75 (sun)``.
    sun_turns : float
        Turns of the sun per turn of the carrier.
    torque : float
        On the carrier where a recording does not tell it, N m.
    period : int
        Turns of the carrier after which the machine repeats itself. Which of them a recording begins with,
        nobody knows.
    near, path, response : float
        What the model is declared not to know of its lines, relative standard uncertainties of either component.
        `near` varies smoothly with the order; each recording and sensor has its own. `path` is that of lines three
        passages of the planets or more beside what a machine with one planet has, in proportion nearer by: how a planet
        that passes is heard differs from harmonic to harmonic and from sensor to sensor, and is the same in recordings
        at one speed. `response` is that of lines that the ideal machine does not have, times `UNLIKE`, one a speed: how
        strongly the machine answers to what its equal parts do not do alike is known less well than how it answers to
        the rest; it is common to lines of a harmonic and a kind of mode that lie within a resonance.
    """

    order: Real
    harmonic: NDArray[np.intp]
    passages: NDArray[np.intp]
    mode: NDArray[np.intp]
    family: NDArray[np.str_]
    sun_turns: float
    torque: float
    period: int
    near: float
    path: float
    response: float

    @property
    def far(self) -> Real:
        """How far each line lies beside what one planet has, from 0 to 1: how little is known of its path."""
        return np.minimum(np.abs(self.passages), FAR) / FAR

    @property
    def frame(self) -> Real:
        """Order of the motion that is heard, in the frame of the carrier."""
        return np.round(self.order - self.passages, 6)

    @property
    def unlike(self) -> Real:
        """Uncertainty of the answer to unlike planets, of each line."""
        return self.response * np.array(UNLIKE)[self.harmonic - 1]


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
    return np.abs(np.exp(1j * np.outer(orders, planet_angles(gear))).mean(axis=1))


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


# Of the sun's turns that are looked at: a runout's, and those that tell it, pitch errors and cracks apart.
MULTIPLES = (1, 2, 3, 4, 5, 6)
# Passages beside an order: third powers of a Hann window leave a twentieth at three.
HEARD = (-2, -1, 0, 1, 2)


def kinematic_orders(gear: Gear, harmonics: int = 3, sidebands: int = 3) -> NDArray[np.float64]:
    """Orders about each mesh harmonic at which teeth, runouts and passing planets can show.

    Each harmonic with whole orders to either side, the half order below it, and the turns of sun and planet. A sun that
    is uneven m times a turn presses planet i with the phase -m psi_i, while its mesh has the phase h z_ring psi_i; a
    sensor on the ring hears it at h z_ring +- m turns of the sun + n, for those n at which the planets add up. A planet
    that is uneven is heard once a turn more and less. Left out are whole orders further away that the ideal set shows
    where its path is sharper than assumed.

    Examples
    --------
    >>> article = Gear(z_sun=24, z_planet=21, z_ring=66, module_mm=2.0)
    >>> found = kinematic_orders(article, harmonics=1, sidebands=1)
    >>> found[found >= 66].round(3).tolist()
    [66.0, 66.75, 67.0, 68.143, 68.75, 69.143, 69.75, 70.143, 70.5, 73.5, 74.25, 78.75, 81.75, 82.5]
    """
    sun, planet = float(sun_order(gear)), float(planet_order(gear))
    found = set()
    for h in range(1, harmonics + 1):
        middle = h * gear.z_ring
        uneven = [sign * family for family in (sun, planet - 1.0, planet, planet + 1.0) for sign in (-1, 1)]
        uneven += [sign * m * sun + n for m in MULTIPLES for sign in (-1, 1) for n in HEARD
                   if _any_path_shows(gear, middle - sign * m + n)]  # fmt: skip
        further = {round(middle + offset, 9) for offset in uneven}
        further = {o for o in further if abs(o - middle) < sidebands or not _any_path_shows(gear, o)}
        found |= {float(middle + k) for k in range(-sidebands, sidebands + 1)} | further
        found.add(middle - gear.z_ring / 2)
    return np.array(sorted(found))


def _any_path_shows(gear: Gear, order: float) -> bool:
    """Whether the ideal set has a line there by some path to the sensor: no evidence, where this one gives none."""
    whole = round(order)
    return abs(order - whole) < 1e-9 and bool(mesh_line_strength(gear, np.array([whole]))[0] > 1e-9)


def line_conditions(model: Model, **settings: Any) -> dict[str, NDArray[np.float64]]:
    """Conditions of all kinematic orders at the rig's speed and torque."""
    rig = model.settings["parsed_rig"]
    orders = kinematic_orders(rig.gear, **settings)
    return {
        "order": orders,
        "sun_speed": np.full(orders.size, rig.operation.sun_speed_hz),
        "carrier_torque": np.full(orders.size, rig.operation.carrier_torque_Nm),
    }


def harmonics_of(orders: Any, z_ring: int, most: int) -> NDArray[np.intp]:
    """Number of the mesh harmonic that each order belongs to; half an order below it still does.

    Examples
    --------
    >>> harmonics_of([33.0, 66.0, 99.0, 165.0, 198.0], 66, 3).tolist()
    [1, 1, 2, 3, 3]
    """
    return np.clip(np.floor(np.asarray(orders) / z_ring + 0.5), 1, most).astype(int)


def line_statement(rig: Rig, harmonics: int) -> OrderLines:
    """What a study has to know of the lines: orders, families, speeds and torque."""
    gear = rig.gear
    assert gear is not None
    orders = kinematic_orders(gear, harmonics=harmonics)
    number = harmonics_of(orders, gear.z_ring, harmonics)
    offset = np.round(orders - number * gear.z_ring, 6)
    passages = np.array([_origin(gear, float(o))[1] for o in offset])
    return OrderLines(
        order=orders,
        harmonic=number,
        passages=passages,
        # Of the forces of all planets, n passages let a sensor hear the part that goes with exp(-j n psi_i).
        mode=np.minimum(passages % gear.planets, -passages % gear.planets),
        family=np.array([_family(gear, *at) for at in zip(orders.tolist(), offset.tolist(), strict=True)]),
        sun_turns=1.0 / carrier_speed_ratio(gear),
        torque=rig.operation.carrier_torque_Nm,
        period=repeat_turns(gear),
        near=rig.uncertainty.model_discrepancy_percent / 100,
        path=rig.uncertainty.path_percent / 100,
        response=rig.uncertainty.response_percent / 100,
    )


def _origin(gear: Gear, offset: float) -> tuple[str, int]:
    """What makes a line so far from the mesh, and how many passages of the planets lie between."""
    sun, planet = float(sun_order(gear)), float(planet_order(gear))
    away = {"": offset}
    for sign in (-1, 1):
        away |= {f"planet {sign}": offset - sign * planet}
        away |= {f"sun {sign * m}": offset - sign * m * sun for m in MULTIPLES}
    whole = {name: round(rest) for name, rest in away.items() if abs(rest - round(rest)) < 1e-6}
    if abs(offset) == gear.z_ring / 2 or not whole:
        return "half mesh", FAR  # between the paths of two harmonics
    nearest = min(whole, key=lambda name: abs(whole[name]))
    return nearest.partition(" ")[0], whole[nearest]


def _family(gear: Gear, order: float, offset: float) -> str:
    """``66h``, ``66h+-3``, ``66h+-1 (planets unlike)`` or ``66h+-3.75 (sun)``."""
    part = _origin(gear, offset)[0] or ("" if _any_path_shows(gear, order) else "planets unlike")
    return f"{gear.z_ring}h" + (f"+-{abs(offset):.5g}" if offset else "") + (f" ({part})" if part else "")
