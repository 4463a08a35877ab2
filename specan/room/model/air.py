"""The air: speed of sound, density, attenuation.

ISO 9613-1 comes from the library `acoustics`: one module of it, without the rest of that library. ``import acoustics``
runs all of its modules. That costs a second, loads pandas and matplotlib, and fails under scipy from 1.17 on, where a
function is gone that only its directivities use. The module with the standard's formulas needs numpy only, and is
loaded by itself.
"""

from __future__ import annotations

from functools import cache
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import numpy as np

from specan.errors import RequestError
from specan.models.quantity import quantity

_MODULE = Path("standards") / "iso_9613_1_1993.py"

ZERO_CELSIUS = 273.15  # K
GAS_CONSTANT_AIR = 287.05  # J/(kg K), dry air


@cache
def iso_9613_1() -> ModuleType:
    """The module ``acoustics.standards.iso_9613_1_1993``, loaded from its file.

    Raises
    ------
    RequestError
        The library is not installed, or is a version without that file.

    Examples
    --------
    >>> round(float(iso_9613_1().soundspeed(293.15)), 1)
    343.2
    """
    package = find_spec("acoustics")  # looks for it and does not run it
    places = [] if package is None else list(package.submodule_search_locations or [])
    path = next((Path(p) / _MODULE for p in places if (Path(p) / _MODULE).is_file()), None)
    spec = None if path is None else spec_from_file_location("specan_iso_9613_1", path)
    if spec is None or spec.loader is None:
        raise RequestError(
            "the library 'acoustics' with ISO 9613-1 is missing",
            expected="acoustics 0.2.6",
            remedy="pip install acoustics==0.2.6",
        )
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@quantity(unit="K")
def air_temperature(nominal_air_temperature, temperature_difference):
    """Temperature of the air; a recording may differ from the rig's nominal one."""
    return nominal_air_temperature + temperature_difference


@quantity(unit="m/s", reference="ISO 9613-1:1993, eq. A.5: c = 343.2 sqrt(T / 293.15)")
def sound_speed(air_temperature):
    """Speed of sound below all relaxation."""
    return 343.2 * np.sqrt(air_temperature / 293.15)


@quantity(unit="kg/m^3")
def density(air_temperature, air_pressure):
    """Density of dry air, an ideal gas."""
    return air_pressure / (GAS_CONSTANT_AIR * air_temperature)


@quantity(unit="1/m", reference="ISO 9613-1:1993, eq. 5")
def air_attenuation(frequency, air_temperature, air_pressure, relative_humidity):
    """Attenuation of the sound pressure in air, Np/m."""
    iso = iso_9613_1()
    oxygen, nitrogen = _relaxation_hz(air_temperature, air_pressure, relative_humidity)
    decibel = iso.attenuation_coefficient(
        air_pressure / 1000,  # that library counts in kPa
        air_temperature,
        iso.REFERENCE_PRESSURE,
        iso.REFERENCE_TEMPERATURE,
        nitrogen,
        oxygen,
        frequency,
    )
    return np.asarray(decibel) * (np.log(10) / 20)


# Relaxation terms of ISO 9613-1:1993, eq. 5: factor (s/m) and temperature (K) of oxygen and nitrogen.
_RELAXATIONS = ((0.01275, 2239.1), (0.1068, 3352.0))


@quantity(unit="1", reference="Morfey and Howell, J. Acoust. Soc. Am. 68 (1980) 1525")
def air_dispersion(frequency, sound_speed, air_temperature, air_pressure, relative_humidity):
    """How much faster sound is than at low frequencies: what relaxes takes no part in fast oscillations.

    A process whose attenuation per wavelength reaches m (Np) at its relaxation frequency f_r raises the speed by the
    part ``(m / pi) x^2 / (1 + x^2)``, x = f / f_r (Kramers and Kronig's relations); in ISO 9613-1 m is half the
    factor of the process times the speed of sound: 6e-5 for nitrogen at 20 degC.
    """
    total = np.zeros(len(frequency))
    relaxations = _relaxation_hz(air_temperature, air_pressure, relative_humidity)
    for relaxation_hz, (factor, characteristic) in zip(relaxations, _RELAXATIONS, strict=True):
        strength = factor * np.exp(-characteristic / air_temperature) * (air_temperature / 293.15) ** -2.5
        x2 = (frequency / relaxation_hz) ** 2
        total += strength * sound_speed / (2 * np.pi) * x2 / (1 + x2)
    return total


def _relaxation_hz(temperature: float, pressure: float, humidity: float) -> tuple[float, float]:
    """Relaxation frequencies of oxygen and nitrogen (ISO 9613-1:1993, eqs 3 and 4)."""
    iso = iso_9613_1()
    kilopascal = pressure / 1000
    water = iso.molar_concentration_water_vapour(
        humidity * 100, iso.saturation_pressure(temperature), kilopascal
    )
    oxygen = float(iso.relaxation_frequency_oxygen(kilopascal, water))
    return oxygen, float(iso.relaxation_frequency_nitrogen(kilopascal, temperature, water))
