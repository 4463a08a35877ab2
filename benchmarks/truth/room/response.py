"""Impulse responses from diaphragm velocity to sound pressure, kept in a directory if one is given."""

from __future__ import annotations

import hashlib
import os
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from specan.errors import ComputationError
from truth.room.field import HIGHEST_HZ, OUTPUT_HZ, Room, march, pressure_per_velocity
from truth.room.line import Real

SAMPLING_RATE = 2048.0
BEFORE_S = 0.05  # the end of a response is what the band limit rings ahead of its beginning
_FADE_HZ = 100.0  # up to HIGHEST_HZ
# To be counted up when the field is computed otherwise: cached responses are then made anew.
_METHOD, _WITH_A_BLOCK = "1", "2"


def impulse_responses(room: Room, cache: Path | str | None = None) -> Real:
    """Pressure at each listening point per diaphragm velocity, Pa s/m per sample, shape (points, samples).

    Sampled at `SAMPLING_RATE`, band-limited to 700 Hz with a fade to 800 Hz, circular: the last `BEFORE_S` belong
    before time zero.

    Parameters
    ----------
    room : Room
        What stands where.
    cache : path, optional
        Directory in which responses are kept under a hash of the room.
    """
    if cache is None:
        return _compute(room)
    method = _METHOD if room.block is None else _WITH_A_BLOCK
    uneven = f" {room.uneven!r}" if room.uneven else ""
    key = hashlib.sha256(f"{method} {room!r}{uneven}".encode()).hexdigest()[:24]
    kept = Path(cache) / f"room-{key}.npy"
    try:
        return np.load(kept)
    except FileNotFoundError:
        pass
    responses = _compute(room)
    kept.parent.mkdir(parents=True, exist_ok=True)
    handle, part = tempfile.mkstemp(suffix=".part", dir=kept.parent)
    with os.fdopen(handle, "wb") as file:
        np.save(file, responses)
    os.replace(part, kept)
    return responses


def _compute(room: Room) -> Real:
    heard = march(room)
    n = 2 * int(np.ceil((heard.pressure.shape[1] / OUTPUT_HZ + 2 * BEFORE_S) * SAMPLING_RATE / 2))
    frequency = np.fft.rfftfreq(n, 1.0 / SAMPLING_RATE)
    inside = frequency < HIGHEST_HZ
    fade = np.clip((HIGHEST_HZ - frequency[inside]) / _FADE_HZ, 0.0, 1.0)
    spectrum = np.zeros((len(room.position_m), len(frequency)), complex)
    spectrum[:, inside] = pressure_per_velocity(heard, frequency[inside]) * np.sin(0.5 * np.pi * fade) ** 2
    responses = np.fft.irfft(spectrum, n)
    if not np.all(np.isfinite(responses)):
        raise ComputationError("the simulated impulse responses are not finite")
    return responses


def spectrum_for(responses: Real, n_samples: int) -> NDArray[np.complexfloating]:
    """Transfer functions on the frequencies of a real transform of `n_samples` samples."""
    before = round(BEFORE_S * SAMPLING_RATE)
    padded = np.zeros((len(responses), n_samples))
    padded[:, : responses.shape[1] - before] = responses[:, :-before]
    padded[:, -before:] = responses[:, -before:]
    return np.fft.rfft(padded)
