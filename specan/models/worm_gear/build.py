"""From a rig file to the worm-gear model."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from specan.models.catalogue import effects_in
from specan.models.model import LawSpace, Model, Nuisance, Words
from specan.models.quantity import Condition, Observable, SettingError
from specan.models.rig import RigStatement
from specan.models.worm_gear import mesh
from specan.models.worm_gear.bearings import bearing_quantities, force_quantities
from specan.models.worm_gear.mesh import article_quantities
from specan.models.worm_gear.oil import viscosity_quantities
from specan.models.worm_gear.rig import (
    Operation,
    PlacedBearing,
    Rig,
    defaults_used,
    placed_bearings,
    read_rig,
    scaled_to_torque,
)
from specan.models.worm_gear.table_rules import table_rules
from specan.units import convert

RPM = math.pi / 30
BASE_EFFECTS = ("bearing-friction", "churning", "tooth-friction")
OTHER_FORMS = {
    "bearing-friction": ("palmgren-bearings", "iso-bearings"),
    "churning": ("exponential-churning",),
}

# key of [uncertainty]: effect and parameter that it holds, factor from the key's unit to the parameter's
CERTIFICATES = {
    "input_torque_zero_Nm": ("torque-zero-error", "input", 1.0),
    "output_torque_zero_Nm": ("torque-zero-error", "output", 1.0),
    "input_torque_gain_percent": ("torque-gain-error", "input", 1.0),
    "output_torque_gain_percent": ("torque-gain-error", "output", 1.0),
    "oil_temperature_K": ("temperature-bias", "bias", 1.0),
}


def build(rig: Mapping[str, Any]) -> Model:
    """Build the model of a worm gear.

    Parameters
    ----------
    rig : mapping
        The parsed rig file.

    Raises
    ------
    RequestError
        The rig file has an unknown key, lacks one, or says something impossible.
    """
    settings = read_rig(rig)
    bearings = placed_bearings(settings)
    quantities = [
        *mesh.geometry(settings.gear),
        *viscosity_quantities(settings.oil, settings.model),
        *mesh.QUANTITIES,
        *force_quantities(settings, bearings),
        *bearing_quantities(bearings, settings.gear.z_wheel / settings.gear.z_worm),
        *mesh.BALANCE,
        mesh.brake_quantity(
            bool(settings.operation.idle_uncoupled), max(map(abs, settings.limits.output_torque_Nm))
        ),
    ]
    if settings.model.mesh == "article":
        quantities += article_quantities(settings)  # of the same names, and later ones win
    conditions = _conditions(settings.operation)
    effects = effects_in("specan.models.worm_gear.effects")
    torques = settings.limits.output_torque_Nm
    effects = scaled_to_torque(effects, max(map(abs, torques)) if torques else None)
    return Model(
        name="worm-gear",
        title="Worm gear: losses in steady operation",
        conditions=conditions,
        quantities={quantity.name: quantity for quantity in quantities},
        effects=effects,
        observables={o.name: o for o in OBSERVABLES},
        base_effects=BASE_EFFECTS,
        other_forms=OTHER_FORMS,
        nuisances=_nuisances(settings),
        axes={"bearing": _bearing_names(bearings)},
        rig=_rig_statement(settings, conditions),
        words=WORDS,
        table_rules=table_rules(settings.gear.z_wheel / settings.gear.z_worm),
        settings={"rig": settings.model_dump()},
        law=LawSpace("power_loss", {"T": "output_torque", "n": "worm_speed", "nu": "kinematic_viscosity"}),
    )


def _conditions(operation: Operation) -> dict[str, Condition]:
    listed = [
        Condition(
            "worm_speed", "rad/s", "Speed of the worm shaft.", "speed_rpm", "rpm",
            usual_setting=SettingError(relative=0.01),
        ),
        Condition(
            "indicated_output_torque", "N*m", "Torque that the output sensor indicates.",
            "output_torque_Nm", "N*m", usual_setting=SettingError(relative=0.05), idles=True,
        ),
        Condition(
            "indicated_oil_temperature", "K", "Temperature that the sensor in the oil sump indicates.",
            "oil_temperature_C", "degC", operation.oil_temperature_C,
            usual_setting=SettingError(absolute=1.5),
        ),
        Condition(
            "oil_level", "1", "Oil level over the standard one.", "oil_level_percent", "percent",
            operation.oil_level_percent,
        ),
        Condition(
            "ambient_temperature", "K", "Temperature of the room.", "ambient_temperature_C", "degC",
            operation.ambient_temperature_C, varies=False,
            usual_setting=SettingError(absolute=1.5),
        ),
        Condition(
            "coupled", "1", "Whether the brake was coupled to the output: 1, or 0 in runs without it.", "coupled", "1",
            1.0, varies=False, usual_setting=SettingError(absolute=0.1),
        ),
        Condition(
            "elapsed_time", "s", "Time since the first reading.", "elapsed_time_s", "s", float("nan"),
        ),
    ]  # fmt: skip
    return {condition.name: condition for condition in listed}


WORDS = Words(
    ideal="the ideal machine",
    discrepancy_of="losses",
    remedy_uncertainty="input_torque_Nm = 0.005",
    vary="speeds, torques or temperatures",
)
OBSERVABLES = (
    Observable("input_torque", "indicated_input_torque", "N*m", "Torque at the input shaft; what is fitted."),
    Observable(
        "efficiency", "indicated_efficiency", "1", "Power out over power in.", reading_of="input_torque"
    ),
    Observable("power_loss", "indicated_power_loss", "W", "Power in less power out."),
)


def _nuisances(rig: Rig) -> tuple[Nuisance, ...]:
    """Instrument errors that the rig file gives a certificate of."""
    found = []
    for key, (effect, parameter, factor) in CERTIFICATES.items():
        sd = getattr(rig.uncertainty, key)
        if sd:
            found.append(Nuisance(effect, parameter, factor * sd, f"[uncertainty] {key}"))
    return tuple(found)


def _bearing_names(bearings: tuple[PlacedBearing, ...]) -> tuple[str, ...]:
    return tuple(f"{b.shaft} {i % 2 + 1}: {b.bearing.designation}" for i, b in enumerate(bearings))


# key of [uncertainty]: condition, whether relative to its value
SETTING_ERRORS = {
    "torque_setting_percent": ("indicated_output_torque", True),
    "speed_setting_percent": ("worm_speed", True),
    "oil_temperature_setting_K": ("indicated_oil_temperature", False),
}
# key of [uncertainty]: what is read with that scatter
READING_ERRORS = {
    "input_torque_Nm": "input_torque",
    "output_torque_Nm": "indicated_output_torque",
    "oil_temperature_reading_K": "indicated_oil_temperature",
    "speed_reading_rpm": "worm_speed",
}
READING_PERCENT = {"input_torque_percent": "input_torque", "output_torque_percent": "indicated_output_torque"}


def _rig_statement(rig: Rig, conditions: Mapping[str, Condition]) -> RigStatement:
    """Limits and uncertainties of the bench, SI."""
    columns = {c.column: c for c in conditions.values()}
    given = rig.uncertainty.model_dump(exclude_none=True)
    limits = {}
    for key, (low, high) in rig.limits.model_dump(exclude_none=True).items():
        known = columns[key]
        ends = [float(convert(end, known.column_unit, known.unit)) for end in (low, high)]
        limits[known.name] = (ends[0], ends[1])
    return RigStatement(
        limits=limits,
        setting={
            condition: SettingError(given[key] / 100) if relative else SettingError(absolute=given[key])
            for key, (condition, relative) in SETTING_ERRORS.items()
            if key in given
        },
        reading={
            name: given[key] * (RPM if key.endswith("_rpm") else 1.0)
            for key, name in READING_ERRORS.items()
            if key in given
        },
        reading_percent={name: given[key] for key, name in READING_PERCENT.items() if key in given},
        discrepancy_percent=rig.uncertainty.model_discrepancy_percent,
        defaults_used=defaults_used(rig),
    )
