"""How far a model of transfer functions is off, as acousticians say it: dB and degrees, FRAC and CSAC.

Level and phase error of a third octave at a receiver,

    dL = 10 lg (sum |H_a|^2 / sum |H_x|^2),    dphi = arg sum H_a conj(H_x),

with H_a the model's and H_x the measured transfer function, carry the uncertainty of the measurement and of what
is declared about it and the model. FRAC (over the lines of a receiver; Heylen and Lammens 1996) and CSAC (over the
receivers of a line; Zang, Grafe and Imregun 2001) have none, and hardly move where chi-square sees an
effect: they are shown and decide nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.arrays import Complex
from specan.errors import require_known
from specan.study.observation import Array, Variable
from specan.study.observation.frf import FrfObservation

DB = 20 / np.log(10)  # decibels of a relative change


@dataclass(frozen=True, eq=False)
class FrfErrors:
    """Errors of one recording; NaN where a receiver is not in use.

    Attributes
    ----------
    bands : array (bands,)
        Nominal third octaves, Hz.
    third : Variable
        Words of the third octaves, and which of them the lines fill in part only.
    level_dB, u_level_dB, phase_deg, u_phase_deg : array (receivers, bands)
        Model over measurement, and standard uncertainties; a positive phase is ahead.
    frac : array (receivers,)
    csac : array (bands,)
        Mean over the lines of the band.
    common : complex array (receivers, bands, errors)
        One standard deviation each of what the bands of a receiver share; relative, the real part to the
        level, the imaginary part to the phase.
    of_all : int
        How many of the last of these errors all receivers share: of their frame, of the modes.
    frequency_hz : array (lines,)
    band_of_line : array (lines,)
        Number of the third octave of every line.
    measured, model : complex array (receivers, lines)
        Zero where a receiver is not in use.
    """

    recording: str
    channels: tuple[str, ...]
    bands: Array
    third: Variable
    level_dB: Array
    u_level_dB: Array
    phase_deg: Array
    u_phase_deg: Array
    frac: Array
    csac: Array
    common: Complex
    of_all: int
    frequency_hz: Array
    band_of_line: NDArray[np.intp]
    measured: Complex
    model: Complex
    plural: str = "channels"

    def mean(self, rows: Sequence[int], bands: Sequence[int]) -> tuple[float, float, float, float]:
        """Mean level error over some receivers and bands, dB, its uncertainty; the same of the phase, degrees."""
        cells = np.ix_(rows, bands)
        there = np.isfinite(self.level_dB[cells])
        count = int(there.sum())
        if not count:
            return (float("nan"),) * 4
        found: list[float] = []
        for value, spread, part, unit in (
            (self.level_dB, self.u_level_dB, self.common.real, DB),
            (self.phase_deg, self.u_phase_deg, self.common.imag, 180 / np.pi),
        ):
            shared = np.where(there[..., None], unit * part[cells], 0.0)
            own = np.where(there, spread[cells], 0.0) ** 2 - np.sum(shared**2, axis=-1)
            of_each, of_all = np.split(shared.sum(axis=1), [shared.shape[-1] - self.of_all], axis=-1)
            variance = np.sum(np.maximum(own, 0.0)) + np.sum(of_each**2) + np.sum(of_all.sum(axis=0) ** 2)
            found += [float(np.nanmean(value[cells])), float(np.sqrt(variance)) / count]
        return found[0], found[1], found[2], found[3]

    @property
    def band_texts(self) -> list[str]:
        """The third octaves as they are printed."""
        return [self.third.short(band, unit=False) for band in self.bands.tolist()]

    @property
    def worst_band(self) -> int:
        """The third octave that is furthest off over all receivers; one that lines fill in part only if all are."""
        off = np.nanmean((self.level_dB / self.u_level_dB) ** 2, axis=0)
        whole = ~np.isin(self.bands, list(self.third.partial))
        return int(np.nanargmax(np.where(whole, off, -1.0) if whole.any() else off))

    def worst_line(self, rows: Sequence[int], bands: Sequence[int]) -> tuple[float, float]:
        """Frequency of the line with the largest error over some receivers and bands, and that error squared."""
        inside = np.isin(self.band_of_line, list(bands))
        off = np.sum(np.abs(self.model[rows] - self.measured[rows]) ** 2, axis=0) * inside
        return float(self.frequency_hz[np.argmax(off)]), float(off.max())

    def number(self, channel: str | None) -> int:
        """Row of a receiver; of the one with the clearest level error if none is named.

        Raises
        ------
        RequestError
            No such receiver is in use.
        """
        used = [c for c, f in zip(self.channels, self.frac, strict=True) if np.isfinite(f)]
        if channel is None:
            clear = np.nan_to_num(np.abs(self.level_dB) / self.u_level_dB).max(axis=1)
            return int(np.argmax(clear))
        require_known(channel, used, f"{channel!r} is not a channel that is fitted")
        return self.channels.index(channel)

    def as_dict(self) -> dict[str, Any]:
        """For JSON: one row a third octave and receiver, then FRAC and CSAC."""
        rows = [
            {
                "third_octave_hz": float(band), "channel": channel,
                "level_error_dB": self.level_dB[m, b], "u_level_dB": self.u_level_dB[m, b],
                "phase_error_deg": self.phase_deg[m, b], "u_phase_deg": self.u_phase_deg[m, b],
                "in_part": float(band) in self.third.partial,
            }
            for m, channel in enumerate(self.channels)
            for b, band in enumerate(self.bands)
            if np.isfinite(self.level_dB[m, b])
        ]  # fmt: skip
        return {
            "recording": self.recording,
            "errors": rows,
            "frac": {c: f for c, f in zip(self.channels, self.frac.tolist(), strict=True) if np.isfinite(f)},
            "csac": dict(zip([f"{b:g}" for b in self.bands], self.csac.tolist(), strict=True)),
        }


def curve_errors(observation: FrfObservation, predicted: Array) -> FrfErrors:
    """Level, phase, FRAC and CSAC of one recording.

    Parameters
    ----------
    observation : FrfObservation
    predicted : array (observation.n,)
        What the model expects in place of `observation.measured`.
    """
    kept = observation.kept
    measured = np.where(kept, observation.response, 0.0)
    model = observation.lines_of(predicted)
    labels = np.zeros(kept.shape)
    labels[kept] = observation.labels["third_octave_hz"][: observation.n // 2]
    bands = np.unique(labels[kept])
    parts = np.full((4, len(kept), len(bands)), np.nan)
    common = np.zeros((len(kept), len(bands), observation.common_at((0, 0)).shape[-1]), dtype=complex)
    for m in np.flatnonzero(kept.any(axis=1)).tolist():
        for b, band in enumerate(bands):
            lines = np.flatnonzero(labels[m] == band)
            if lines.size:
                parts[:, m, b], common[m, b] = _cell(
                    observation, m, lines, measured[m, lines], model[m, lines]
                )
    lines_of = [labels.max(axis=0) == band for band in bands]
    by_line = assurance(measured, model, axis=0)
    return FrfErrors(
        observation.name, observation.channels, bands, observation.variables["third_octave_hz"],
        parts[0], parts[1], parts[2], parts[3],
        frac=assurance(measured, model, axis=1),
        csac=np.array([np.nanmean(by_line[lines]) for lines in lines_of]),
        common=common, of_all=0 if observation.modal is None else observation.modal.shape[-1],
        frequency_hz=observation.frequency_hz,
        band_of_line=np.searchsorted(bands, labels.max(axis=0)),
        measured=measured, model=model, plural=observation.plural,
    )  # fmt: skip


def _cell(
    observation: FrfObservation, mic: int, lines: NDArray[np.intp], measured: Complex, model: Complex
) -> tuple[tuple[float, ...], Complex]:
    """Level, its uncertainty, phase, its uncertainty; and the part of both that bands share."""
    energy = float(np.sum(np.abs(measured) ** 2))
    level = 10 * np.log10(np.sum(np.abs(model) ** 2) / energy)
    phase = np.degrees(np.angle(np.sum(model * np.conj(measured))))
    # a small error d changes sum |H|^2 by 2 Re sum conj(H) d, and the phase by Im of the same
    weight = np.conj(measured) / energy
    number = np.round(observation.frequency_hz[lines] / observation.line_hz).astype(int)
    apart = np.abs(number[:, None] - number)
    known = np.array(observation.line_correlation)
    correlation = np.where(apart < known.size, known[np.minimum(apart, known.size - 1)], 0.0)
    noisy = weight * observation.noise[mic, lines]
    random = float(np.real(np.conj(noisy) @ correlation @ noisy))
    common = weight @ observation.common_at((mic, lines))
    spread = [np.sqrt(random + np.sum(part**2)) for part in (common.real, common.imag)]
    return (level, DB * spread[0], phase, np.degrees(spread[1])), common


def assurance(measured: Complex, model: Complex, axis: int) -> Array:
    """``|sum conj(H_x) H_a|^2 / (sum |H_x|^2 sum |H_a|^2)`` along an axis: FRAC over lines, CSAC over receivers.

    Examples
    --------
    >>> h = np.array([[1.0 + 1j, 2.0, 0.5j]])
    >>> assurance(h, 3 * h, axis=1).round(12).tolist()
    [1.0]
    """
    both = np.abs(np.sum(np.conj(measured) * model, axis=axis)) ** 2
    with np.errstate(invalid="ignore", divide="ignore"):
        found: Array = both / (
            np.sum(np.abs(measured) ** 2, axis=axis) * np.sum(np.abs(model) ** 2, axis=axis)
        )
    return found
