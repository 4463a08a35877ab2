"""Recordings: transfer functions of chosen microphones, measured with their uncertainty, beside the model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from bokeh.layouts import column, row
from bokeh.models import MultiSelect

from specan.inspect.plots import WRAPPED, Band, Curve, Lines, plain
from specan.inspect.trial import Trial
from specan.report.figure_style import with_gaps
from specan.report.measured_transfer import MeasuredTransfer, level_dB, measured_transfer, phase_deg
from specan.study.observation.frf import FrfObservation
from specan.study.study import Study
from specan.units import printed_unit

_ALONE = (6, 1, 4)  # colours of measured, model and model before where one microphone is shown
_SHOWN = 1  # microphones at first: the one that the model misses most


class TransferAgreement:
    """Magnitude, phase, and the difference of the levels."""

    def __init__(self, study: Study) -> None:
        observations = study.data.fitted
        self._chosen = [k for k, o in enumerate(observations) if isinstance(o, FrfObservation)]
        recordings = [o for o in observations if isinstance(o, FrfObservation)]
        several = len(recordings) > 1
        self._keys = [
            (f"{number}/{name}", f"{name} · {o.name}" if several else name)
            for number, o in enumerate(recordings)
            for name in o.channels
        ]
        self._unit = study.model.observables[str(recordings[0].observable[0])].unit
        self._found: list[MeasuredTransfer] = []
        self._before: list[MeasuredTransfer] | None = None
        self._title, self._first = "", True
        self.microphones = MultiSelect(
            title="Microphones", options=[(key, plain(text)) for key, text in self._keys], value=[],
            size=min(max(len(self._keys), 4), 24), width=120, name="microphones",
            sizing_mode="stretch_height", stylesheets=["select[multiple].bk-input { height: 100% !important; }"],
        )  # fmt: skip
        self.microphones.on_change("value", lambda a, old, new: self._chosen_anew())
        self.changed: Callable[[tuple[str, ...]], None] = lambda chosen: None  # the page writes its address
        self.magnitude = Lines(
            "", "Magnitude\n/ dB", hertz=True, tip=("Hz", "dB"), dynamics=80.0, weight=3, named=False
        )
        self.phase = Lines(
            "", "Phase\n/ degrees", hertz=True, like=self.magnitude, limits=WRAPPED, weight=2, legend=False,
            named=False, tip=("Hz", "degrees"),
        )  # fmt: skip
        self.error = Lines(
            "Frequency / Hz", "Error\n/ dB", hertz=True, like=self.magnitude, weight=2, legend=False,
            tip=("Hz", "dB"), dynamics=40.0,
        )  # fmt: skip
        grows = {"flex": "1 1 0", "min-height": "0", "min-width": "0"}
        sheets = column(
            self.magnitude.sheet, self.phase.sheet, self.error.sheet, sizing_mode="stretch_both", styles=grows
        )
        self.body: Any = row(self.microphones, sheets, sizing_mode="stretch_both", styles=grows)

    def _chosen_anew(self) -> None:
        self._draw()
        self.changed(tuple(self.microphones.value))

    def choose(self, wanted: Sequence[str]) -> None:
        """Show these microphones; unknown ones are passed over."""
        self.microphones.value = [key for key, _ in self._keys if key in wanted]

    def show(self, trial: Trial) -> None:
        """Show another fit; a tried one is beside the model as it is."""
        found = [
            measured_transfer(o, trial.predictions[k])
            for k in self._chosen
            if isinstance(o := trial.problem.observations[k], FrfObservation)
        ]
        if trial.uses:
            self._before = self._before or self._found
        else:
            self._before = None
        self._found = found
        what = f" with {trial.name}" if trial.uses else ""
        self._title = f"Measured and model{what}: chi²/n {trial.fit.reduced_chi2:.2f}"
        f = found[0].frequency_hz[np.isfinite(found[0].measured).any(axis=0)]
        if trial.uses == () and self._first:
            self._first = False
            self.magnitude.span(float(f.min()), float(f.max()))
        if not self.microphones.value:
            worst = [f"0/{found[0].channels[k]}" for k in found[0].by_misfit()[:_SHOWN]]
            self.microphones.value = worst  # draws
        else:
            self._draw()

    def _draw(self) -> None:
        if not self._found:
            return
        levels: list[Curve] = []
        phases: list[Curve] = []
        errors: list[Curve] = []
        bands: list[tuple[Band, Band, Band]] = []
        shown = [(key, text) for key, text in self._keys if key in self.microphones.value]
        for place, (key, text) in enumerate(shown):
            number, _, name = key.partition("/")
            one = self._found[int(number)]
            k = one.channels.index(name)
            hues = _ALONE if len(shown) == 1 else (place,) * 3
            bands.append(_bands(one, k, hues[0]))
            models = [("model", one, 1)]
            if self._before is not None:
                models.append(("model before", self._before[int(number)], 2))
            responses = [("measured", one.measured[k], 0), *((what, o.model[k], d) for what, o, d in models)]
            for what, response, dash in responses:
                label = f"{text} {what}"
                levels.append(Curve(label, one.frequency_hz, level_dB(response), hues[dash], dash))
                phases.append(
                    Curve(label, one.frequency_hz, with_gaps(phase_deg(response)), hues[dash], dash)
                )
            errors += [
                Curve(f"{text} {what}", o.frequency_hz, o.error_dB[k], hues[d], d) for what, o, d in models
            ]
        shades = list(zip(*bands)) or [(), (), ()]
        for figure, curves, shaded in zip(
            (self.magnitude, self.phase, self.error), (levels, phases, errors), shades
        ):
            figure.draw(curves, shaded)
        self.magnitude.label(f"Magnitude\n/ dB re 1 {printed_unit(self._unit)}")
        self.magnitude.sheet.title.text = plain(self._title)


def _bands(one: MeasuredTransfer, k: int, hue: int) -> tuple[Band, Band, Band]:
    """Two standard uncertainties about the measured level and phase, and about no error."""
    f, (low, high), level = one.frequency_hz, one.band_dB(), level_dB(one.measured[k])
    phase, reach = with_gaps(phase_deg(one.measured[k])), 2 * one.u_phase_deg[k]
    return (
        Band(f, low[k], high[k], hue),
        Band(f, phase - reach, phase + reach, hue),
        Band(f, low[k] - level, high[k] - level, hue),
    )
