"""From recordings to observations of transfer functions: what is fitted, what is held out."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.data.recording import Recording
from specan.io.calibration_file import read_calibration
from specan.io.open import open_recording
from specan.models import Model
from specan.result import gathered
from specan.room.model.mode_shifts import mode_names
from specan.room.model.places import FieldReceivers, ReceiverErrors, near_walls, receivers_of
from specan.room.study.estimate_frf import observe_recording, settling_s
from specan.room.study.field_observation import FieldObservation
from specan.room.study.matched_field import likely_places  # noqa: F401
from specan.room.study.mistaken_set_up import mistaken_set_up, undeclared_shifts  # noqa: F401  see `brought`
from specan.room.study.mode_shifts import knowing_shifts, mode_shifts, with_mode_shifts  # noqa: F401
from specan.room.study.receiver_places import explore_places, propose_places  # noqa: F401
from specan.study.data.recordings import doubts, off_the_mains, parted, reads  # noqa: F401  a recording is one by its content
from specan.study.estimation.fit import Fit
from specan.study.estimation.problem import Problem
from specan.study.localisation import by_band_and_channel
from specan.study.localisation.by_band_and_channel import curve_errors  # noqa: F401
from specan.study.localisation.localise import Localisation
from specan.study.observation import DataFile, MeasuredFiles, OpenedData

TITLE = "a recording"


def diagnosed(*given: Any) -> Any:
    """See `of_field.diagnosed`, which loads much that no other step needs."""
    from specan.room.study import of_field

    return of_field.diagnosed(*given)


def open_data(model: Model, wanted: MeasuredFiles) -> OpenedData:
    """Read the recordings of a study.

    Raises
    ------
    InputError
        See `observe_recording`.
    RequestError
        A held-out channel that no recording has.
    """
    receivers = receivers_of(model)
    files = (*wanted.measurements, *wanted.validations)
    opened = [(file, *_observe(model, receivers, wanted, file)) for file in files]
    fitted, held_out = parted([(file, whole) for file, whole, *_ in opened], wanted)
    statements = [text for _, _, said, doubtful in opened for text in (*said, *doubtful)]
    given = (fitted[0].declared or receivers).errors
    return OpenedData(
        fitted=tuple(fitted),
        held_out=tuple(held_out),
        statements=(*statements, _of_receivers(given, wanted.calibration)),
        discrepancy_percent=100 * given.discrepancy,
        doubts=tuple(text for *_, doubtful in opened for text in doubtful),
    )


def localise(problem: Problem, best: Fit) -> Localisation:
    """Where a room's model fails: also near walls, and by the names of modes."""
    receivers = receivers_of(problem.assembly.model)
    groups = (partial(near_walls, receivers), "near_wall", "microphones near wall")

    def modes_of(observation: FieldObservation) -> list[tuple[float, str]]:
        if receivers.box is None:
            return []
        values = problem.seen_by(observation, problem.values_at(best.theta))
        wanted = ("room_dimensions", "sound_speed")
        found = problem.assembly.evaluate(observation.conditions_at_nodes, values, wanted=wanted)
        reach_hz = (1 + by_band_and_channel.NEAR_MODE) * float(observation.frequency_hz[-1])
        return mode_names(found["room_dimensions"], float(found["sound_speed"]), reach_hz)

    return by_band_and_channel.localise(problem, best, groups, modes_of)


def _of_receivers(given: ReceiverErrors, calibration: Path | None) -> str:
    """How uncertain each receiver is, and all together."""
    place, level, phase = (
        _range(np.asarray(v))
        for v in (1000 * np.asarray(given.position_m), given.calibration_dB, given.calibration_phase_deg)
    )
    source = f"of {calibration.name}, others " if calibration else ""
    common = (
        f"every microphone: place {place} mm, calibration {level} dB and {phase} degrees, model discrepancy "
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
    model: Model, receivers: FieldReceivers, wanted: MeasuredFiles, file: DataFile
) -> tuple[FieldObservation, list[str], list[str]]:
    given = receivers.rig.background.recording
    from specan.analysis.section import aligned

    recording = open_recording(file.path, calibration=wanted.calibration, label=file.name)
    recording, _ = aligned(recording, recording.channels)
    found = observe_recording(
        recording,
        model,
        estimator=file.estimator or "H1",
        background=open_recording(Path(given), calibration=wanted.calibration) if given else None,
        u_calibrator_percent=read_calibration(wanted.calibration).u_calibrator_percent
        if wanted.calibration
        else 0.0,
    )
    doubtful, heard = doubts(recording, recording.by_role("microphone"), recording.by_role("vibrometer")[0])
    if not given:  # with a background the lines of hum are as uncertain as it makes them
        found = replace(found, kept=found.kept & off_the_mains(found.frequency_hz, heard, found.line_hz))
    block_s = receivers.rig.band.block_s or 1 / found.line_hz
    settle = settling_s(recording.by_role("vibrometer")[0].duration_s, block_s)
    return (
        found,
        [
            f"{file.name}: {int(found.kept.any(axis=1).sum())} microphones, {found.frequency_hz.size} lines of "
            f"{1 / block_s:.3g} Hz, {file.estimator or 'H1'}, blocks of {block_s:.3g} s "
            f"after {settle:.3g} s; "
            "the model filters the recorded velocity and is analysed in the same blocks",
            *_sensitivities(recording),
            *found.notes,
        ],
        doubtful,
    )


def _sensitivities(recording: Recording) -> list[str]:
    """Where sensitivities come from; a receiver of another origin is named."""
    microphones = recording.by_role("microphone")
    reasons = [(c.name, *c.decisions.get("sensitivity", "").partition(": ")) for c in microphones]
    by_source = gathered((source, f"{name}: {reason}") for name, source, _, reason in reasons)
    return [
        f"{recording.label}: sensitivities from {source} ({', '.join(told[:2])}{' ...' if len(told) > 2 else ''})"
        for source, told in by_source.items()
        if source
    ]


def _range(values: NDArray[np.float64]) -> str:
    low, high = float(values.min()), float(values.max())
    return f"{low:.3g}" if low == high else f"{low:.3g} to {high:.3g}"
