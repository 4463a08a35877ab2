"""From recordings to observations of transfer functions: what is fitted, what is held out."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.data.recording import Recording
from specan.errors import InputError, RequestError, nearest
from specan.io.open import open_recording
from specan.models import Model, Receivers
from specan.study.data.estimate_frf import observe_recording, settling_s
from specan.study.observation import DataFile, MeasuredFiles, Observation, OpenedData
from specan.study.observation.frf import FrfObservation

TITLE = "a recording"
SAME_LEVEL = 0.02  # relative, of a level that a user writes: conditions are printed to three digits


def reads(path: Path) -> bool:
    """Whether a file is a recording by its content."""
    from specan.io.open import format_of

    try:
        format_of(path)
    except InputError:
        return False
    return True


def open_data(model: Model, wanted: MeasuredFiles) -> OpenedData:
    """Read the recordings of a study.

    Raises
    ------
    InputError
        See `observe_recording`.
    RequestError
        The model predicts no transfer function, or a held-out channel that no recording has.
    """
    receivers = model.receivers
    if receivers is None:
        raise RequestError(
            f"the model {model.name} predicts nothing that a recording holds", remedy="give a table instead"
        )
    fitted, held_out, statements = [], [], []
    for file in wanted.measurements:
        whole, said = _observe(model, receivers, wanted, file)
        aside = put_aside(whole, file, wanted)
        if np.all(aside):
            raise RequestError(f"all channels of {file.name} are held out", remedy="hold out fewer")
        fitted.append(whole.take(~aside))
        if np.any(aside):
            held_out.append(whole.take(aside))
        statements += said
    for file in wanted.validations:
        whole, said = _observe(model, receivers, wanted, file)
        held_out.append(whole)
        statements += said
    given = receivers.errors
    place, level = (
        _range(np.asarray(v)) for v in (1000 * np.asarray(given.position_m), given.calibration_dB)
    )
    common = (
        f"every {receivers.noun}: place {place} mm, calibration {level} dB "
        f"and {given.calibration_phase_deg:.3g} degrees, model discrepancy "
        f"{100 * given.discrepancy:.3g} % (from the rig file or its defaults)"
    )
    if given.frame_m or given.frame_tilt_deg or given.common_dB:
        common += (
            f"; in common: {1000 * given.frame_m:.3g} mm and {given.frame_tilt_deg:.3g} degrees of their frame, "
            f"{given.common_dB:.3g} dB of the calibrator"
        )
    return OpenedData(
        fitted=tuple(fitted),
        held_out=tuple(held_out),
        statements=(*statements, common),
        discrepancy_percent=100 * given.discrepancy,
    )


def _observe(
    model: Model, receivers: Receivers, wanted: MeasuredFiles, file: DataFile
) -> tuple[FrfObservation, list[str]]:
    recording = open_recording(file.path, calibration=wanted.calibration, label=file.name)
    found = observe_recording(
        recording,
        model,
        estimator=file.estimator or "H1",
        f_min_hz=receivers.band_hz[0],
        f_max_hz=receivers.band_hz[1],
    )
    settle = settling_s(recording.by_role(receivers.reference_role)[0].duration_s, receivers.block_s)
    return found, [
        f"{file.name}: {len(found.channels)} {receivers.plural}, {found.frequency_hz.size} lines of "
        f"{1 / receivers.block_s:.3g} Hz, {file.estimator or 'H1'}, blocks of {receivers.block_s:.3g} s "
        f"after {settle:.3g} s; "
        "the model filters the recorded velocity and goes through the same blocks",
        *_calibrated(recording, receivers),
    ]


def _calibrated(recording: Recording, receivers: Receivers) -> list[str]:
    channels = recording.by_role(receivers.role)
    reason = channels[0].decisions.get("sensitivity", "")
    stated = np.array([c.u_gain_percent for c in channels])
    said = [f"{recording.label}: sensitivities {reason}"] if reason else []
    if stated.any():
        said.append(
            f"{recording.label}: uncertainty of the sensitivities as calibrated, {_range(stated[stated > 0])} %, "
            "not as the rig file has it"
        )
    return said


def _range(values: NDArray[np.float64]) -> str:
    low, high = float(values.min()), float(values.max())
    return f"{low:.3g}" if low == high else f"{low:.3g} to {high:.3g}"


def put_aside(
    whole: Observation, file: DataFile, wanted: MeasuredFiles, label_of: Callable[[str], str] = str
) -> NDArray[np.bool_]:
    """Rows that ``channel=Mic 19,Mic 20`` names.

    Parameters
    ----------
    whole : Observation
        Of a recording.
    file, wanted
        What it was read from, and what is to be held out.
    label_of : callable
        Name of the label that a user's key means.
    """
    aside = np.zeros(whole.n, dtype=bool)
    for file_name, where in wanted.hold_out:
        if file_name not in (None, file.name):
            continue
        given, _, levels = where.partition("=")
        key = label_of(given.strip())
        if key not in whole.labels:
            raise RequestError(
                f"{given!r} in {where!r} is not known for a recording", remedy=nearest(given, whole.labels)
            )
        labels = whole.labels[key]
        # a condition that is the same in a whole recording may be that of another recording
        elsewhere = labels.dtype.kind == "f" and np.ptp(labels) == 0
        for level in map(str.strip, levels.split(",")):
            chosen = _alike(labels, level)
            if not chosen.any() and not elsewhere:
                raise RequestError(
                    f"{file.name} has no {key} {level!r}",
                    remedy=nearest(level, [str(v) for v in np.unique(labels)]),
                )
            aside |= chosen
    return aside


def _alike(labels: NDArray[Any], level: str) -> NDArray[np.bool_]:
    """Which labels are what a user wrote: ``25`` is the third octave 25.0."""
    if labels.dtype.kind != "f":
        return np.asarray(labels == level)
    try:
        return np.isclose(labels, float(level), rtol=SAME_LEVEL)
    except ValueError:
        return np.zeros(labels.size, dtype=bool)
