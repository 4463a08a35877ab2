"""From a recording of receivers and a reference channel to transfer functions that a model is compared with."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from specan.analysis.transfer_function import TransferFunction
from specan.arrays import Real
from specan.data.channel import Channel
from specan.data.recording import Recording
from specan.dsp.energy_decay import NoiseFloor, decay_line, energy_decay
from specan.dsp.welch import effective_averages, hop_of, power_density
from specan.errors import InputError, RequestError
from specan.models import Model
from specan.room.model.places import FieldReceivers, InRecording, receivers_of
from specan.room.study.field_observation import Drift, FieldObservation
from specan.study.data.estimated_lines import LEAST_BLOCKS, EstimatedLines
from specan.study.data.recordings import off_the_mains

SETTLE_BLOCKS = (0.5, 2.0)  # at least and at most: what the field heard before the record began is to die out
SETTLE_SHARE = 0.2  # of the record, in between
LISTENING = 4  # receivers that the decay is taken from


def observe_recording(
    recording: Recording,
    model: Model,
    *,
    estimator: str = "H1",
    background: Recording | None = None,
    u_calibrator_percent: float = 0.0,
) -> FieldObservation:
    """Transfer functions of the receivers against the reference channel, ready for a study.

    Parameters
    ----------
    recording : Recording
        Calibrated; its receivers in the order of the rig file.
    model : Model
        Of a room: its rig file says where they are and which band is looked at.
    estimator : {"H1", "H3c"}
    background : Recording, optional
        The receivers while the source is silent.
    u_calibrator_percent : float
        Part of the uncertainty of the sensitivities that all receivers have in common.

    Returns
    -------
    FieldObservation

    Raises
    ------
    InputError
        No reference channel, fewer receivers than positions or more, a record too short, no coherence.
    """
    receivers = receivers_of(model)
    reference, channels = _channels_of(recording)
    rate = reference.sampling_rate
    found, own = _estimated(recording, receivers, estimator)
    block = found.block
    frequency_hz, folding, driven = found.frequency_hz, found.folding, found.signals[0]
    said = [f"{recording.label}: {own.text}"] if own.text else []
    if background:
        known = (channels, block / rate, frequency_hz, found.density)
        found.density, text = background_noise(background, recording, *known)
        said.append(text)
    f, density = power_density(driven, rate, block)
    per_velocity = np.abs(reference.correction(np.maximum(f, f[1]))) ** 2
    density = np.interp(folding.nodes, f, density * per_velocity)
    conditions: dict[str, Any] = {"frequency": folding.nodes, "velocity_psd": density, **own.conditions}
    names = receivers.names
    noise = _in_rows(own, len(names), found.noise, 1)
    kept = np.zeros(noise.shape, dtype=bool)
    kept[own.rows] = True
    band = receivers.rig.band
    kept &= off_the_mains(frequency_hz, [band.hum_hz] if band.hum_hz else [], rate / block)
    for low, high in band.left_out_hz:
        kept[:, (frequency_hz >= low) & (frequency_hz <= high)] = False
    if not kept.any():
        raise RequestError("all lines of the band are left out", remedy="leave out less, or widen the band")
    window, driving = np.hanning(block + 1)[:-1], driven[found.start :]
    blocks = [driving[s : s + block] for s in range(0, driving.size - block + 1, hop_of(block, 0.5))]
    power = np.array([np.abs(np.fft.rfft(window * one)[found.numbers]) ** 2 for one in blocks])
    plain = FieldObservation(
        name=recording.label,
        recording=recording.label,
        quantities=(model.observables["frf"].quantity,),
        frequency_hz=frequency_hz,
        line_hz=rate / block,
        channels=names,
        response=_in_rows(own, len(names), found.response, 0),
        noise=noise,
        random=noise,
        folding=folding,
        conditions_at_nodes=conditions,
        shared=np.empty((*noise.shape, 0), dtype=complex),
        kept=kept,
        notes=tuple(said),
        drift=Drift.of(*own.drift, power) if own.drift else None,
        warming=Drift.of("temperature_difference", np.linspace(-0.5, 0.5, 101), power),
    )
    # Receivers of other recordings stand in the middle, which a tilt of the frame turns about.
    places = np.tile(receivers.positions_m[own.rows].mean(axis=0), (len(names), 1))
    places[own.rows] = receivers.positions_m[own.rows]
    declared = _as_calibrated(replace(receivers, positions_m=places), own, channels, u_calibrator_percent)
    # Until a fit tells where the declared errors act one error a line stands for them.
    level = float(np.max(declared.errors.calibration_dB))
    percent = max(100 * declared.errors.discrepancy, 100 * (10 ** (level / 20) - 1), 1.0)
    typical = np.median(np.abs(plain.response), axis=1, keepdims=True)
    return replace(plain, noise=np.hypot(plain.noise, percent / 100 * typical), declared=declared)


def _estimated(
    recording: Recording, receivers: FieldReceivers, estimator: str
) -> tuple[EstimatedLines, InRecording]:
    """The lines of the rig's band with their noise, and what holds in the recording."""
    band = (receivers.rig.band.f_min_hz, receivers.rig.band.f_max_hz)
    reference, channels = _channels_of(recording)
    rate = reference.sampling_rate
    block_s = receivers.rig.band.block_s
    if block_s is None:
        few = channels[:: max(1, len(channels) // LISTENING)]
        heard = (recording.read([channel])[0] for channel in few)
        block_s = block_length(recording.read([reference])[0], heard, rate, band)
    settle = settling_s(reference.duration_s, block_s)
    began = reference.properties.get("wf_start_time")
    start = None if began is None else np.datetime64(began, "us") + np.timedelta64(round(1e6 * settle), "us")
    own = receivers.in_recording(recording.label, start, reference.duration_s - settle)
    if len(channels) != len(own.rows):
        raise InputError(
            f"{recording.label} has {len(channels)} microphones, the rig file {len(own.rows)} positions",
            expected="one position per microphone channel, in order",
        )
    settings = TransferFunction(
        reference=reference.label,
        channels=tuple(channel.label for channel in channels),
        estimator=estimator,  # type: ignore[arg-type]
        lines=round(rate * block_s / 2.56),
        window="hann",
        overlap=0.5,
        align=False,
        start_s=settle,
    )
    block = settings.block
    if reference.n_samples < round(settle * rate) + LEAST_BLOCKS * block:
        least = settle + LEAST_BLOCKS * block / rate
        raise InputError(
            f"{recording.label} lasts {reference.duration_s:.1f} s",
            expected=f"at least {np.ceil(10 * least) / 10:g} s for lines {rate / block:.2g} Hz apart",
        )
    found = EstimatedLines(recording, reference, settings, band)
    if not np.any(np.nanmedian(found.coherence, axis=1) > 0.2):
        raise InputError(
            f"{recording.label}: microphones and vibrometer have no coherence "
            f"between {band[0]:g} and {band[1]:g} Hz",
            expected="noise from the source in that band",
            remedy="check the channels or change [band]",
        )
    return found, own


def _in_rows(own: InRecording, count: int, part: Any, fill: float) -> Any:
    """What a recording tells of its own receivers, among all of the model's."""
    whole = np.full((count, part.shape[1]), fill, dtype=part.dtype)
    whole[own.rows] = part
    return whole


def settling_s(duration_s: float, block_s: float = 1.0) -> float:
    """Time at the beginning of a record that is not analysed, s.

    Examples
    --------
    >>> [settling_s(t) for t in (4.0, 5.0, 30.0)]
    [0.5, 1.0, 2.0]
    """
    left = duration_s - LEAST_BLOCKS * block_s
    least, most = (n * block_s for n in SETTLE_BLOCKS)
    return max(least, min(SETTLE_SHARE * duration_s, left, most))


def _as_calibrated(
    receivers: FieldReceivers, own: InRecording, channels: Sequence[Channel], common_percent: float
) -> FieldReceivers:
    """Receivers with the uncertainties that their calibration states, where it states any.

    The level of the calibrator is common to them and is taken off what each has for itself. A phase that is known at
    the calibrator's tone only counts with the mean square of its uncertainty over the band, or as the rig file has it
    where that is more: phases are relative to one receiver, not to the reference channel.
    """
    given, limits, count = receivers.errors, receivers.rig.band, len(receivers.positions_m)
    band = np.linspace(limits.f_min_hz, limits.f_max_hz)
    stated = _in_rows(own, count, np.array([[c.u_gain_percent] for c in channels]), 0.0)
    known = np.array([[np.sqrt(np.mean(c.u_phase_deg(band) ** 2))] for c in channels])
    phase = _in_rows(own, count, known, 0.0)
    if not stated.any():
        return receivers
    single = np.sqrt(np.clip(stated**2 - common_percent**2, 0.0, None))
    changed = replace(
        given,
        calibration_dB=np.where(stated > 0, _in_dB(single), given.calibration_dB),
        calibration_phase_deg=np.maximum(given.calibration_phase_deg, phase),
        common_dB=_in_dB(common_percent) if common_percent else given.common_dB,
    )
    return replace(receivers, errors=changed)


def _in_dB(percent: Any) -> Any:
    return percent / 100 * 20 / np.log(10)


def _channels_of(recording: Recording) -> tuple[Channel, tuple[Channel, ...]]:
    references = recording.by_role("vibrometer")
    if not references:
        raise InputError(
            f"{recording.label} has no vibrometer channel",
            remedy="name one in the channel table (role = 'vibrometer')",
        )
    return references[0], recording.by_role("microphone")


# --- length of the blocks, from how long the field of a recording rings ------------------------------------

USUAL_S = 1.0  # lines of 1 Hz, as long as the modes are no narrower
LONG_S = 2.0  # reverberation time above which blocks are as long as it: their lines are then as narrow as the modes
MOST_S = 20.0  # as a rig file may say
# Of the decay that is looked at: its beginning, above what the ends of a record of five reverberation times leave.
RANGE_DB = (-2.0, -15.0)
SURE = 10.0  # standard deviations of the noise that the energy of a response must exceed
TAIL = 0.25  # of the impulse response, its end, where only noise is left
DRIVEN = 1e-2  # of the reference's mean power, where lines lose half of their weight
LEAST_OF_RECORD = 5.0  # blocks that a record holds, with what is left out at its beginning


def block_length(
    reference: Real, responses: Iterable[Real], rate: float, band_hz: tuple[float, float]
) -> float:
    """Length of blocks in s: the usual one, or the reverberation time where that is long.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> v = rng.standard_normal(40_000)
    >>> t = np.arange(8000) / 1000
    >>> ringing = np.exp(-6.91 * t / 4.0) * np.sin(2 * np.pi * 150 * t)  # 60 dB in 4 s
    >>> p = np.convolve(v, ringing)[: v.size]
    >>> 3 < block_length(v, [p], 1000.0, (20.0, 400.0)) < 5
    True
    """
    times = [reverberation_s(reference, response, rate, band_hz) for response in responses]
    known = [time for time in times if np.isfinite(time)]
    found = float(np.quantile(known, 0.25)) if known else 0.0  # hum and noise make a decay seem longer
    most = min(MOST_S, reference.size / rate / LEAST_OF_RECORD)
    return USUAL_S if found < LONG_S or most < LONG_S else min(found, most)


def reverberation_s(reference: Real, response: Real, rate: float, band_hz: tuple[float, float]) -> float:
    """Reverberation time of a band from the whole record's impulse response; nan where noise hides it.

    Schroeder's integral, the noise of the response's end taken off.
    """
    first, last = (int(f * reference.size / rate) for f in band_hz)
    v, p = (np.fft.rfft(x)[: last + 1] for x in (reference, response))
    power = np.abs(v) ** 2
    power[:first] = 0.0
    least = DRIVEN * power[first:].mean()  # lines that the source hardly drove count little
    n = 2 * last  # samples at twice the highest frequency
    rate = n * rate / reference.size
    squared = np.fft.irfft(np.where(power > 0, p * v.conj(), 0) / (power + least), n)[: n // 2] ** 2
    floor = NoiseFloor(float(squared[-int(TAIL * squared.size) :].mean()), squared.size, 0.0)
    left = energy_decay(squared, floor)
    # of squares of a normal law, the sum scatters by that
    if left[0] <= SURE * floor.power * np.sqrt(2 * squared.size):
        return float("nan")
    level = 10 * np.log10(np.maximum(left, 1e-12 * left[0]) / left[0])
    return decay_line(level, *RANGE_DB).samples / rate


# --- noise while the source is silent, from a recording of its own -----------------------------------------

NEAR_DB = 10.0  # below the recording, within which a line is said to be near the background
MOST_RUNS = 6  # of neighbouring lines that are named


def background_noise(
    background: Recording, recording: Recording, channels: tuple[Channel, ...], block_s: float, lines_hz: Real,
    between: Real,
) -> tuple[Real, str]:  # fmt: skip
    """Noise density of the receivers at the lines of a recording, by what they hear without its source.

    A tone in the background, such as hum, stands on few lines: in the density `between` the lines it is not heard. The
    background counts where it is surely louder: where its mean over blocks exceeds that density by the quantile of
    chi-square over its degrees of freedom.

    Returns
    -------
    density : array (channels, lines)
        One-sided, unit of the receivers squared per Hz.
    text : str
        What was found, for a person.

    Raises
    ------
    InputError
        A receiver is missing, the recording is short, or it is as loud as the one with the source.
    """
    from scipy.stats import chi2

    own = [background.channel(channel.name) for channel in channels]
    rate = own[0].sampling_rate
    blocks = int(own[0].duration_s / block_s * 2) - 1
    if blocks < 2:
        raise InputError(
            f"the background {background.label} lasts {own[0].duration_s:.1f} s",
            expected=f"at least {1.5 * block_s:.1f} s for blocks of {block_s:.3g} s",
        )
    quiet = _densities(background, own, block_s, lines_hz)
    loud = _densities(recording, channels, block_s, lines_hz)
    # 3.0: below the recording; where half of the lines are nearer, the source was not silent
    if np.mean(quiet > 10 ** (-3.0 / 10) * loud) > 0.5:
        raise InputError(
            f"the background {background.label} is as loud as {recording.label} on most lines",
            expected="a recording with the source switched off",
            remedy="check that the two files are not exchanged",
        )
    near = quiet > 10 ** (-NEAR_DB / 10) * loud
    at = np.flatnonzero(near.any(axis=0))
    runs = np.split(at, np.flatnonzero(np.diff(at) > 1) + 1)
    text = f"{background.label}: background of {own[0].duration_s:.3g} s at {rate:g} Hz; "
    if at.size:
        ends = [f"{lines_hz[run[0]]:.4g} to {lines_hz[run[-1]]:.4g}" for run in runs[:MOST_RUNS]]
        where = ", ".join(ends) + (" ..." if len(runs) > MOST_RUNS else "")
        text += (
            f"within {NEAR_DB:g} dB of {recording.label} in {100 * near.mean():.2g} % of its values "
            f"({where} Hz), which count with the background's uncertainty"
        )
    else:
        text += f"more than {NEAR_DB:g} dB below {recording.label} on every line"
    # below this quantile of a Welch estimate the background agrees with the noise between the lines
    dof = 2 * effective_averages(blocks, "hann", 0.5)
    sure = chi2.ppf(0.999, dof) / dof
    return np.where(quiet > sure * between, quiet, between), text


def _densities(
    recording: Recording, channels: tuple[Channel, ...] | list[Channel], block_s: float, lines_hz: Real
) -> Real:
    found = []
    for channel in channels:
        rate = channel.sampling_rate
        f, density = power_density(recording.read([channel])[0], rate, round(rate * block_s))
        found.append(np.interp(lines_hz, f, density))
    return np.stack(found)
