"""What ``study compare --plot`` draws of a recording: model over measurement, what is left, and its spectrum."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from scipy.signal import csd, welch

from specan.errors import require_known
from specan.models.rates import TIME
from specan.report.figure_style import COLOURS, heading, new_figure, styled
from specan.report.study_words import state_of
from specan.study.observation.time import TimeObservation
from specan.study.study import Study
from specan.units import axis_label

SHOWN = 500  # samples of the first panel, about the largest error
SEGMENTS = 16


@styled
def figure_compare_time(study: Study, channel: str | None = None) -> Figure:
    """Measured and model about the largest error, the error over the whole time, and the spectrum of both.

    Parameters
    ----------
    study : Study
    channel : str, optional
        An observable; by default the first.

    Raises
    ------
    RequestError
        There is no such observable.
    """
    o = study.problem.observations[0]
    assert isinstance(o, TimeObservation)
    name = channel or next(iter(o.chains))
    require_known(name, o.chains, f"no channel {name!r}")
    rows = max(o.chains[name], key=len)
    time, measured = o.conditions[TIME][rows], o.measured[rows]
    predicted = study.problem.plain(study.shown.theta)[0][rows]
    gap, unit = measured - predicted, study.model.observables[name].unit
    figure = new_figure(7.0, 7.6)
    top, middle, bottom = figure.subplots(3, 1)
    first = int(np.clip(np.argmax(np.abs(gap)) - SHOWN // 2, 0, max(rows.size - SHOWN, 0)))
    near = slice(first, first + SHOWN)
    top.plot(time[near], measured[near], ".", ms=2.5, color="0.5", label="measured")
    top.plot(time[near], predicted[near], color=COLOURS[0], lw=1.2, label="model")
    top.set(ylabel=axis_label(name, unit))
    top.legend(loc="upper right", ncols=2)
    middle.plot(time, gap, color=COLOURS[1], lw=0.5)
    middle.set(xlabel="Time / s", ylabel=axis_label("Measured - model", unit))
    rate, size = 1 / float(time[1] - time[0]), max(2 * rows.size // (SEGMENTS + 1), 8)
    f, of_measured = welch(measured - measured.mean(), rate, nperseg=size)
    left = welch(gap, rate, nperseg=size)[1]
    bottom.loglog(f[1:], np.sqrt(of_measured[1:]), color="0.5", lw=1, label="measured")
    bottom.loglog(f[1:], np.sqrt(left[1:]), color=COLOURS[1], lw=1, label="measured - model")
    for word, column in (study.model.rates.inputs if study.model.rates else {}).items():
        given = o.conditions[column][rows]
        if np.ptp(given):
            cross = np.abs(csd(given, gap, rate, nperseg=size)[1]) / np.sqrt(
                welch(given, rate, nperseg=size)[1]
            )
            bottom.loglog(f[1:], cross[1:], "--", lw=1, color=COLOURS[2], label=f"of that, follows {word}")
    bottom.set(xlabel="Frequency / Hz", ylabel=axis_label("Amplitude density", f"{unit}/√Hz"))
    bottom.legend()
    heading(figure, f"{study.directory.resolve().name}: measured and model", *state_of(study), "")
    return figure
