"""Rows of measured tables beside a model: what is left of each, over one operating variable and coloured by another."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from specan.arrays import Real
from specan.models import Model
from specan.models.rates import TIME
from specan.report.panels import Curve, Panel
from specan.report.residual_map import axis_text, plot_axes
from specan.study.comparison import readings
from specan.study.observation import Variable
from specan.study.observation.table import TableObservation
from specan.units import axis_label

MOST_COLOURS = 6  # levels that get a colour each


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of one or several tables.

    Attributes
    ----------
    frame : DataFrame
        ``observable``, ``measured``, ``model`` and ``u``.
    levels : DataFrame
        Level of each operating variable that varies, which may have any name.
    read : DataFrame
        Operating variables as they were read: beside their level where a brake misses its set value.
    axes : tuple of str
        Operating variables that vary, the best abscissa first; the number of the row where none does.
    known : bool
        Whether the uncertainties are known.
    variables : mapping
        Words and units of the operating variables.
    units : mapping of str to str
        Of the observables.
    """

    frame: pd.DataFrame
    levels: pd.DataFrame
    read: pd.DataFrame
    axes: tuple[str, ...]
    known: bool
    variables: Mapping[str, Variable]
    units: Mapping[str, str]

    def at(self, places: Any) -> Rows:
        """Those at some places: a mask or a slice."""
        frame, levels, read = (one[places] for one in (self.frame, self.levels, self.read))
        return replace(self, frame=frame, levels=levels, read=read)

    def of(self, observable: str) -> Rows:
        """Those of one observable, in one unit."""
        return self.at(self.frame["observable"] == observable)

    def panel(self, kind: str, x: str, hue: str) -> Panel:
        """A point for each row, over `x` and in the colour of its level of `hue`, if one is named.

        `kind` is ``z``, in standard uncertainties, ``residual``, or ``pair``: what the model says.
        """
        frame, first = self.frame, str(self.frame["observable"].iloc[0])
        left = frame["measured"] - frame["model"]
        reach = 2 * float(frame["u"].median()) if self.known else 0.0
        values, marks, label = {
            "z": (
                left / frame["u"],
                (-2.0, 0.0, 2.0),
                f"(Measured - model) / {'sigma' if self.known else '1 % of it'}",
            ),
            "residual": (
                left,
                tuple({-reach, 0.0, reach}),
                axis_label(f"{first.capitalize()}, measured - model", self.units[first]),
            ),
            "pair": (frame["model"], (), axis_label(first.capitalize(), self.units[first])),
        }[kind]
        named = {name: axis_text(name, self.variables) for name in self.axes}
        said = frame.assign(z=left / frame["u"]).to_dict("records")
        about = [
            ", ".join(
                f"{named.get(n, n)} {v:.5g}" if isinstance(v, float) else str(v)
                for n, v in (*level.items(), *row.items())
            )
            for level, row in zip(self.levels.to_dict("records"), said, strict=True)
        ]
        curves = [
            Curve(text, self.read[x].to_numpy()[at], values.to_numpy()[at], about=tuple(about[k] for k in at))
            for text, at in self.groups(hue)
        ]
        return Panel(label, tuple(curves), kind="rows", marks=marks)

    def groups(self, hue: str) -> Iterator[tuple[str, NDArray[np.int64]]]:
        """Text and rows of each level of a variable; many levels go into classes of even counts. Without one, all."""
        if not hue:
            yield "", np.arange(len(self.frame))
            return
        values = self.levels[hue].reset_index(drop=True)
        numbers = values.dtype.kind in "fiu"
        if numbers and values.nunique() > MOST_COLOURS:
            values = pd.qcut(values, MOST_COLOURS, duplicates="drop")
        for level, at in values.groupby(values, observed=True).groups.items():
            text = f"{level.left:.4g} to {level.right:.4g}" if isinstance(level, pd.Interval) else level
            yield f"{text:g}" if isinstance(text, float) else str(text), np.asarray(at)


def table_rows(
    model: Model, tables: Sequence[TableObservation], predicted: Sequence[Real], known: bool
) -> Rows:
    """Rows of tables with what a model predicts for each."""
    names = [n for n in tables[0].labels if n != "measurement" and all(n in o.labels for o in tables)]
    levels, read = (
        pd.concat([pd.DataFrame({name: of(o, name) for name in names}) for o in tables], ignore_index=True)
        for of in (lambda o, name: o.labels[name], lambda o, name: readings(model, o, name))
    )
    values = [
        pd.DataFrame({"observable": o.observable, "measured": o.measured, "model": p, "u": o.sigma})
        for o, p in zip(tables, predicted, strict=True)
    ]
    frame = pd.concat(values, ignore_index=True)
    axes = plot_axes({name: levels[name].to_numpy() for name in names})
    variables = {TIME: Variable("time", "s"), **tables[0].variables}
    if not axes:
        x = TIME if TIME in tables[0].conditions else "row"
        read = pd.DataFrame({x: np.concatenate([o.conditions.get(x, 1.0 + np.arange(o.n)) for o in tables])})
        axes, levels = [x], pd.concat([levels, read], axis=1)
    units = {name: observable.unit for name, observable in model.observables.items()}
    return Rows(frame, levels, read, tuple(axes), known, variables, units)
