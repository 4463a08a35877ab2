"""The air: speed of sound, density, attenuation."""

from __future__ import annotations

import numpy as np

from specan.models.quantity import quantity

ZERO_CELSIUS = 273.15  # K
GAS_CONSTANT_AIR = 287.05  # J/(kg K), dry air


@quantity(unit="m/s", reference="ISO 9613-1:1993, eq. A.5: c = 343.2 sqrt(T / 293.15)")
def sound_speed(air_temperature):
    """Speed of sound."""
    return 343.2 * np.sqrt(air_temperature / 293.15)


@quantity(unit="kg/m^3")
def density(air_temperature, air_pressure):
    """Density of dry air, an ideal gas."""
    return air_pressure / (GAS_CONSTANT_AIR * air_temperature)


@quantity(unit="1/m", reference="ISO 9613-1:1993, eq. 5")
def air_attenuation(frequency, air_temperature, air_pressure, relative_humidity):
    """Attenuation of the sound pressure in air, Np/m."""
    from acoustics.standards import iso_9613_1_1993 as iso

    pressure = air_pressure / 1000  # that library counts in kPa
    saturation = iso.saturation_pressure(air_temperature)
    water = iso.molar_concentration_water_vapour(relative_humidity * 100, saturation, pressure)
    oxygen = iso.relaxation_frequency_oxygen(pressure, water)
    nitrogen = iso.relaxation_frequency_nitrogen(pressure, air_temperature, water)
    decibel = iso.attenuation_coefficient(
        pressure,
        air_temperature,
        iso.REFERENCE_PRESSURE,
        iso.REFERENCE_TEMPERATURE,
        nitrogen,
        oxygen,
        frequency,
    )
    return np.asarray(decibel) * (np.log(10) / 20)


QUANTITIES = (sound_speed, density, air_attenuation)
