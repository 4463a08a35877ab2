"""The air: speed of sound, density, attenuation by ISO 9613-1:1993."""

from __future__ import annotations

import numpy as np

from specan.models.quantity import quantity

ZERO_CELSIUS = 273.15  # K
GAS_CONSTANT_AIR = 287.05  # J/(kg K), dry air
REFERENCE_K, TRIPLE_POINT_K, REFERENCE_PA = 293.15, 273.16, 101325.0
# Relaxation terms of eq. 5: factor (s/m) and temperature (K) of oxygen and nitrogen.
RELAXATIONS = ((0.01275, 2239.1), (0.1068, 3352.0))


@quantity(unit="K")
def air_temperature(nominal_air_temperature, temperature_difference):
    """Temperature of the air; a recording may differ from the rig's nominal one."""
    return nominal_air_temperature + temperature_difference


@quantity(unit="m/s", reference="ISO 9613-1:1993, eq. A.5: c = 343.2 sqrt(T / 293.15)")
def sound_speed(air_temperature):
    """Speed of sound below all relaxation."""
    return 343.2 * np.sqrt(air_temperature / REFERENCE_K)


@quantity(unit="kg/m^3")
def density(air_temperature, air_pressure):
    """Density of dry air, an ideal gas."""
    return air_pressure / (GAS_CONSTANT_AIR * air_temperature)


@quantity(unit="1/m", reference="ISO 9613-1:1993, eq. 5")
def air_attenuation(frequency, air_temperature, air_pressure, relative_humidity):
    """Attenuation of the sound pressure in air, Np/m."""
    warmth, pressure = air_temperature / REFERENCE_K, air_pressure / REFERENCE_PA
    total = 1.84e-11 / pressure * np.sqrt(warmth)
    for relaxation_hz, (factor, characteristic) in zip(
        relaxations_hz(air_temperature, air_pressure, relative_humidity), RELAXATIONS, strict=True
    ):
        strength = factor * np.exp(-characteristic / air_temperature) * warmth**-2.5
        total = total + strength / (relaxation_hz + np.square(frequency) / relaxation_hz)
    return 8.686 * np.square(frequency) * total * (np.log(10) / 20)


@quantity(unit="1", reference="Morfey and Howell, J. Acoust. Soc. Am. 68 (1980) 1525")
def air_dispersion(frequency, sound_speed, air_temperature, air_pressure, relative_humidity):
    """How much faster sound is than at low frequencies: what relaxes takes no part in fast oscillations.

    A process whose attenuation per wavelength reaches m (Np) at its relaxation frequency f_r raises the speed by the
    part ``(m / pi) x^2 / (1 + x^2)``, x = f / f_r (Kramers and Kronig's relations); in ISO 9613-1 m is half the
    factor of the process times the speed of sound: 6e-5 for nitrogen at 20 degC.
    """
    total = np.zeros(len(frequency))
    for relaxation_hz, (factor, characteristic) in zip(
        relaxations_hz(air_temperature, air_pressure, relative_humidity), RELAXATIONS, strict=True
    ):
        strength = (
            factor * np.exp(-characteristic / air_temperature) * (air_temperature / REFERENCE_K) ** -2.5
        )
        x2 = (frequency / relaxation_hz) ** 2
        total += strength * sound_speed / (2 * np.pi) * x2 / (1 + x2)
    return total


def relaxations_hz(temperature: float, pressure: float, humidity: float) -> tuple[float, float]:
    """Relaxation frequencies of oxygen and nitrogen (eqs 3, 4, B.2, B.3)."""
    warmth, pressure = temperature / REFERENCE_K, pressure / REFERENCE_PA
    saturation = 10 ** (-6.8346 * (TRIPLE_POINT_K / temperature) ** 1.261 + 4.6151)
    water = 100 * humidity * saturation / pressure  # molar concentration, percent
    oxygen = pressure * (24.0 + 4.04e4 * water * (0.02 + water) / (0.391 + water))
    nitrogen = pressure * warmth**-0.5 * (9.0 + 280.0 * water * np.exp(-4.170 * (warmth ** (-1 / 3) - 1.0)))
    return float(oxygen), float(nitrogen)


QUANTITIES = (air_temperature, sound_speed, density, air_attenuation, air_dispersion)
