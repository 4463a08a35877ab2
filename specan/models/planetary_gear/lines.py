"""Which order lines a set can show, and the conditions under which the model gives them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.models.measurement_kinds import OrderLines, Stated, Tacho
from specan.models.model import Model
from specan.models.planetary_gear.kinematics import (
    carrier_speed_ratio,
    mesh_line_strength,
    planet_order,
    repeat_turns,
    sun_order,
)
from specan.models.planetary_gear.rig import Gear, Rig

# Part of the uncertainty of the answer to unlike planets that differs between recordings; the whole is common to all.
OF_A_RECORDING = 0.5


def kinematic_orders(gear: Gear, harmonics: int = 3, sidebands: int = 3) -> NDArray[np.float64]:
    """Orders about each mesh harmonic at which teeth, runouts and passing planets can show.

    Each harmonic with whole orders to either side, the half order below it, and the turns of sun and planet. A sun that
    is uneven presses the planets one after the other: to a sensor on the ring it turns as often as its shaft, less or
    more whole passages of the planets. A planet that is uneven is heard once a turn more and less. Left out are whole
    orders further away that the ideal set shows where its path is sharper than assumed.

    Examples
    --------
    >>> article = Gear(z_sun=24, z_planet=21, z_ring=66, module_mm=2.0)
    >>> found = kinematic_orders(article, harmonics=1, sidebands=1)
    >>> found[found >= 66].round(3).tolist()
    [66.0, 66.75, 67.0, 68.143, 68.75, 69.143, 69.75, 70.143, 70.5, 73.5]
    """
    drive, planet = float(sun_order(gear)) + 1.0, float(planet_order(gear))
    families = [float(sun_order(gear)), planet - 1.0, planet, planet + 1.0]
    families += [offset for m in (1, 2) for offset in (m * drive, abs(m * drive - gear.planets))]
    found = set()
    for h in range(1, harmonics + 1):
        middle = h * gear.z_ring
        further = {round(middle + sign * family, 9) for family in families for sign in (-1, 1)}
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


def line_statement(rig: Rig, harmonics: int) -> OrderLines:
    """What a study has to know of the lines: orders, families, tachos, and where a recording tells the torque."""
    gear = rig.gear
    assert gear is not None
    orders = kinematic_orders(gear, harmonics=harmonics)
    number = np.clip(np.rint(orders / gear.z_ring), 1, harmonics).astype(int)
    offset = np.round(orders - number * gear.z_ring, 6)
    return OrderLines(
        axis="sensor",
        order=orders,
        harmonic=number,
        offset=offset,
        family=tuple(_family(gear.z_ring, abs(float(o))) for o in offset),
        order_condition="order",
        rate_condition="sun_speed",
        rate_ratio=1.0 / carrier_speed_ratio(gear),
        tachos=(Tacho("Tacho sun", 1.0 / carrier_speed_ratio(gear)), Tacho("Tacho carrier", 1.0)),
        index="Tacho carrier",
        period=repeat_turns(gear),
        stated={"carrier_torque": Stated("Torque", "Torque carrier", rig.operation.carrier_torque_Nm)},
        discrepancy=rig.uncertainty.model_discrepancy_percent / 100,
        path=rig.uncertainty.path_percent / 100,
        response=OF_A_RECORDING * rig.uncertainty.response_percent / 100,
    )


def _family(mesh: int, offset: float) -> str:
    """``66h`` or ``66h+-3.75``."""
    return f"{mesh}h+-{offset:.5g}" if offset else f"{mesh}h"
