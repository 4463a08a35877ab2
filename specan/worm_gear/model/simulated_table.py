"""The table that a test bench would write if the gear were as the model says."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.models.chosen_model import ChosenModel, Columns
from specan.models.chosen_model import simulated_table as measured_table


def simulated_table(
    chosen: ChosenModel, columns: Mapping[str, NDArray[np.float64]], **settings: Any
) -> Columns:
    """Conditions, input torque, efficiency and power loss, one row a reading.

    Parameters
    ----------
    columns : mapping
        Columns of the conditions, in their own units (speed_rpm, output_torque_Nm, ...).
    settings
        ``noise`` of the input torque (N*m), ``repeats`` and ``seed``, as of any table that a model simulates.
    """
    found = measured_table(chosen, columns, **settings)
    torque = found["input_torque_Nm"]
    ratio = float(chosen.assembly.evaluate({}, wanted=["gear_ratio"])["gear_ratio"])
    ideal = found["output_torque_Nm"] / ratio
    loss = (torque - ideal) * found["speed_rpm"] * np.pi / 30
    return found | {"efficiency": ideal / torque, "power_loss_W": loss}  # what noise the torque has
