"""Figures of a worm gear: those of the article (4 to 7 and 11) for any rig, with measurements over them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from specan.errors import RequestError
from specan.models.chosen_model import ChosenModel, grid
from specan.report.figure_style import COLOURS, heading, new_figure, styled
from specan.units import convert
from specan.worm_gear.model.simulated_table import simulated_table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Columns = Mapping[str, NDArray[np.float64]]
SPEEDS = (1200.0, 1500.0, 2000.0, 2400.0, 2800.0)  # the article's table 6
SIZE = (6.4, 4.2)


@styled
def figure(number: int, chosen: ChosenModel, measured: Columns | None = None) -> Figure:
    """Draw one of the article's figures for a model.

    Parameters
    ----------
    number : int
        4: efficiency over output torque, one curve a speed. 5: the same at 1500 and 2000 r/min. 6: input torque
        over speed without load. 7: viscosity over temperature. 11: map of the efficiency over speed and torque.
    measured : mapping, optional
        Columns of a table, drawn as points where they belong into the figure.

    Raises
    ------
    RequestError
        There is no such figure.
    """
    if number not in FIGURES:
        known = ", ".join(map(str, FIGURES))
        raise RequestError(f"there is no figure {number} of the worm gear", expected=f"one of {known}")
    sheet = new_figure(SIZE[1], SIZE[0])
    FIGURES[number](sheet.subplots(), chosen, measured or {})
    return sheet


def _span(chosen: ChosenModel, condition: str) -> tuple[float, float]:
    """Limits of the bench in the unit of the table's column."""
    known = chosen.assembly.model.conditions[condition]
    low, high = chosen.assembly.model.rig.limits[condition]
    return (
        float(convert(low, known.unit, known.column_unit)),
        float(convert(high, known.unit, known.column_unit)),
    )


def _predicted(chosen: ChosenModel, **axes: Any) -> Columns:
    return simulated_table(chosen, grid(chosen.assembly.model, axes))


def _curves_over_torque(
    axes: Axes, chosen: ChosenModel, measured: Columns, speeds: tuple[float, ...]
) -> None:
    low, high = _span(chosen, "indicated_output_torque")
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
    low, high = _span(chosen, "worm_speed")
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


def _efficiency_map(axes: Axes, chosen: ChosenModel, measured: Columns) -> None:
    speeds = np.linspace(*_span(chosen, "worm_speed"), 60)
    low, high = _span(chosen, "indicated_output_torque")
    torques = np.linspace(max(low, 0.02 * high), high, 60)
    rows = _predicted(chosen, speed_rpm=speeds, output_torque_Nm=torques)
    shape = (speeds.size, torques.size)
    x, y, z = (rows[n].reshape(shape) for n in ("speed_rpm", "output_torque_Nm", "efficiency"))
    filled = axes.contourf(x, y, 100 * z, levels=20, cmap="viridis")
    lines = axes.contour(x, y, 100 * z, levels=[50, 60, 70, 80, 85, 90, 95], colors="k", linewidths=0.6)
    axes.clabel(lines, fmt="%g %%")
    bar = axes.figure.colorbar(filled, ax=axes)
    bar.set_label("Efficiency / %")
    if "speed_rpm" in measured and "output_torque_Nm" in measured:
        axes.plot(measured["speed_rpm"], measured["output_torque_Nm"], "w.", ms=4)
    axes.set(xlabel="Input speed / r/min", ylabel="Output torque / Nm")
    heading(axes.figure, "Efficiency of the worm gear")


FIGURES: dict[int, Callable[[Any, ChosenModel, Columns], None]] = {
    4: _efficiency_at_all_speeds,
    5: _efficiency_at_two_speeds,
    6: _idle_torque,
    7: _viscosity,
    11: _efficiency_map,
}
