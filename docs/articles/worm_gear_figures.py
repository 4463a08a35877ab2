"""Figures of the article on the worm gear (4 to 7), with effects as on the command line and with measurements.

``python docs/articles/worm_gear_figures.py RIG.toml NUMBER FIGURE.png [--measurement TABLE.csv] [--set KEY=VALUE]
[-e EFFECT] [--without EFFECT]`` draws one.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from specan.models.catalogue import load_model, read_rig_file
from specan.models.chosen_model import ChosenModel, choose_model, grid, override, span
from specan.report.figure_style import COLOURS, heading, new_figure, save_figure, styled
from specan.study.data.table_file import read_table
from specan.worm_gear.model.simulated_table import simulated_table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Columns = Mapping[str, NDArray[np.float64]]
SPEEDS = (1200.0, 1500.0, 2000.0, 2400.0, 2800.0)  # the article's table 6


@styled
def figure(number: int, chosen: ChosenModel, measured: Columns | None = None) -> Figure:
    """4: efficiency over output torque, one curve a speed. 5: the same at 1500 and 2000 r/min.

    6: input torque over speed without load. 7: viscosity over temperature.
    """
    sheet = new_figure(4.2, 6.4)
    FIGURES[number](sheet.subplots(), chosen, measured or {})
    return sheet


def _predicted(chosen: ChosenModel, **axes: Any) -> Columns:
    return simulated_table(chosen, grid(chosen.assembly.model, axes))


def _curves_over_torque(
    axes: Axes, chosen: ChosenModel, measured: Columns, speeds: tuple[float, ...]
) -> None:
    low, high = span(chosen.assembly.model, "indicated_output_torque")
    torques = np.linspace(max(low, 0.01 * high), high, 120)
    for i, speed in enumerate(speeds):
        rows = _predicted(chosen, speed_rpm=[speed], output_torque_Nm=torques)
        axes.plot(torques, 100 * rows["efficiency"], color=COLOURS[i], label=f"{speed:g} r/min")
        at = _rows_at(measured, speed)
        if at is not None and "efficiency" in measured:
            axes.plot(
                measured["output_torque_Nm"][at],
                100 * measured["efficiency"][at],
                "o",
                color=COLOURS[i],
                mfc="none",
            )
    axes.set(xlabel="Output torque / Nm", ylabel="Efficiency / %", xlim=(0, high))
    axes.legend(title="points: measured" if measured else None)


def _rows_at(measured: Columns, speed: float) -> NDArray[np.bool_] | None:
    if "speed_rpm" not in measured:
        return None
    at = np.isclose(measured["speed_rpm"], speed, rtol=0.01)
    return at if at.any() else None


def _efficiency_at_all_speeds(axes: Axes, chosen: ChosenModel, measured: Columns) -> None:
    _curves_over_torque(axes, chosen, measured, SPEEDS)
    heading(axes.figure, "Efficiency over output torque")


def _efficiency_at_two_speeds(axes: Axes, chosen: ChosenModel, measured: Columns) -> None:
    _curves_over_torque(axes, chosen, measured, (1500.0, 2000.0))
    temperature = chosen.assembly.model.conditions["indicated_oil_temperature"].default
    heading(axes.figure, "Efficiency over output torque", f"Oil at {temperature:g} °C")


def _idle_torque(axes: Axes, chosen: ChosenModel, measured: Columns) -> None:
    low, high = span(chosen.assembly.model, "worm_speed")
    speeds = np.linspace(low, high, 120)
    rows = _predicted(chosen, speed_rpm=speeds, output_torque_Nm=[0.0])
    axes.plot(speeds, rows["input_torque_Nm"], label="model")
    if "input_torque_Nm" in measured:
        idle = measured.get("output_torque_Nm", np.zeros(measured["speed_rpm"].size)) == 0
        axes.plot(
            measured["speed_rpm"][idle], measured["input_torque_Nm"][idle], "ko", mfc="none", label="measured"
        )
    axes.set(xlabel="Input speed / r/min", ylabel="Input torque / Nm")
    heading(axes.figure, "Input torque without load")
    axes.set_ylim(bottom=0)
    axes.legend()


def _viscosity(axes: Axes, chosen: ChosenModel, measured: Columns) -> None:
    temperatures = np.linspace(0.0, 110.0, 120)
    conditions = {"indicated_oil_temperature": temperatures + 273.15, "worm_speed": 1e-6}
    known = chosen.assembly.evaluate(conditions, chosen.values, wanted=["kinematic_viscosity"])
    axes.semilogy(temperatures, 1e6 * known["kinematic_viscosity"])
    axes.set(xlabel="Temperature / °C", ylabel="Kinematic viscosity / mm²/s")
    heading(axes.figure, "Viscosity of the oil")
    axes.grid(True, which="both")
    axes.yaxis.set_major_formatter("{x:g}")


FIGURES: dict[int, Callable[[Any, ChosenModel, Columns], None]] = {
    4: _efficiency_at_all_speeds,
    5: _efficiency_at_two_speeds,
    6: _idle_torque,
    7: _viscosity,
}


def main() -> None:
    """Draw a figure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rig", type=Path)
    parser.add_argument("number", type=int, choices=FIGURES)
    parser.add_argument("picture", type=Path)
    parser.add_argument("--measurement", type=Path)
    for option in ("--set", "-e", "--without"):
        parser.add_argument(option, action="append", default=[])
    given = parser.parse_args()
    model = load_model("worm-gear", override(read_rig_file(given.rig), given.set))
    frame = read_table(given.measurement).frame if given.measurement else {}
    measured = {name: frame[name].to_numpy() for name in frame}
    save_figure(figure(given.number, choose_model(model, given.e, given.without), measured), given.picture)


if __name__ == "__main__":
    main()
