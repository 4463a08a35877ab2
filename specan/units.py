"""Units at the edges of the program, and the references of levels (ISO 1683)."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

from specan.errors import RequestError


def number(text: object) -> float | None:
    """A number as people write it, with a point or a comma; None where it is none.

    Examples
    --------
    >>> number("94,0"), number(2), number("loud")
    (94.0, 2.0, None)
    """
    try:
        return float(str(text).strip().strip('"').replace(",", "."))
    except ValueError:
        return None


Quantity = Literal["displacement", "velocity", "acceleration"]
QUANTITIES: tuple[Quantity, ...] = ("displacement", "velocity", "acceleration")
MOTION = ("m", "m/s", "m/s^2")  # their units: each the derivative of the one before

# Spellings found in recordings that the unit library does not know or reads as something else
# ("g" is the gram there; a vibration engineer means standard gravity).
_SPELLINGS = {
    "volt": "V", "volts": "V", "pascal": "Pa", "pascals": "Pa", "newton": "N", "newtons": "N",
    "g": "g_n", "gn": "g_n", "g_n": "g_n", "n·m": "N*m", "n*m": "N*m", "n m": "N*m",
    "m/s2": "m/s^2", "m/s²": "m/s^2", "m/s/s": "m/s^2", "m/s^2": "m/s^2",
    "°c": "degC", "c": "degC", "degc": "degC", "deg c": "degC", "°": "degree", "deg": "degree",
    "µm": "micrometer", "mm2/s": "mm^2/s", "mm²/s": "mm^2/s", "cst": "cSt", "rpm": "revolutions_per_minute",
    "1/min": "revolutions_per_minute", "-": "dimensionless", "": "dimensionless", "1": "dimensionless",
    "%": "percent", "hz": "Hz", "s": "s",
    # turns a minute, as the world writes them: a plain 1/min would be taken for radians
    **dict.fromkeys(
        ("/min", "min-1", "min^-1", "min**-1", "min⁻¹", "r/min", "rev/min", "u/min", "tr/min", "obr/min", "obr./min"),
        "revolutions_per_minute",
    ),
}  # fmt: skip


_POWERS = str.maketrans("⁻¹²³⁴", "-1234")
_NO_UNIT = re.compile(r"[^\w\s*/^().+%°·⁻-]")


@dataclass(frozen=True)
class _Scale:
    """A value in a unit, times the factor, plus the offset, is one in SI base units."""

    base: str  # as the unit library writes them
    factor: float = 1.0
    offset: float = 0.0


# What conditions, parameters and columns of the models are in: for these the unit library, a quarter of a second, is
# not loaded. It gives the same numbers, bit for bit (tests/data/test_common_units.py).
_COMMON = {
    "dimensionless": _Scale("dimensionless"),
    "percent": _Scale("dimensionless", 0.01),
    "revolutions_per_minute": _Scale("radian / second", 2 * math.pi / 60),
    "rad/s": _Scale("radian / second"),
    "K": _Scale("kelvin"),
    "degC": _Scale("kelvin", 1.0, 273.15),
    "s": _Scale("second"),
    "ms": _Scale("second", 1e-3),
    "Hz": _Scale("1 / second"),
    "m": _Scale("meter"),
    "um": _Scale("meter", 1e-6),
    "m/s": _Scale("meter / second"),
    "m/s^2": _Scale("meter / second ** 2"),
    "m^2/s": _Scale("meter ** 2 / second"),
    "mm^2/s": _Scale("meter ** 2 / second", 1e-6),
    "kg/m^3": _Scale("kilogram / meter ** 3"),
    "N": _Scale("kilogram * meter / second ** 2"),
    "N/m": _Scale("kilogram / second ** 2"),
    "N*m": _Scale("kilogram * meter ** 2 / second ** 2"),
    "Pa": _Scale("kilogram / meter / second ** 2"),
    "Pa*s/m": _Scale("kilogram / meter ** 2 / second"),
    "W": _Scale("kilogram * meter ** 2 / second ** 3"),
    "K/W": _Scale("kelvin * second ** 3 / kilogram / meter ** 2"),
    "mN*m/K": _Scale("kilogram * meter ** 2 / kelvin / second ** 2", 1e-3),
}
_COMMON |= {scale.base: _Scale(scale.base) for scale in _COMMON.values()}


@dataclass(frozen=True)
class LevelReference:
    """The value that is 0 dB, and how it is printed: ``20 uPa``."""

    value: float
    unit: str
    text: str


# ISO 1683:2015, table 1; the 50 nm/s of building acoustics is selectable.
LEVEL_REFERENCES = {
    "Pa": LevelReference(20e-6, "Pa", "20 uPa"),
    "m/s^2": LevelReference(1e-6, "m/s^2", "1 um/s^2"),
    "m/s": LevelReference(1e-9, "m/s", "1 nm/s"),
    "m": LevelReference(1e-12, "m", "1 pm"),
    "N": LevelReference(1e-6, "N", "1 uN"),
    "V": LevelReference(1.0, "V", "1 V"),
}
VELOCITY_50_NM_S = LevelReference(50e-9, "m/s", "50 nm/s")


def level_reference(unit: str, velocity: str = "1 nm/s") -> LevelReference:
    """Level reference of an SI unit (ISO 1683); 1 of that unit where the standard has none."""
    if unit == "m/s" and velocity == VELOCITY_50_NM_S.text:
        return VELOCITY_50_NM_S
    return LEVEL_REFERENCES.get(unit, LevelReference(1.0, unit, "1" if unit == "1" else f"1 {unit}"))


@cache
def _registry() -> Any:
    import pint  # takes longer to load than most commands need

    return pint.UnitRegistry(autoconvert_offset_to_baseunit=True)


def _expression(unit: str) -> str:
    text = unit.strip()
    plain = _SPELLINGS.get(text.lower())
    if plain is not None:
        return plain
    if odd := _NO_UNIT.search(text):  # the unit library would read "m/s?" as "m/s"
        raise RequestError(f"the unit {unit!r} holds {odd[0]!r}", expected="an SI unit or a multiple")
    text = re.sub(r"\b((?:[a-zµ]{0,2}m)|s|in|ft)([2-4])\b", r"\1^\2", text)  # m3/h
    text = re.sub("[⁻¹²³⁴]+", lambda power: "^" + power[0].translate(_POWERS), text)
    return text.replace("µ", "u").replace("·", "*").replace("Nm", "N*m")


@cache
def scale_to(unit: str, target: str) -> float:
    """Factor that turns a value in `unit` into one in `target`; for units without an offset.

    Examples
    --------
    >>> scale_to("mV/Pa", "V/Pa")
    0.001
    """
    return float(convert(1.0, unit, target) - convert(0.0, unit, target))


def convert(value: Any, unit: str, target: str) -> Any:
    """Convert a number or an array from `unit` to `target`, offsets (degC) included.

    Examples
    --------
    >>> convert(20.0, "degC", "K")
    293.15
    """
    given, wanted = _expression(unit), _expression(target)
    if given in _COMMON and wanted in _COMMON and _is_real(value):
        old, new = _COMMON[given], _COMMON[wanted]
        if old.base == new.base:
            if old.offset == new.offset:
                return value if old == new else value * (old.factor / new.factor)
            return value * old.factor + old.offset - new.offset
    registry = _registry()
    try:
        return registry.Quantity(value, given).to(wanted).magnitude
    except Exception as fault:  # the unit library raises many kinds, some of them not its own
        raise RequestError(
            f"the unit {unit!r} cannot be read as {target!r} ({fault})",
            expected=f"a unit convertible to {target}",
        ) from None


def _is_real(value: Any) -> bool:
    """Whether it is a number or an array of numbers in double precision (np.float64 is a float)."""
    return isinstance(value, float) or str(getattr(value, "dtype", "")) == "float64"


def printed_unit(unit: str) -> str:
    """A unit as a sentence shows it; nothing for a plain number.

    Examples
    --------
    >>> [printed_unit(unit) for unit in ("degC", "N*m", "bar/(m3/s)^2", "um/N", "percent", "mmH2O", "N/m^5", "1")]
    ['°C', 'N·m', 'bar/(m³/s)²', 'µm/N', '%', 'mmH2O', 'N/m⁵', '']
    """
    shown = re.sub(r"\bu(m|Pa|N)\b", r"µ\1", unit.replace("**", "^").replace("*", "·"))
    raised = re.compile(r"(?<=[A-Za-z)])(\^?[23]|\^[4-9])(?![\w.])")
    powers = raised.sub(lambda found: "²³⁴⁵⁶⁷⁸⁹"[int(found[0][-1]) - 2], shown)
    return {"degC": "°C", "degF": "°F", "percent": "%", "1": ""}.get(unit, powers)


def spoken(*values: float, unit: str = "1", digits: int = 3) -> str:
    """Values and their unit as a sentence shows them.

    Examples
    --------
    >>> spoken(0.02877, 0.006378, unit="N*m"), spoken(152.7, unit="percent", digits=2)
    ('0.0288 to 0.00638 N·m', '150 %')
    """
    shown = " to ".join(f"{float(f'{value:.{digits}g}'):g}" for value in values)
    return f"{shown} {printed_unit(unit)}".rstrip()


def axis_label(quantity: str, unit: str) -> str:
    """A quantity with its unit, as it stands beside an axis.

    Examples
    --------
    >>> axis_label("RMS error of input_torque", "N*m"), axis_label("flow", "m3/s"), axis_label("efficiency", "1")
    ('RMS error of input torque / N·m', 'flow / (m³/s)', 'efficiency')
    """
    shown = printed_unit(unit)
    return quantity.replace("_", " ") + (f" / ({shown})" if "/" in shown else f" / {shown}" if shown else "")


def is_compatible(unit: str, target: str) -> bool:
    """Whether `unit` can be read and converted to `target`."""
    try:
        convert(1.0, unit, target)
    except RequestError:
        return False
    return True


@cache
def base_unit(unit: str) -> str:
    """SI base unit that `unit` reduces to, as text.

    Examples
    --------
    >>> base_unit("mm^2/s") == base_unit("m^2/s")
    True
    """
    expression = _expression(unit)
    if expression in _COMMON:
        return _COMMON[expression].base
    registry = _registry()
    try:
        return str(registry.Quantity(1.0, expression).to_base_units().units)
    except Exception as fault:  # as in `convert`
        raise RequestError(
            f"the unit {unit!r} is not known ({fault})", expected="an SI unit or a multiple"
        ) from None


def with_unit(value: Any, unit: str) -> Any:
    """A number that carries its unit through a formula, as an object of the unit library."""
    return _registry().Quantity(value, _expression(unit))


def same_dimension(value: Any, unit: str) -> str:
    """Empty where a value is of the dimension of a unit; otherwise the unit that it has.

    Examples
    --------
    >>> same_dimension(with_unit(2.0, "m^3/h"), "l/s"), same_dimension(with_unit(2.0, "m^3/h"), "m")
    ('', 'm ** 3 / h')
    """
    registry = _registry()
    given = value if hasattr(value, "dimensionality") else registry.Quantity(value)
    if given.dimensionality == registry.Quantity(1.0, _expression(unit)).dimensionality:
        return ""
    return f"{given.units:~}" or "1"


def often_mistaken_for(unit: str) -> dict[str, str]:
    """Units in which a column that should be in `unit` is often recorded by mistake, with their names.

    Examples
    --------
    >>> often_mistaken_for("rpm"), often_mistaken_for("N*m"), often_mistaken_for("degC")
    ({'rps': 'rev/s', 'rad/s': 'rad/s'}, {'mN*m': 'mN*m', 'kN*m': 'kN*m'}, {'degF': 'degF', 'K': 'K'})
    """
    if is_compatible(unit, "rpm") and convert(1.0, unit, "rpm") == 1:
        return {"rps": "rev/s", "rad/s": "rad/s"}
    if unit in ("degC", "K"):
        return {other: other for other in ("degF", "K", "degC") if other != unit}
    prefixed = unit[:1] in ("m", "k") and is_compatible(unit[1:], unit)
    plain = unit[1:] if prefixed else unit
    return {
        other: other
        for other in (plain, "m" + plain, "k" + plain)
        if other != unit and is_compatible(other, unit)
    }


def quotient(unit: str, over: str) -> str:
    """Unit of a ratio.

    Examples
    --------
    >>> quotient("Pa", "m/s"), quotient("Pa", "V"), quotient("Pa", "Pa")
    ('Pa/(m/s)', 'Pa/V', '1')
    """
    if unit == over:
        return "1"
    if over == "1":
        return unit
    return f"{unit}/({over})" if "/" in over or "*" in over else f"{unit}/{over}"
