"""Natural frequencies of a planetary gear whose parts turn only."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from specan.models.model import Model


def torsional_frequencies(model: Model) -> NDArray[np.float64]:
    """Natural frequencies, Hz, of the set as it is fitted: parts turn only, the sun turns steadily, the ring is fixed.

    Meshes have their mean stiffness at the rig file's speed and torque. Planets that move alike take the carrier with
    them (two modes); against each other they leave it where it is (as many modes as planets less one).

    Parameters
    ----------
    model : Model
        Of a planetary set, as `build` makes it.
    """
    operation = model.settings["parsed_rig"].operation
    at = {"order": np.ones(1), "sun_speed": np.full(1, operation.sun_speed_hz),
          "carrier_torque": np.full(1, operation.carrier_torque_Nm)}  # fmt: skip
    wanted = ["mesh_spring", "carrier_inertia", "planet_inertia", "base_radii"]
    found = model.assemble(model.base_effects).evaluate(at, None, wanted)
    stiffness, (sun, planet, ring) = found["mesh_spring"][0].mean(axis=(-2, -1)), found["base_radii"]
    planets = found["mesh_spring"].shape[-2]
    # Approach of the sun and of the ring mesh by a turn of the carrier and of a planet.
    geometry = np.array([[sun + planet, planet], [ring - planet, -planet]])
    one = geometry.T @ (stiffness[:, None] * geometry)  # of one planet with its part of the carrier
    together = one / np.array([found["carrier_inertia"] / planets, found["planet_inertia"]])[:, None]
    squares = [*np.linalg.eigvals(together).real, *[one[1, 1] / found["planet_inertia"]] * (planets - 1)]
    return np.sort(np.sqrt(np.maximum(squares, 0.0)) / (2 * np.pi))
