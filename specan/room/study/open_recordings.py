"""From recordings to observations of transfer functions: what is fitted, what is held out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from specan.data.recording import Recording
from specan.errors import RequestError
from specan.io.calibration_file import read_calibration
from specan.io.open import open_recording
from specan.models import Model, Receivers
from specan.models.measurement_kinds import ReceiverErrors
from specan.room.study.estimate_frf import observe_recording, settling_s
from specan.study.data.recordings import doubts, put_aside, reads  # noqa: F401  a recording is one by its content
from specan.study.observation import DataFile, MeasuredFiles, OpenedData
from specan.study.observation.frf import FrfObservation

TITLE = "a recording"


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
    declared = fitted[0].declared
    given = (declared.receivers if declared else receivers).errors
    return OpenedData(
        fitted=tuple(fitted),
        held_out=tuple(held_out),
        statements=(*statements, _of_receivers(receivers.noun, given, wanted.calibration)),
        discrepancy_percent=100 * given.discrepancy,
    )


def _of_receivers(noun: str, given: ReceiverErrors, calibration: Path | None) -> str:
    """How uncertain each receiver is, and all together."""
    place, level, phase = (
        _range(np.asarray(v))
        for v in (1000 * np.asarray(given.position_m), given.calibration_dB, given.calibration_phase_deg)
    )
    source = f"of {calibration.name}, others " if calibration else ""
    common = (
        f"every {noun}: place {place} mm, calibration {level} dB and {phase} degrees, model discrepancy "
        f"{100 * given.discrepancy:.3g} % ({source}from the rig file or its defaults)"
    )
    shared = [
        f"{1000 * given.frame_m:.3g} mm and {given.frame_tilt_deg:.3g} degrees of their frame"
        if given.frame_m or given.frame_tilt_deg
        else "",
        f"{given.common_dB:.3g} dB of the calibrator" if given.common_dB else "",
    ]
    return common + (f"; in common: {', '.join(filter(None, shared))}" if any(shared) else "")


def _observe(
    model: Model, receivers: Receivers, wanted: MeasuredFiles, file: DataFile
) -> tuple[FrfObservation, list[str]]:
    background = Path(receivers.background) if receivers.background else None
    from specan.analysis.section import aligned

    recording = open_recording(file.path, calibration=wanted.calibration, label=file.name)
    recording, _ = aligned(recording, recording.channels)
    found = observe_recording(
        recording,
        model,
        estimator=file.estimator or "H1",
        f_min_hz=receivers.band_hz[0],
        f_max_hz=receivers.band_hz[1],
        background=open_recording(background, calibration=wanted.calibration) if background else None,
        u_calibrator_percent=read_calibration(wanted.calibration).u_calibrator_percent
        if wanted.calibration
        else 0.0,
    )
    block_s = receivers.block_s or 1 / found.line_hz
    settle = settling_s(recording.by_role(receivers.reference_role)[0].duration_s, block_s)
    return found, [
        f"{file.name}: {int(found.kept.any(axis=1).sum())} {receivers.plural}, {found.frequency_hz.size} lines of "
        f"{1 / block_s:.3g} Hz, {file.estimator or 'H1'}, blocks of {block_s:.3g} s "
        f"after {settle:.3g} s; "
        "the model filters the recorded velocity and goes through the same blocks",
        *_sensitivities(recording, receivers),
        *doubts(recording, recording.by_role(receivers.role), recording.by_role(receivers.reference_role)[0]),
        *found.notes,
    ]


def _sensitivities(recording: Recording, receivers: Receivers) -> list[str]:
    """Where sensitivities come from; a receiver of another origin is named."""
    by_source: dict[str, list[str]] = {}
    for channel in recording.by_role(receivers.role):
        reason = channel.decisions.get("sensitivity", "")
        by_source.setdefault(reason.partition(": ")[0], []).append(
            f"{channel.name}: {reason.partition(': ')[2]}"
        )
    return [
        f"{recording.label}: sensitivities from {source} ({', '.join(told[:2])}{' ...' if len(told) > 2 else ''})"
        for source, told in by_source.items()
        if source
    ]


def _range(values: NDArray[np.float64]) -> str:
    low, high = float(values.min()), float(values.max())
    return f"{low:.3g}" if low == high else f"{low:.3g} to {high:.3g}"
