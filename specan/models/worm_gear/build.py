"""From a rig file to the worm-gear model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from specan.models.catalogue import effects_in
from specan.models.model import LawSpace, Model, Nuisance, Observable
from specan.models.quantity import Condition
from specan.models.worm_gear import kinematics, mesh, power
from specan.models.worm_gear.article import article_quantities
from specan.models.worm_gear.bearings import bearing_quantities
from specan.models.worm_gear.forces import force_quantities
from specan.models.worm_gear.instrument_ranges import scaled_to_torque
from specan.models.worm_gear.oil import viscosity_quantities
from specan.models.worm_gear.rig import (
    Operation,
    PlacedBearing,
    Rig,
    defaults_used,
    placed_bearings,
    read_rig,
)
from specan.units import base_unit, convert

BASE_EFFECTS = ("bearing-friction", "churning", "tooth-friction")

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
        *kinematics.geometry(settings.gear),
        *kinematics.QUANTITIES,
        *viscosity_quantities(settings.oil, settings.model),
        *mesh.QUANTITIES,
        *force_quantities(settings, bearings),
        *bearing_quantities(bearings, settings.gear.z_wheel / settings.gear.z_worm),
        *power.QUANTITIES,
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
        nuisances=_nuisances(settings),
        axes={"bearing": _bearing_names(bearings)},
        settings=_for_studies(settings, conditions),
        law=LawSpace("power_loss", {"T": "output_torque", "n": "worm_speed", "nu": "kinematic_viscosity"}),
    )


def _conditions(operation: Operation) -> dict[str, Condition]:
    listed = [
        Condition("worm_speed", "rad/s", "Speed of the worm shaft.", "speed_rpm", "rpm"),
        Condition(
            "indicated_output_torque", "N*m", "Torque that the output sensor indicates.",
            "output_torque_Nm", "N*m",
        ),
        Condition(
            "indicated_oil_temperature", "K", "Temperature that the sensor in the oil sump indicates.",
            "oil_temperature_C", "degC", operation.oil_temperature_C,
        ),
        Condition(
            "oil_level", "1", "Oil level over the standard one.", "oil_level_percent", "percent",
            operation.oil_level_percent,
        ),
        Condition(
            "ambient_temperature", "K", "Temperature of the room.", "ambient_temperature_C", "degC",
            operation.ambient_temperature_C, varies=False,
        ),
        Condition(
            "elapsed_time", "s", "Time since the first reading.", "elapsed_time_s", "s", float("nan"),
        ),
    ]  # fmt: skip
    return {condition.name: condition for condition in listed}


OBSERVABLES = (
    Observable("input_torque", "indicated_input_torque", "N*m", "Torque at the input shaft; what is fitted."),
    Observable("efficiency", "indicated_efficiency", "1", "Power out over power in."),
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


# key of [uncertainty]: condition, whether relative to its value, unit
SETTING_ERRORS = {
    "torque_setting_percent": ("indicated_output_torque", True, "percent"),
    "speed_setting_percent": ("worm_speed", True, "percent"),
    "oil_temperature_setting_K": ("indicated_oil_temperature", False, "kelvin"),
}


def _for_studies(rig: Rig, conditions: Mapping[str, Condition]) -> dict[str, Any]:
    """What a study reads; SI, by the names of conditions and observables.

    limits
        ``{condition: (low, high)}`` that the bench can run.
    setting_errors
        ``{condition: (standard uncertainty, whether relative)}`` of setting a condition again.
    reading_errors
        ``{observable: standard uncertainty}`` of one reading, ``{condition: ...}`` likewise.
    discrepancy
        Declared standard model discrepancy, relative to the observable.
    uncertainty, defaults_used
        The rig file's own keys: what it gives, and the defaults that were assumed.
    """
    columns = {c.column: c for c in conditions.values()}
    limits = rig.limits.model_dump(exclude_none=True)
    given = rig.uncertainty
    readings = {"input_torque": given.input_torque_Nm, "indicated_output_torque": given.output_torque_Nm}
    return {
        "limits": {
            columns[key].name: tuple(
                float(convert(value, columns[key].column_unit, columns[key].unit)) for value in span
            )
            for key, span in limits.items()
        },
        "setting_errors": {
            condition: (float(convert(sd, unit, base_unit(unit))), relative)
            for key, (condition, relative, unit) in SETTING_ERRORS.items()
            if (sd := getattr(given, key))
        },
        "reading_errors": {name: sd for name, sd in readings.items() if sd},
        "discrepancy": 0.01 * given.model_discrepancy_percent,
        "uncertainty": given.model_dump(exclude_none=True),
        "defaults_used": defaults_used(rig),
    }
