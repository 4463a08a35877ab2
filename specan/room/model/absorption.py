"""Absorption coefficients of a locally reacting wall, from its specific admittance ``beta = rho c / Z``."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from specan.arrays import Real

_THIN = 1e-4  # of an imaginary part, below which its share is taken at zero


def normal_absorption(beta: ArrayLike) -> Real:
    """Absorption coefficient at normal incidence, ``1 - |r|^2`` with ``r = (1 - beta)/(1 + beta)`` (ISO 10534-2).

    Examples
    --------
    >>> normal_absorption([1.0, 0.1, 0.1j]).round(3).tolist()
    [1.0, 0.331, 0.0]
    """
    beta = np.asarray(beta, dtype=complex)
    found: Real = 4 * beta.real / np.abs(1 + beta) ** 2
    return found


def diffuse_absorption(beta: ArrayLike) -> Real:
    r"""Absorption coefficient in a diffuse field, the mean over all angles of incidence (Paris).

    .. math:: \alpha = 2 \int_0^1 \frac{4 \mu \, \mathrm{Re} \beta}{|\mu + \beta|^2} \mu \, \mathrm{d}\mu
       = 8 g \left[1 - g \ln\frac{(1+g)^2 + b^2}{g^2 + b^2}
       + \frac{g^2 - b^2}{b} \left(\arctan\frac{1+g}{b} - \arctan\frac{g}{b}\right)\right],

    with beta = g + j b and mu the cosine of the angle (Kuttruff, Room Acoustics, ch. 2, the uniformly
    random incidence of a locally reacting wall; Paris, Philos. Mag. 5, 1928). At most 0.95, for a real
    admittance of 0.64.

    Examples
    --------
    >>> diffuse_absorption([0.64, 0.01]).round(3).tolist()
    [0.951, 0.073]
    """
    beta = np.asarray(beta, dtype=complex)
    g, b = beta.real, np.abs(beta.imag)
    thin = b < _THIN * np.maximum(g, 1e-12)
    safe = np.where(thin, 1.0, b)
    turned = np.arctan((1 + g) / safe) - np.arctan(g / safe)
    with np.errstate(all="ignore"):
        sideways = np.where(thin, g / (1 + g), (g**2 - b**2) / safe * turned)
        log = np.log(((1 + g) ** 2 + b**2) / (g**2 + b**2))
        found = 8 * g * (1 - g * log + sideways)
    return np.where(g == 0, 0.0, found)
