"""From a rig file to the model of a planetary gear, or of a gear pair."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.fft import next_fast_len

from specan.errors import RequestError
from specan.models.catalogue import effects_in
from specan.models.model import Model
from specan.models.quantity import Condition, Observable, Quantity, constant, quantities_in
from specan.planetary_gear.model import excitation, load, response
from specan.planetary_gear.model.geometry import (
    check_assembly,
    inertias,
    mesh_phases,
    planet_angles,
    set_meshes,
)
from specan.planetary_gear.model.kinematics import (
    carrier_speed_ratio,
    kind_of_phasing,
    line_statement,
    planet_order,
    repeat_turns,
    sun_order,
)
from specan.planetary_gear.model.rig import Gear, Rig, read_rig
from specan.planetary_gear.model.simulated_recording import path_window

HARMONICS = 3  # of the mesh: what a study compares
MOST_SAMPLES = 1_000_000  # of all turns: some 200 MB of courses over them


def build(rig: Mapping[str, Any]) -> Model:
    """Build the order-domain model of a planetary set.

    Raises
    ------
    RequestError
        The rig file has an unknown key, lacks one, or its teeth do not assemble.
    """
    settings = read_rig(rig)
    if settings.gear is None:
        return _pair(settings)
    gear = settings.gear
    check_assembly(gear)
    quantities = [*_constants(settings, gear), *quantities_in(load, excitation, response)]
    return Model(
        name="planetary-gear",
        title=f"Order lines of a planetary gear {gear.z_sun}/{gear.z_ring}/{gear.z_planet}, "
        f"{gear.planets} planets, {kind_of_phasing(gear)}",
        conditions={
            "order": Condition("order", "1", "Order of each line, per turn of the carrier.", "order", "1"),
            "sun_speed": Condition("sun_speed", "Hz", "Speed of the sun's shaft.", "sun_speed_hz", "Hz"),
            "carrier_torque": Condition(
                "carrier_torque", "N*m", "Torque on the carrier.", "carrier_torque_Nm", "N*m"
            ),
        },
        quantities={q.name: q for q in quantities},
        effects=effects_in("specan.planetary_gear.model.effects"),
        observables={
            "lines": Observable("lines", "order_lines", "m/s^2", "Complex order lines of the ring's acceleration.",
                                kind="orders")
        },
        for_kinds={"orders": line_statement(settings, HARMONICS)},
        axes={
            "planet": tuple(f"P{i}" for i in range(1, gear.planets + 1)),
            "sensor": tuple(f"Acc {k}" for k in range(1, len(settings.sensors.acc_angle_deg) + 1)),
            "harmonic": tuple(f"H{h}" for h in range(1, HARMONICS + 1)),
        },
        settings={
            "rig": settings.model_dump(), "parsed_rig": settings,
        },
        notes=(f"all teeth meet again after {repeat_turns(gear)} turns of the carrier",),
    )  # fmt: skip


def _constants(rig: Rig, gear: Gear) -> list[Quantity]:
    sun, ring = set_meshes(gear)
    angle = math.radians(gear.pressure_angle_deg)
    turns = repeat_turns(gear)
    per_turn = next_fast_len(2 * (HARMONICS * gear.z_ring + max(16, gear.z_ring // 2)), real=True)
    if turns * per_turn > MOST_SAMPLES:
        raise RequestError(
            f"the teeth meet again only after {turns} turns of the carrier",
            expected=f"at most {MOST_SAMPLES // per_turn}",
        )
    samples = turns * per_turn
    law = rig.contact
    si = np.array([law.K_N_mm_e * 1e3**law.exponent, law.exponent, 1e3 * law.C_Ns_mm, 1e-3 * law.depth_mm])
    phases, places = np.stack(mesh_phases(gear)), planet_angles(gear)
    carrier, planet = inertias(gear, rig.rotors)
    turn = np.arange(samples) * (turns / samples)
    from_sensor = places[:, None] - np.radians(rig.sensors.acc_angle_deg)[:, None, None]
    listed: list[tuple[str, Any, str, str, tuple[str, ...]]] = [
        ("sun_teeth", gear.z_sun, "1", "Teeth of the sun.", ()),
        ("ring_teeth", gear.z_ring, "1", "Teeth of the ring.", ()),
        ("repeat_turns", turns, "1", "Turns of the carrier after which everything repeats.", ()),
        ("carrier_turn", turn, "1", "Turns of the carrier.", ()),
        ("mesh_waves", np.exp(2j * np.pi * gear.z_ring * np.outer(np.arange(1, HARMONICS + 1), turn)), "1",
         "exp(2j pi h z_ring turn), one row per harmonic of the mesh.", ()),
        ("transfer_path", path_window(2 * np.pi * turn + from_sensor), "1",
         "Weight with which each sensor hears each planet as it passes, (sensors, planets, angle).", ("sensor",)),
        ("sun_order", float(sun_order(gear)), "1", "Turns of the sun against the carrier.", ()),
        ("sun_wave", np.exp(1j * (2 * np.pi * float(sun_order(gear)) * turn - places[:, None])), "1",
         "exp(j a), a the turn of the sun against the carrier beyond each planet's place.", ("planet",)),
        ("planet_order", float(planet_order(gear)), "1", "Turns of a planet against the carrier.", ()),
        ("carrier_ratio", carrier_speed_ratio(gear), "1", "Speed of the carrier over the sun's.", ()),
        ("base_radii", np.array(gear.base_radii_m), "m", "Base radii of sun, planet and ring.", ()),
        ("carrier_inertia", carrier, "kg*m^2", "Of the carrier with the planets' masses on it.", ()),
        ("planet_inertia", planet, "kg*m^2", "Of a planet about its pin.", ()),
        ("centre_distance", gear.pin_distance_m, "m", "From the carrier's axis to a planet's.", ()),
        ("pressure_cosine", math.cos(angle), "1", "Cosine of the pressure angle.", ()),
        ("pressure_angle", angle, "rad", "Pressure angle.", ()),
        ("planet_angle", places, "rad", "Places of the planets on the carrier.", ("planet",)),
        ("nominal_phase", phases, "1", "Phases of sun and ring meshes as drawn, in pitches.", ("planet",)),
        ("sensor_angle", np.radians(rig.sensors.acc_angle_deg), "rad", "Places of the sensors.", ("sensor",)),
        ("contact_law", si, "1", "K (N/m^e), e, C (N s/m), depth (m) of the contact law.", ()),
        ("mesh_geometry", np.array([[m.base_pitch, m.contact_ratio, m.gap_before, m.gap_after] for m in (sun, ring)]),
         "1", "Base pitch, contact ratio, gaps of the sun and the ring mesh.", ()),
    ]  # fmt: skip
    return [*(constant(*one) for one in listed), *_faultless(gear, samples)]


def _faultless(gear: Gear, samples: int) -> list[Quantity]:
    """What effects change of a set whose parts are as drawn."""
    listed: list[tuple[str, Any, str, str, tuple[str, ...]]] = [
        ("load_share", np.ones(gear.planets), "1", "Share of each planet, before errors of place.", ("planet",)),
        ("planet_position", np.zeros((gear.planets, 1)), "m", "By how much each pin lies ahead, at each point.",
         ("planet",)),
        ("sun_error", np.zeros((gear.planets, samples)), "m", "Excess of material in the sun meshes.", ("planet",)),
        ("sun_softness", np.zeros((gear.planets, samples)), "1", "Part of the stiffness that the sun meshes lack.",
         ("planet",)),
        ("ring_error", np.zeros((gear.planets, samples)), "m", "Excess of material in the ring meshes.", ("planet",)),
        ("tacho_angle", 0.0, "rad", "Angle of planet 1 at a pulse of the carrier's tacho.", ()),
        ("housing_response", 1.0, "1", "Gain between rim and sensor, of each line.", ()),
        ("line_coherence", 1.0, "1", "What remains of a line that the order analysis smears.", ()),
        ("tip_relief", 0.0, "m", "Relief of the tips.", ()),
        ("stiffness_change", np.zeros(2), "1", "Relative change of the stiffness of sun and ring meshes.", ()),
        ("damping_scale", 1.0, "1", "Damping of the meshes over that of the contact law.", ()),
        ("sun_shaft", np.zeros(3), "1", "Twist (rad/(N m)), resonance (Hz), damping of the sun's shaft.", ()),
        ("torque_ripple", np.zeros(samples), "1", "Relative change of the torque over the turn.", ()),
        ("friction_share", np.zeros((gear.planets, samples)), "1", "Force of friction over that of a ring mesh.",
         ("planet",)),
    ]  # fmt: skip
    return [constant(*one) for one in listed]


def _pair(settings: Rig) -> Model:
    """A gear pair: the run in time has its equations; here stands what is static."""
    pair = settings.pair
    assert pair is not None
    rb = 1e-3 * pair.module_mm * pair.z_driver * math.cos(math.radians(pair.pressure_angle_deg)) / 2
    quantities = [
        constant("mesh_order", pair.z_driver, "1", "Order of the mesh, per turn of the driver."),
        constant("mean_force", pair.driver_torque_Nm / rb, "N", "Mean force along the line of action."),
    ]
    return Model(
        name="planetary-gear",
        title=f"Gear pair {pair.z_driver}/{pair.z_driven}",
        conditions={},
        quantities={q.name: q for q in quantities},
        effects={},
        observables={"force": Observable("force", "mean_force", "N", "Mean force of the mesh.")},
        settings={"rig": settings.model_dump(), "parsed_rig": settings},
    )
