"""The rig file of a planetary gear or of a gear pair."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import Field

from specan.errors import RequestError
from specan.schema import Settings, parse

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Teeth = Annotated[int, Field(ge=6)]


class Gear(Settings):
    """Teeth and arrangement of a planetary set; the sun drives, the carrier is loaded."""

    z_sun: Teeth
    z_planet: Teeth
    z_ring: Teeth
    planets: Annotated[int, Field(ge=1, le=12)] = 3
    module_mm: Positive
    pressure_angle_deg: Annotated[float, Field(gt=5, lt=40)] = 20.0
    centre_distance_mm: Positive | None = None
    planet_angles_deg: tuple[float, ...] | None = None
    face_width_mm: Positive = 20.0
    fixed: Literal["ring"] = "ring"
    contact_ratio_sun_planet: Annotated[float, Field(ge=1, lt=3)] | None = None
    contact_ratio_ring_planet: Annotated[float, Field(ge=1, lt=3)] | None = None
    backlash_mm: NotNegative = 0.1

    @property
    def pin_distance_m(self) -> float:
        """From the carrier's axis to a planet's."""
        return 1e-3 * (self.centre_distance_mm or self.module_mm * (self.z_sun + self.z_planet) / 2)

    @property
    def base_radii_m(self) -> tuple[float, float, float]:
        """Of sun, planet and ring."""
        per_tooth = 1e-3 * self.module_mm * math.cos(math.radians(self.pressure_angle_deg)) / 2
        return per_tooth * self.z_sun, per_tooth * self.z_planet, per_tooth * self.z_ring


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


class Contact(Settings):
    """The contact law of the article: F = K x^e + C S(x / d) dx/dt, S a cubic step."""

    law: Literal["Impact"] = "Impact"
    K_N_mm_e: Positive = 300000.0
    exponent: Annotated[float, Field(ge=1, le=3)] = 1.3
    C_Ns_mm: NotNegative = 3000.0
    depth_mm: Positive = 0.3


class Operation(Settings):
    """Speed and torque, where a recording does not say."""

    sun_speed_hz: Positive = 30.0
    carrier_torque_Nm: Positive = 60.0


class Sensors(Settings):
    """Where acceleration is measured on the ring's housing, and what the instruments give."""

    acc_angle_deg: Annotated[tuple[float, ...], Field(min_length=1)] = (90.0, 0.0)
    acc_direction: str = "radial, tilted 20 deg towards increasing angle"
    acc_mV_per_m_s2: Positive = 10.0
    force_N_per_V: Positive = 200.0
    torque_Nm_per_V: Positive = 20.0
    displacement_mm_per_V: Positive = 10.0
    tacho_sun_pulses: Annotated[int, Field(ge=1)] = 32
    tacho_carrier_pulses: Annotated[int, Field(ge=1)] = 1


class Rotors(Settings):
    """Inertias that are known, as they turn with the carrier or about a planet's pin; steel discs otherwise."""

    carrier_kg_m2: Positive | None = None  # with the planets on it
    load_kg_m2: NotNegative = 0.0  # shaft, coupling and brake behind the carrier
    planet_kg_m2: Positive | None = None


class Uncertainty(Settings):
    """Standard uncertainties of what a model predicts of lines, relative; see `specan.planetary_gear.model.kinematics`.

    The response holds what is known of stiffness, inertia and damping: ISO 6336-1:2019, clause 9, gives 14 to
    20 N/(mm um) for the stiffness of a mesh; at low load and with bodies it is half of that. Damping ratios of meshes
    are 0.01 to 0.1 (Kahraman and Singh, J. Sound Vib. 142 (1990) 49).
    """

    model_discrepancy_percent: NotNegative = 10.0
    path_percent: NotNegative = 100.0
    response_percent: NotNegative = 50.0


class Rig(Settings):
    """A rig file with either [gear] or [pair]."""

    gear: Gear | None = None
    pair: Pair | None = None
    contact: Contact = Contact()
    operation: Operation = Operation()
    sensors: Sensors = Sensors()
    rotors: Rotors = Rotors()
    uncertainty: Uncertainty = Uncertainty()


def read_rig(content: Mapping[str, Any]) -> Rig:
    """Check the parsed rig file: keys and values; `build` checks that the teeth assemble.

    Raises
    ------
    RequestError
        Unknown or missing key, impossible value.
    """
    rig = parse(Rig, content, "the rig file")
    if (rig.gear is None) == (rig.pair is None):
        raise RequestError(
            "the rig file has " + ("both [gear] and [pair]" if rig.gear else "neither [gear] nor [pair]"),
            expected="one of them",
        )
    return rig


EXAMPLE_RIG = {
    "gear": {"z_sun": 24, "z_planet": 21, "z_ring": 66, "planets": 3, "module_mm": 2.0},
    "operation": {"sun_speed_hz": 30.0, "carrier_torque_Nm": 60.0},
}
