"""The air: speed of sound, density, attenuation."""

from __future__ import annotations

import numpy as np

from specan.models.quantity import quantity

ZERO_CELSIUS = 273.15  # K
GAS_CONSTANT_AIR = 287.05  # J/(kg K), dry air
ATMOSPHERE, WARM, TRIPLE_POINT = 101.325, 293.15, 273.16  # kPa, K, K: what ISO 9613-1 refers to


@quantity(unit="K")
def air_temperature(nominal_air_temperature, temperature_difference):
    """Temperature of the air; a recording may differ from the rig's nominal one."""
    return nominal_air_temperature + temperature_difference


@quantity(unit="m/s", reference="ISO 9613-1:1993, eq. A.5: c = 343.2 sqrt(T / 293.15)")
def sound_speed(air_temperature):
    """Speed of sound below all relaxation."""
    return 343.2 * np.sqrt(air_temperature / WARM)


@quantity(unit="kg/m^3")
def density(air_temperature, air_pressure):
    """Density of dry air, an ideal gas."""
    return air_pressure / (GAS_CONSTANT_AIR * air_temperature)


# Relaxation of oxygen and nitrogen: factor (s/m) and temperature (K) of ISO 9613-1:1993, eq. 5.
RELAXATIONS = ((0.01275, 2239.1), (0.1068, 3352.0))


@quantity(unit="1/m", reference="ISO 9613-1:1993, eq. 5")
def air_attenuation(frequency, air_temperature, air_pressure, relative_humidity):
    """Attenuation of the sound pressure in air, Np/m."""
    warm = air_temperature / WARM
    relaxing = sum(
        factor * np.exp(-kelvin / air_temperature) * (hertz + frequency**2 / hertz) ** -1.0
        for (factor, kelvin), hertz in zip(
            RELAXATIONS, _hertz(air_temperature, air_pressure, relative_humidity)
        )
    )
    classical = 1.84e-11 * (ATMOSPHERE / (air_pressure / 1000)) * warm**0.5
    decibel = 8.686 * frequency**2 * (classical + warm**-2.5 * relaxing)
    return decibel * (np.log(10) / 20)


@quantity(unit="1", reference="Morfey and Howell, J. Acoust. Soc. Am. 68 (1980) 1525")
def air_dispersion(frequency, sound_speed, air_temperature, air_pressure, relative_humidity):
    """How much faster sound is than at low frequencies: what relaxes takes no part in fast oscillations.

    A process whose attenuation per wavelength reaches m (Np) at its relaxation frequency f_r raises the speed by the
    part ``(m / pi) x^2 / (1 + x^2)``, x = f / f_r (Kramers and Kronig's relations); in ISO 9613-1 m is half the
    factor of the process times the speed of sound: 6e-5 for nitrogen at 20 degC.
    """
    total = np.zeros(len(frequency))
    hertz = _hertz(air_temperature, air_pressure, relative_humidity)
    for (factor, kelvin), relaxation_hz in zip(RELAXATIONS, hertz, strict=True):
        strength = factor * np.exp(-kelvin / air_temperature) * (air_temperature / WARM) ** -2.5
        x2 = (frequency / relaxation_hz) ** 2
        total += strength * sound_speed / (2 * np.pi) * x2 / (1 + x2)
    return total


def _hertz(temperature: float, pressure: float, humidity: float) -> tuple[float, float]:
    """Relaxation frequencies of oxygen and nitrogen (ISO 9613-1:1993, eqs 3 and 4; water by annex B)."""
    kilopascal, warm = pressure / 1000, temperature / WARM
    dense = kilopascal / ATMOSPHERE
    vapour = ATMOSPHERE * 10 ** (4.6151 - 6.8346 * (TRIPLE_POINT / temperature) ** 1.261)
    water = 100 * humidity * vapour / kilopascal  # per cent
    oxygen = dense * (24 + 4.04e4 * water * (0.02 + water) / (0.391 + water))
    return oxygen, dense * warm**-0.5 * (9 + 280 * water * np.exp(-4.170 * (warm ** (-1 / 3) - 1)))
