"""The table that a test bench would write if the gear were as the model says."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from specan.models.chosen_model import ChosenModel
from specan.models.prediction import Columns, predict


def simulated_table(
    chosen: ChosenModel,
    columns: Mapping[str, NDArray[np.float64]],
    *,
    noise: float = 0.0,
    repeats: int = 1,
    seed: int = 0,
) -> Columns:
    """Conditions, input torque, efficiency and power loss, one row a reading.

    Parameters
    ----------
    columns : mapping
        Columns of the conditions, in their own units (speed_rpm, output_torque_Nm, ...).
    noise : float
        Standard deviation of one reading of the input torque in N*m, normal and independent.
    repeats : int
        Readings of each condition, numbered in a column ``repeat`` where there are several.
    seed : int
        Of the noise.
    """
    rows = {name: np.tile(np.asarray(values, float), repeats) for name, values in columns.items()}
    size = len(next(iter(columns.values())))
    torque = predict(chosen, rows)["input_torque"]
    torque = torque + noise * np.random.default_rng(seed).standard_normal(torque.size)
    ratio = float(chosen.assembly.evaluate({}, wanted=["gear_ratio"])["gear_ratio"])
    ideal = rows["output_torque_Nm"] / ratio
    found = {
        **rows,
        "input_torque_Nm": torque,
        "efficiency": ideal / torque,
        "power_loss_W": (torque - ideal) * rows["speed_rpm"] * np.pi / 30,
    }
    if repeats > 1:
        found["repeat"] = np.repeat(np.arange(1.0, repeats + 1), size)
    return found
