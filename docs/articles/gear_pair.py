"""The gear pair of the article's preliminary study, integrated as a planetary set of one planet on a fixed axis."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from specan.planetary_gear.model.dynamics import (
    System,
    depth_under,
    numbers_of_law,
    numbers_of_mesh,
    step_of,
)
from specan.planetary_gear.model.geometry import Mesh, disc, external_mesh
from specan.planetary_gear.model.rig import Contact, NotNegative, Positive, Teeth
from specan.schema import Settings, parse


class Pair(Settings):
    """Two gears on fixed shafts: the driver at constant speed, a torque on the driven one."""

    z_driver: Teeth
    z_driven: Teeth
    module_mm: Positive
    pressure_angle_deg: Annotated[float, Field(gt=5, lt=40)] = 20.0
    face_width_mm: Positive = 20.0
    contact_ratio: Annotated[float, Field(ge=1, lt=3)] | None = None
    driver_speed_hz: Positive
    driver_torque_Nm: Positive
    backlash_mm: NotNegative = 0.1


class PairRig(Settings):
    """A rig file of a pair."""

    pair: Pair
    contact: Contact = Contact()


def read_pair(content: Mapping[str, Any]) -> PairRig:
    """Check the parsed rig file of a pair."""
    return parse(PairRig, content, "the rig file")


def pair_mesh(pair: Pair) -> Mesh:
    """The mesh of a gear pair."""
    angle = math.radians(pair.pressure_angle_deg)
    mesh = external_mesh(pair.z_driver, pair.z_driven, 1e-3 * pair.module_mm, angle)
    return mesh if pair.contact_ratio is None else replace(mesh, contact_ratio=pair.contact_ratio)


def system_of_pair(rig: PairRig) -> System:
    """A pair is a set whose "carrier" is the driven gear: x = -rb2 angle, and no planet that turns."""
    pair, contact, mesh = rig.pair, rig.contact, pair_mesh(rig.pair)
    cos = math.cos(math.radians(pair.pressure_angle_deg))
    module = 1e-3 * pair.module_mm
    rb1, rb2 = module * pair.z_driver * cos / 2, module * pair.z_driven * cos / 2
    inertia = disc(pair.z_driven * module, 1e-3 * pair.face_width_mm)[1]
    ratio = pair.z_driver / pair.z_driven
    load = pair.driver_torque_Nm / ratio
    sizes = np.array([rb2, 0.0, 0.0, inertia, 1.0, pair.z_driver * pair.driver_speed_hz])
    depth = depth_under(load / rb2, contact)
    law, none = numbers_of_law(contact, pair.backlash_mm), np.array([1.0, 1.0, 0.0, 0.0])
    speed = 2 * np.pi * pair.driver_speed_hz
    # Power goes in at the driver: torque there is force times rb1, that of the "sun" force times rb2.
    return System(
        (1, sizes, law, numbers_of_mesh(mesh), none, np.array([[0.0], [0.5]]), load), speed * ratio, speed,
        rb1 / rb2, step_of(contact, depth, inertia / rb2**2), np.array([-1e-3 * depth / rb2, 0.0, 0.0, 0.0]), rig,
    )  # fmt: skip
