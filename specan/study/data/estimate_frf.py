"""From a recording of microphones and vibrometer to transfer functions that a model is held against."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from specan.data.recording import Channel, Recording
from specan.errors import InputError
from specan.models import Model
from specan.study.data.local_polynomial import noise_density
from specan.study.observation.correlated_errors import CommonErrors
from specan.study.observation.frf import FrfObservation
from specan.study.observation.window_leakage import fold

BLOCK_S = 1.0  # lines 1 Hz apart
SETTLE_S = (0.5, 2.0)  # at least and at most: what the room heard before the record began is to die out
SETTLE_SHARE = 0.2  # of the record, in between
LEAST_BLOCKS = 4

Complex = Any


def observe_recording(
    recording: Recording,
    model: Model,
    *,
    channels: Sequence[str] = (),
    estimator: str = "H1",
    f_min_hz: float,
    f_max_hz: float,
) -> FrfObservation:
    """Transfer functions of the microphones against the vibrometer, ready for a study.

    Parameters
    ----------
    recording : Recording
        Calibrated; its microphones in the order of the rig file.
    model : Model
        Its axis ``microphone`` names them.
    channels : sequence of str, optional
        Microphones to use; all by default.
    estimator : {"H1", "H3c"}
    f_min_hz, f_max_hz : float
        Band.

    Raises
    ------
    InputError
        No vibrometer, fewer microphones than positions or more, a record too short, no coherence.
    """
    from specan.analysis.transfer_function import TransferFunction

    vibrometer, microphones = _channels_of(recording, model)
    rate, settle = vibrometer.sampling_rate, settling_s(vibrometer.duration_s)
    settings = TransferFunction(
        reference=vibrometer.name,
        channels=tuple(m.name for m in microphones),
        estimator=estimator,  # type: ignore[arg-type]
        lines=round(rate * BLOCK_S / 2.56),
        window="hann",
        overlap=0.5,
        align=False,
        start_s=settle,
    )
    block, hop, start = settings.block, settings.block // 2, round(settle * rate)
    if vibrometer.n_samples < start + LEAST_BLOCKS * block:
        least = settle + LEAST_BLOCKS * block / rate
        raise InputError(
            f"{recording.label} lasts {vibrometer.duration_s:.1f} s",
            expected=f"at least {least:.1f} s for lines {rate / block:.2g} Hz apart",
        )
    found = settings(recording).between(f_min_hz, f_max_hz)
    _check_coherence(recording, found.coherence, f_min_hz, f_max_hz)
    lines = np.round(found.frequency_hz * block / rate).astype(int)
    helper = recording.by_role("generator")[0] if estimator == "H3c" else None
    signals = recording.read([vibrometer, *([helper] if helper else [])])
    folding = fold(signals[0], rate, block, hop, start, lines, signals[1] if helper else None)
    wanted = np.array([not channels or m.name in channels for m in microphones])
    conditions = {
        "frequency": folding.nodes,
        "velocity_psd": _density_at(signals[0], rate, block, vibrometer, folding.nodes),
    }
    noise = _noise(recording, vibrometer, microphones, signals, found.frequency_hz, block, start)
    plain = FrfObservation(
        name=recording.label,
        recording=recording.label,
        quantity=model.observables["frf"].quantity,
        frequency_hz=found.frequency_hz,
        line_hz=rate / block,
        channels=model.axes["microphone"],
        response=found.response,
        noise=noise,
        random=noise,
        folding=folding,
        conditions_at_nodes=conditions,
        shared=np.empty((*found.response.shape, 0), dtype=complex),
        kept=np.repeat(wanted[:, None], len(lines), axis=1),
    )
    return replace(plain, **_before_a_fit(model, plain))


def settling_s(duration_s: float) -> float:
    """Time at the beginning of a record that is not analysed, s.

    Examples
    --------
    >>> [settling_s(t) for t in (4.0, 5.0, 30.0)]
    [0.5, 1.0, 2.0]
    """
    left = duration_s - LEAST_BLOCKS * BLOCK_S
    return max(SETTLE_S[0], min(SETTLE_SHARE * duration_s, left, SETTLE_S[1]))


def _before_a_fit(model: Model, plain: FrfObservation) -> dict[str, Any]:
    """The declared errors, and a stand-in for them until a fit tells where they act: one error a line."""
    given = model.settings["uncertainty"]
    percent = max(given["model_discrepancy_percent"], 100 * (10 ** (given["calibration_dB"] / 20) - 1), 1.0)
    typical = np.median(np.abs(plain.response), axis=1, keepdims=True)
    declared = CommonErrors(
        position_m=given["position_m"],
        calibration_dB=given["calibration_dB"],
        calibration_phase_deg=given["calibration_phase_deg"],
        discrepancy=given["model_discrepancy_percent"] / 100,
        detuning=given["natural_frequency_percent"] / 100,
        nominal_K=model.settings["rig"]["air"]["nominal_temperature_C"] + 273.15,
    )
    return {"noise": np.hypot(plain.noise, percent / 100 * typical), "declared": declared}


def _noise(
    recording: Recording,
    vibrometer: Channel,
    microphones: Sequence[Channel],
    signals: Any,
    frequency: Any,
    block: int,
    start: int,
) -> Any:
    """Random uncertainty of the real part of every line, from the noise that no leakage enlarges.

    ``sigma^2 = G_nn sum w^2 rate / (2 n_eff mean |V_b|^2) / 2`` for each real component.
    """
    from scipy.signal import welch

    from specan.dsp.welch import effective_averages

    rate = vibrometer.sampling_rate
    responses = recording.read(microphones)
    density_of_noise = noise_density(signals[0], responses, rate, frequency)
    f, density = welch(signals[0][start:], rate, "hann", block)
    blocks = (vibrometer.n_samples - start - block) // (block // 2) + 1
    averages = effective_averages(blocks, "hann", 0.5)
    drive = np.interp(frequency, f, density)
    if len(signals) > 1:
        from scipy.signal import coherence

        drive = drive * np.interp(frequency, *coherence(signals[1], signals[0], rate, "hann", block))
    return np.sqrt(density_of_noise / (2 * averages * drive))


def _channels_of(recording: Recording, model: Model) -> tuple[Channel, tuple[Channel, ...]]:
    vibrometers = recording.by_role("vibrometer")
    if not vibrometers:
        raise InputError(
            f"{recording.label} has no vibrometer channel",
            remedy="name one in the channel table (role = 'vibrometer')",
        )
    microphones = recording.by_role("microphone")
    count = len(model.axes["microphone"])
    if len(microphones) != count:
        raise InputError(
            f"{recording.label} has {len(microphones)} microphones, the rig file {count} positions",
            expected="one position a microphone channel, in order",
        )
    return vibrometers[0], microphones


def _check_coherence(recording: Recording, coherence: Any, low: float, high: float) -> None:
    if not np.any(np.nanmedian(coherence, axis=1) > 0.2):
        raise InputError(
            f"{recording.label}: microphones and vibrometer have no coherence between {low:g} and {high:g} Hz",
            expected="noise from the loudspeaker in that band",
            remedy="check the channels or change [band]",
        )


def _density_at(signal: Any, rate: float, block: int, vibrometer: Channel, nodes: Any) -> Any:
    from scipy.signal import welch

    f, density = welch(signal, rate, "hann", block)
    per_velocity = np.abs(vibrometer.correction(np.maximum(f, f[1]))) ** 2
    return np.interp(nodes, f, density * per_velocity)
