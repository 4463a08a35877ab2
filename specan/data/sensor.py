"""Units of samples and sensitivities as people write them, turned into the SI units that channels carry."""

from __future__ import annotations

import re
from functools import cache

from specan.errors import RequestError
from specan.units import is_compatible, scale_to

# Quantities of a laboratory, in the units that channels carry.
QUANTITY_UNITS = ("V", "Pa", "m/s", "m/s^2", "m", "N", "Nm", "A", "Hz", "K", "1")

# The common spellings need no unit library, whose import costs more than the headers of a file.
_USUAL = {
    "v": ("V", 1.0), "volt": ("V", 1.0), "volts": ("V", 1.0), "mv": ("V", 1e-3), "uv": ("V", 1e-6),
    "pa": ("Pa", 1.0), "pascal": ("Pa", 1.0), "pascals": ("Pa", 1.0), "hpa": ("Pa", 100.0), "kpa": ("Pa", 1e3),
    "m/s": ("m/s", 1.0), "mm/s": ("m/s", 1e-3), "um/s": ("m/s", 1e-6), "m/s/s": ("m/s^2", 1.0),
    "m/s^2": ("m/s^2", 1.0), "m/s2": ("m/s^2", 1.0), "m/s**2": ("m/s^2", 1.0), "mm/s^2": ("m/s^2", 1e-3),
    "ms^-2": ("m/s^2", 1.0), "ms-2": ("m/s^2", 1.0), "g": ("m/s^2", 9.80665), "gn": ("m/s^2", 9.80665),
    "m": ("m", 1.0), "mm": ("m", 1e-3), "um": ("m", 1e-6), "n": ("N", 1.0), "newton": ("N", 1.0),
    "newtons": ("N", 1.0), "n*m": ("Nm", 1.0), "n m": ("Nm", 1.0), "n-m": ("Nm", 1.0), "hz": ("Hz", 1.0),
    "1": ("1", 1.0), "-": ("1", 1.0),
}  # fmt: skip
# Where capitals tell units apart: mega and milli, newton metre and nanometre.
_CAPITALS = {"MV": ("V", 1e6), "MPa": ("Pa", 1e6), "mPa": ("Pa", 1e-3), "Nm": ("Nm", 1.0), "nm": ("m", 1e-9)}


@cache
def si_unit(text: str) -> tuple[str, float]:
    """SI unit that `text` stands for, and the factor to it; an unknown unit stays as it is written.

    Units with an offset (degC) stay as they are as well: a factor cannot convert them.

    Examples
    --------
    >>> si_unit("Volts"), si_unit("kPa"), si_unit("g"), si_unit("furlong/fortnight*apple")
    (('V', 1.0), ('Pa', 1000.0), ('m/s^2', 9.80665), ('furlong/fortnight*apple', 1.0))
    """
    plain = _plain(text)
    if plain in _CAPITALS:
        return _CAPITALS[plain]
    if plain.lower() in _USUAL:
        return _USUAL[plain.lower()]
    if "deg" in plain.lower() or plain.startswith("°"):
        return text.strip(), 1.0
    for unit in QUANTITY_UNITS:
        if unit != "1" and is_compatible(plain, unit):
            return unit, scale_to(plain, unit)
    return text.strip(), 1.0


def is_known(text: str) -> bool:
    """Whether `text` is a unit of one of the quantities that channels carry."""
    return si_unit(text)[0] in QUANTITY_UNITS


# Squares of samples are summed: beyond this they could leave the range of floating-point numbers. Real gains lie far
# inside: 1 nm per V of a vibrometer, 1e-7 V per step of a converter.
SMALLEST_GAIN = 1e-30


def gain_of(sensitivity: float, unit: str, raw_scale: float = 1.0) -> tuple[float, str]:
    """Gain from samples to the quantity in SI units, and that unit.

    Parameters
    ----------
    sensitivity : float
        In `unit`: voltage per quantity ("mV/Pa", "mV/g") or quantity per voltage ("(m/s)/V").
    unit : str
        Its unit.
    raw_scale : float
        Volts per unit of the samples (1e-3 for samples in mV).

    Returns
    -------
    tuple
        Factor on the samples, and the SI unit of the result.

    Raises
    ------
    RequestError
        The sensitivity is not above zero, or its unit holds no voltage.

    Examples
    --------
    >>> gain_of(50.0, "mV/Pa")
    (20.0, 'Pa')
    >>> gain_of(50.0, "(mm/s)/V")
    (0.05, 'm/s')
    """
    if not SMALLEST_GAIN <= abs(sensitivity) <= 1 / SMALLEST_GAIN:
        raise RequestError(
            f"the sensitivity is {sensitivity} {unit}",
            expected=f"a number other than zero, from {SMALLEST_GAIN:g} to {1 / SMALLEST_GAIN:g}",
        )
    plain = _plain(unit)
    per_quantity = re.fullmatch(r"([a-zA-Z]?V)/(.+)", plain)
    per_voltage = re.fullmatch(r"(.+)/([a-zA-Z]?V)", plain)
    if per_quantity:
        quantity, scale = si_unit(_bare(per_quantity[2]))
        if quantity in QUANTITY_UNITS:
            return raw_scale * scale / (sensitivity * si_unit(per_quantity[1])[1]), quantity
    elif per_voltage:
        quantity, scale = si_unit(_bare(per_voltage[1]))
        if quantity in QUANTITY_UNITS:
            return raw_scale * sensitivity * scale / si_unit(per_voltage[2])[1], quantity
    raise RequestError(
        f"the sensitivity unit {unit!r} is not known",
        expected="a voltage per quantity such as mV/Pa or mV/g, or a quantity per voltage such as (m/s)/V",
    )


def _plain(text: str) -> str:
    """One spelling of powers, products and prefixes."""
    text = text.strip().replace("²", "^2").replace("µ", "u").replace("μ", "u").replace("·", "*")
    return _bare(re.sub(r"\s*([/*^])\s*", r"\1", text))


def _bare(text: str) -> str:
    """Without the parentheses around the whole."""
    return text[1:-1] if re.fullmatch(r"\([^()]*\)", text) else text
