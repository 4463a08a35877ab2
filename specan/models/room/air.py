"""The air: speed of sound, density, attenuation."""

from __future__ import annotations

import numpy as np

from specan.models.quantity import quantity
from specan.models.room.air_absorption import iso_9613_1

ZERO_CELSIUS = 273.15  # K
GAS_CONSTANT_AIR = 287.05  # J/(kg K), dry air


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


QUANTITIES = (sound_speed, density, air_attenuation, air_dispersion)
