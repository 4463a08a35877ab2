"""What sound loses in air of 20 degC and 101.325 kPa: nitrogen relaxes within the band, the rest does so above it."""

from __future__ import annotations

from dataclasses import dataclass

# Vibrational specific heat of nitrogen as a part of the modulus (ISO 9613-1, eq. 5: 0.1068 exp(-3352 K / T) for the
# attenuation over f^2; c / pi times that here).
NITROGEN = 1.27e-4
_WATER_PERCENT = (
    0.02308  # molar concentration of water vapour per percent of humidity: saturation over static pressure
)
_CLASSICAL_S = 3.2e-10  # attenuation over w^2 / (2 c) by viscosity, conduction and rotation
_OXYGEN = 6.1e-6 * 343.2 * 2.0 / (2.0 * 3.14159265) ** 2  # likewise by oxygen, times its relaxation frequency


@dataclass(frozen=True)
class Air:
    """Relaxation frequency of nitrogen, and the time constant of what grows with the square of frequency."""

    nitrogen_hz: float
    viscous_s: float

    @classmethod
    def at_humidity(cls, percent: float) -> Air:
        """Relaxation frequencies of ISO 9613-1:1993, eqs 3 and 4.

        >>> round(Air.at_humidity(50.0).nitrogen_hz)
        332
        """
        water = _WATER_PERCENT * percent
        nitrogen = 9.0 + 280.0 * water
        oxygen = 24.0 + 4.04e4 * water * (0.02 + water) / (0.391 + water)
        return cls(nitrogen, _CLASSICAL_S + _OXYGEN / oxygen)
