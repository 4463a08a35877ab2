"""A porous layer on a rigid wall as oscillators side by side, which time can march.

The air in the pores has a mass, a flow resistance and a spring (Zwikker and Kosten, Sound Absorbing Materials, 1949,
ch. 2, with constant flow resistance; isothermal, because the frame holds the temperature at low frequencies). With
the impedance z = sigma + j w m of a metre and the admittance y = j w C of a metre, a layer of thickness d takes

    Y = y d tanh(x) / x,    x^2 = z y d^2,    tanh(x) / x = sum_n 2 / (x^2 + a_n^2),  a_n = (n + 1/2) pi,

so that each term is a mass, a resistance and a spring in series: Z_n = (z d + a_n^2 / (y d)) / 2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from truth.room.branch import Motion

POROSITY, STRUCTURE = 0.97, 1.3  # of fibrous materials: open part, and how much heavier the air in it seems
STATIC_PRESSURE = 101325.0
_EXACT = (np.pi * np.array([0.5, 1.5])) ** 2  # a_n^2 of the resonances that are taken as they are
_REST = 1.0 - np.sum(2.0 / _EXACT)  # of the spring's yield: sum of 2 / a_n^2 over all n is 1
_REST_LOSS = 1.0 / 3.0 - np.sum(2.0 / _EXACT**2)  # of its losses: sum of 2 / a_n^4 is 1/3
_REST_MASS = 0.5  # of the pores' air; with less the highest resonance would need a finer time step


@dataclass(frozen=True)
class Layer:
    """Thickness in metres, flow resistivity in Pa s/m^2."""

    thickness_m: float
    flow_resistivity: float


def layer_motions(layer: Layer, density: float) -> list[Motion]:
    """The two lowest resonances of the layer, and all higher ones together, which are a spring within the band."""
    d = layer.thickness_m
    mass = STRUCTURE * density / POROSITY * d
    resistance = layer.flow_resistivity * d
    spring = STATIC_PRESSURE / POROSITY / d
    exact = [Motion(mass / 2.0, resistance / 2.0, float(a2) * spring / 2.0) for a2 in _EXACT]
    rest = Motion(_REST_MASS * mass, float(_REST_LOSS / _REST**2) * resistance, spring / float(_REST))
    return [*exact, rest]
