"""The efficiency map of a worm gear."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from specan.models.chosen_model import ChosenModel, grid, span
from specan.report.figure_style import heading, new_figure, styled
from specan.worm_gear.model.simulated_table import simulated_table


@styled
def efficiency_map(chosen: ChosenModel) -> Figure:
    """Efficiency over speed and output torque, within the limits of the bench."""
    model = chosen.assembly.model
    speeds = np.linspace(*span(model, "worm_speed"), 60)
    low, high = span(model, "indicated_output_torque")
    torques = np.linspace(max(low, 0.02 * high), high, 60)
    axes_of = {"speed_rpm": speeds.tolist(), "output_torque_Nm": torques.tolist()}
    rows = simulated_table(chosen, grid(model, axes_of))
    x, y, z = (rows[n].reshape(speeds.size, torques.size) for n in (*axes_of, "efficiency"))
    figure = new_figure(4.2, 6.4)
    axes = figure.subplots()
    levels = np.arange(5 * np.floor(20 * z.min()), 100 * z.max() + 2.5, 2.5)
    filled = axes.contourf(x, y, 100 * z, levels=levels, cmap="cividis")
    lines = axes.contour(x, y, 100 * z, levels=[50, 60, 70, 80, 85, 90, 95], colors="k", linewidths=0.6)
    axes.clabel(lines, fmt="%g %%")
    figure.colorbar(filled, ax=axes, ticks=range(0, 101, 10)).set_label("Efficiency / %")
    axes.set(xlabel="Input speed / rpm", ylabel="Output torque / N·m")
    oil = model.conditions["indicated_oil_temperature"]
    heading(figure, "Efficiency of the worm gear", f"Oil temperature {oil.default:g} °C")
    return figure
