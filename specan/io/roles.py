"""What a channel measures: role, unit and sensitivity from its properties and its name, each with the reason."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

from specan.data.channel import Channel, Role, gain_of, is_known, si_unit
from specan.errors import RequestError
from specan.units import number

SAMPLE_UNIT_KEYS = ("unit_string", "Unit_String", "NI_UnitDescription")

# Words in names, sensors and modules, most telling first.
_WORDS: tuple[tuple[Role, str], ...] = (
    ("tacho", r"tacho|encoder|key ?phasor|rpm"),
    (
        "vibrometer",
        r"vibromet|wibromet|polytec|\bofv\b|\bldv\b|laser|diaphragm|membrane|membran|vibro|\bvib\b|velocity",
    ),
    ("accelerometer", r"accel|\bacc\b|\bbeschl|przyspiesz"),
    ("microphone", r"\bmics?\b|\bmic[a-z]\b|mikrofon|microphon|sound pressure|hydrophon"),
    (
        "generator",
        r"generator|\bgen\b|excitation|\bao\d*\b|source signal|signal source|^source( \d+)?$|\bdrive\b"
        r"|wzbudzeni|anregung",
    ),
    ("torque", r"torque|drehmoment|moment obrot"),
    ("force", r"\bforce\b|\bhammer\b|\bkraft\b|\bsi[lł]a\b|m[lł]otek"),
)
_UNIT_ROLES: dict[str, Role] = {
    "Pa": "microphone", "m/s": "vibrometer", "m/s^2": "accelerometer", "Nm": "torque", "N": "force",
}  # fmt: skip
# A displacement is a vibrometer's where name and unit both say so: a length alone may be a position or a wear.
_DISPLACEMENT = r"\bdisp(lacement|l)?\b|auslenkung|przemieszczenie"


def identify(name: str, properties: Mapping[str, Any], group: str = "") -> Channel:
    """Role, unit and gain of a channel without a channel table.

    `unit_string` is the unit of the samples, `QuantityUnit` that after `Sensitivity`. A sensitivity
    is applied to samples in volts only: to samples in pascals it is a remark.
    """
    raw_unit, raw_scale, said = sample_unit(properties)
    sensitivity = _sensitivity(properties)
    quantity = str(properties.get("QuantityUnit", "")).strip()
    if not raw_unit and sensitivity is None and is_known(quantity):
        # Nothing lies between the samples and the quantity.
        (raw_unit, raw_scale), said = si_unit(quantity), f"property QuantityUnit {quantity!r}, no sensitivity"
    decisions = {"unit": said + _private_gain(properties, raw_unit)}
    unit, gain = raw_unit or "1", raw_scale
    if not raw_unit:
        decisions["unit"] += "; the samples are taken as they are"
    if sensitivity is not None and raw_unit in ("V", ""):
        try:
            gain, unit = gain_of(*sensitivity, raw_scale)
        except RequestError as fault:
            decisions["sensitivity"] = f"not used: {fault.found}"
        else:
            decisions["unit"] = said
            decisions["sensitivity"] = (
                f"properties Sensitivity, SensitivityUnit: {sensitivity[0]:g} {sensitivity[1]} (nominal)"
            )
    elif sensitivity is not None:
        decisions["sensitivity"] = (
            f"not used: the samples are already in {raw_unit}; the file states {sensitivity[0]:g} {sensitivity[1]}"
        )
    if quantity and is_known(quantity) and si_unit(quantity)[0] != unit:
        why = "needs a sensitivity" if unit == raw_unit else "contradicts the sensitivity"
        decisions["unit"] += f"; QuantityUnit {quantity!r} {why}"
    role, decisions["role"] = role_of(name, properties, unit if unit != "1" else "", quantity)
    derivatives = derivatives_of(role, unit, decisions)
    return Channel(
        name, group, unit, role, raw_unit=raw_unit, raw_scale=raw_scale, gain=gain, derivatives=derivatives,
        decisions=decisions,
    )  # fmt: skip


def sample_unit(properties: Mapping[str, Any]) -> tuple[str, float, str]:
    """SI unit of the samples (empty where nothing says), factor to it, and where it stands."""
    for key in SAMPLE_UNIT_KEYS:
        text = str(properties.get(key, "")).strip()
        if text:
            unit, scale = si_unit(text)
            return unit, scale, f"property {key} {text!r}"
    return "", 1.0, "no property names the unit of the samples"


def _private_gain(properties: Mapping[str, Any], raw_unit: str) -> str:
    """A remark on scaling properties of an acquisition program that are no part of TDMS."""
    gain, unit = properties.get("Gain"), str(properties.get("Units", "")).strip()
    if gain is None or not unit or si_unit(unit)[0] == raw_unit:
        return ""
    offset = properties.get("Offset", 0.0)
    return (
        f"; the private properties Gain {gain:g}, Offset {offset:g}, Units {unit!r} are not applied "
        "(give the gain in the channel table)"
    )


def role_of(name: str, properties: Mapping[str, Any], unit: str, quantity: str) -> tuple[Role, str]:
    """Role from tacho pulses, then words in the name, the sensor, then the unit; and the reason."""
    if "PulsesPerRevolution" in properties:
        return "tacho", "property PulsesPerRevolution"
    found = _by_words(name)
    if found:
        return found, f"the name {name!r}"
    for key in ("Sensor", "NI_ChannelName", "Module"):
        found = _by_words(str(properties.get(key, "")))
        if found:
            return found, f"property {key} {str(properties[key])!r}"
    if unit == "m" and re.search(_DISPLACEMENT, _spaced(name)):
        return "vibrometer", f"the name {name!r} and the unit m"
    for text, why in ((quantity, f"QuantityUnit {quantity!r}"), (unit, f"the unit {unit}")):
        role = _UNIT_ROLES.get(si_unit(text)[0]) if text else None
        if role:
            return role, why
    return "other", "neither name, sensor nor unit indicates the role"


def derivatives_of(role: Role, unit: str, decisions: dict[str, str]) -> int:
    """How often a vibrometer's signal is differentiated to become a velocity."""
    if role != "vibrometer" or unit not in ("m", "m/s^2"):
        return 0
    what, times = ("displacement", 1) if unit == "m" else ("acceleration", -1)
    decisions["derivatives"] = f"the vibrometer gives {what} in {unit}; converted to velocity by j w"
    return times


def _by_words(text: str) -> Role | None:
    spaced = _spaced(text)
    return next((role for role, words in _WORDS if re.search(words, spaced)), None)


def _spaced(text: str) -> str:
    """In small letters, with blanks for separators and before numbers."""
    return re.sub(r"(?<=[a-z])(?=\d)", " ", re.sub(r"[_\-./]+", " ", text.lower())).strip()


def _sensitivity(properties: Mapping[str, Any]) -> tuple[float, str] | None:
    value, unit = number(properties.get("Sensitivity")), str(properties.get("SensitivityUnit", "")).strip()
    return (value, unit) if value and math.isfinite(value) and unit else None
