"""The table that a test bench would write if the gear were as the model says."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from specan.models.chosen_model import ChosenModel, Columns
from specan.models.chosen_model import simulated_table as measured_table


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
    found = measured_table(chosen, columns, noise=noise, repeats=repeats, seed=seed)
    torque = found["input_torque_Nm"]
    ideal = found["output_torque_Nm"] / float(
        chosen.assembly.evaluate({}, wanted=["gear_ratio"])["gear_ratio"]
    )
    loss = (torque - ideal) * found["speed_rpm"] * np.pi / 30
    return found | {"efficiency": ideal / torque, "power_loss_W": loss}  # what noise the torque has
