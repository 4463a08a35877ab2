"""Whether the mesh of the teeth that a rig file states is in a recording; if not, which other teeth have its lines."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from itertools import product

import numpy as np
from scipy.ndimage import median_filter

from specan.analysis.orders import Orders
from specan.arrays import Real
from specan.data.orders import OrderSpectrum
from specan.errors import InputError, RequestError
from specan.planetary_gear.model.geometry import check_assembly
from specan.planetary_gear.model.kinematics import carrier_speed_ratio, mesh_line_strength
from specan.planetary_gear.model.rig import Gear

ABOUT, PLANETS = 15, range(3, 8)  # sets that are looked at: teeth more or fewer of sun and planet; planets
BACKGROUND = 2.0  # orders whose median is the noise, since lines lie at whole ones
HEARD = 0.25  # of the lines of a mesh: paths and resonances leave few
# Power of a line over that of the noise: up to 120 dB, each ratio as probable.
LN_RANGE = np.log(np.log(1e12))


def check_teeth(found: OrderSpectrum, settings: Orders, gear: Gear) -> list[str]:
    """Refuse a recording whose lines are those of the mesh of other teeth; say so where no mesh is to be seen.

    Parameters
    ----------
    found : OrderSpectrum
        Per turn of the carrier, of the whole recording at once.
    settings : Orders
        The ratio is not 1 where the tacho is the sun's.
    gear : Gear

    Raises
    ------
    InputError
        It says which teeth have the lines that are there.
    """
    fine = _over_noise(found)
    if _evidence(*fine, gear) > 0:
        return []
    of_sets = {}
    for one in _sets(gear):
        stretch = 1.0 if settings.ratio == 1.0 else carrier_speed_ratio(one) / carrier_speed_ratio(gear)
        of_sets[_named(one)] = _evidence(*fine, one, stretch)
    best = max(of_sets.values())
    alike = [name for name, evidence in of_sets.items() if evidence > best - np.log(100)]
    nothing = f"no line of the tooth mesh of {_named(gear)} stands out of the noise"
    if best < np.log(len(of_sets)):
        return [nothing]
    raise InputError(
        f"{found.label}: {nothing}, while those of {' or '.join(alike[:3])} do",
        expected="the teeth (sun/planet/ring) and planets of the machine that was recorded",
        remedy=f"check [gear] of the rig file, and the pulses per turn of {settings.tacho}",
    )


def _named(gear: Gear) -> str:
    return f"{gear.z_sun}/{gear.z_planet}/{gear.z_ring} with {gear.planets} planets"


def _sets(gear: Gear) -> Iterator[Gear]:
    """Sets near this one that can be put together, with planets at equal angles."""
    away = range(-ABOUT, ABOUT + 1)
    for sun, planet, planets in product(away, away, PLANETS):
        sun, planet = gear.z_sun + sun, gear.z_planet + planet
        if min(sun, planet) < 6 or 2 * (sun + planet) % planets:
            continue
        change = {"z_sun": sun, "z_planet": planet, "z_ring": sun + 2 * planet, "planets": planets}
        one = gear.model_copy(update={**change, "centre_distance_mm": None, "planet_angles_deg": None})
        with suppress(RequestError):
            check_assembly(one)
            yield one


def _evidence(order: Real, over_noise: Real, gear: Gear, stretch: float = 1.0) -> float:
    """ln of the evidence that the mesh of a set is in a spectrum, whose turns are `stretch` of its carrier's.

    The background has tones of its own: its power over the median, s, has the density 1 / (1 + s)^2, that of a line
    1 / (1 + s) over the range of what lines may have. Of the lines that the ideal set has next to harmonics of the
    mesh one in four is heard.
    """
    middle = gear.z_ring * np.arange(1, 1 + int(order[-1] / stretch / gear.z_ring))
    near = np.unique(middle[:, None] + np.arange(-gear.planets, gear.planets + 1))
    lines = near[mesh_line_strength(gear, near) > 0.5] * stretch
    number = np.rint(lines[lines < order[-2]] / order[1]).astype(int)
    gain = np.log1p(over_noise[:, number]) - LN_RANGE
    return float(np.sum(np.log(HEARD * np.exp(gain) + 1 - HEARD)))


def _over_noise(spectrum: OrderSpectrum) -> tuple[Real, Real]:
    """Orders, and the power of each with its neighbours over that of the noise, (channels, orders)."""
    power = np.nan_to_num(spectrum.amplitude) ** 2
    bins = 2 * int(BACKGROUND / spectrum.order[1] / 2) + 1
    noise = median_filter(power, size=(1, bins)) / np.log(2)
    strongest = np.maximum(power, np.maximum(np.roll(power, 1, axis=1), np.roll(power, -1, axis=1)))
    return spectrum.order, np.where(noise > 0, strongest / np.where(noise > 0, noise, 1.0), 0.0)
