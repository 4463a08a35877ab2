"""Transfer functions of receivers against a reference channel, compared with a model's.

Rows are the real parts of all receivers (one after the other, each over its lines), then the
imaginary parts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from specan.dsp.bands import band_at, band_edges, nominal_frequency
from specan.models import Assembly, Evaluation
from specan.study.observation import Array, Observation, Strategy, Variable
from specan.study.observation.window_leakage import Folding

Complex = NDArray[np.complex128]

# Correlation of the random errors of lines 1 and 2 apart under a Hann window: (2/3)^2 and (1/6)^2.
LINE_CORRELATION = (1.0, 4 / 9, 1 / 36)


# times its noise that a line's power must be for its level to count: noise then adds 0.4 dB
ABOVE_NOISE = 10.0


class KeptLines(Observation):
    """What observations of complex lines share.

    Attributes
    ----------
    recording : str
    channels : tuple of str
    kept : bool array (channels, lines)
        Rows in use; the real and the imaginary part of a line go together.
    level_of : str
        What the levels of its rows are called.
    cells : tuple of str
        Labels of the rows whose powers are added up to a level.
    """

    level_of: ClassVar[str]
    cells: ClassVar[tuple[str, ...]]
    recording: str
    channels: tuple[str, ...]
    kept: NDArray[np.bool_]

    @property
    def n(self) -> int:
        """Number of real values."""
        return 2 * int(self.kept.sum())

    @property
    def recordings(self) -> tuple[str, ...]:
        """The one recording."""
        return (self.recording,)

    @property
    def places(self) -> Mapping[str, Any]:
        """File of every row, and which part of a line it is."""
        return {"file": self.name, "part": np.repeat(("real", "imaginary"), self.n // 2)}

    def powers(self) -> tuple[Array, Array]:
        """Which rows count for a level, and the power of noise in each that is beside it."""
        raise NotImplementedError

    def stack(self, lines: NDArray[np.complex128]) -> Array:
        """Rows of complex lines (channels, lines, ...)."""
        return np.concatenate([lines.real[self.kept], lines.imag[self.kept]])

    def lines_of(self, rows: Array, unused: float = 0.0) -> NDArray[np.complex128]:
        """Complex lines (channels, lines) of their rows: `stack` undone."""
        lines = np.full(self.kept.shape, unused, dtype=complex)
        real, imaginary = np.split(rows, 2)
        lines[self.kept] = real + 1j * imaginary
        return lines

    def turned(self, rows: Array) -> Array:
        """Rows of lines turned by a right angle."""
        real, imaginary = np.split(rows, 2)
        return np.concatenate([-imaginary, real])

    def sizes(self, rows: Array) -> Array:
        """RMS of the two parts of each line, for both of its rows."""
        real, imaginary = np.split(rows, 2)
        return np.tile(np.sqrt((real**2 + imaginary**2) / 2), 2)

    def rows(self, of_lines: Any) -> NDArray[Any]:
        """Rows of what both parts of a line have alike, broadcast to (channels, lines)."""
        return np.tile(np.broadcast_to(of_lines, self.kept.shape)[self.kept], 2)

    @property
    def channel_of_row(self) -> NDArray[np.str_]:
        """Name of the channel of every row."""
        return self.rows(np.array(self.channels)[:, None])

    def take(self, mask: NDArray[np.bool_]) -> Self:
        """Some of the rows; a line stays where either of its parts does."""
        half = self.n // 2
        kept = self.kept.copy()
        kept[self.kept] = mask[:half] | mask[half:]
        found: Self = replace(self, kept=kept)  # type: ignore[type-var]
        return found


@dataclass(frozen=True, eq=False)
class FrfObservation(KeptLines):
    """Measured transfer functions, one recording.

    Attributes
    ----------
    name, recording : str
    quantities : tuple of str
        The model's quantities that are observed: one of each channel, or one array (receivers, nodes) of all.
    frequency_hz : array (lines,)
    line_hz : float
        Distance of the analysis' lines; those in use may lie further apart.
    channels : tuple of str
        Names of the receivers, in the model's order.
    response : complex array (receivers, lines)
    noise : array (receivers, lines)
        Standard uncertainty of the real and of the imaginary part that lines do not share.
    random : array (receivers, lines)
        The part of it that the measurement shows.
    folding : Folding
        How the analysis sees a transfer function.
    conditions_at_nodes : mapping
        Conditions of the model at the folding's nodes.
    shared : array (receivers, lines, r), complex
        What is uncertain but common to a receiver's lines, one standard deviation a column: its place,
        its calibration, the model's declared discrepancy.
    modal : array (receivers, lines, s), complex
        What is uncertain of the modes, and so common to all receivers, one standard deviation a column.
    kept : bool array (receivers, lines)
        Rows in use; the real and the imaginary part of a line go together.
    observables : tuple of str
        Name of the model's observable; or one for each channel.
    line_correlation : tuple of float
        Correlation of the random errors of lines 0, 1, 2 ... apart; (1,) where lines are independent.
    rough : bool
        Down-weighted: nothing is concluded from its exact minimum.
    notes : tuple of str
        What was found about the recording, for a person.
    """

    name: str
    recording: str
    quantities: tuple[str, ...]
    frequency_hz: Array
    line_hz: float
    channels: tuple[str, ...]
    response: Complex
    noise: Array
    random: Array
    folding: Folding
    conditions_at_nodes: Mapping[str, Array]
    shared: Complex
    kept: NDArray[np.bool_] = field(repr=False)
    modal: Complex | None = None
    observables: tuple[str, ...] = ("frf",)
    line_correlation: tuple[float, ...] = LINE_CORRELATION
    rough: bool = False
    notes: tuple[str, ...] = ()
    kind: ClassVar[str] = "transfer"
    level_of: ClassVar[str] = "third-octave levels"
    plural: ClassVar[str] = "channels"
    cells: ClassVar[tuple[str, ...]] = ("third_octave_hz", "channel")

    @property
    def available(self) -> frozenset[str]:
        """Conditions that the data hold."""
        return frozenset(self.conditions_at_nodes)

    @cached_property
    def sigma(self) -> Array:
        """Standard uncertainty of every row, what is common to a receiver's lines included."""
        common = [np.sum(part**2, axis=-1) for part in (self.common.real, self.common.imag)]
        return np.concatenate([np.sqrt(self.noise**2 + c)[self.kept] for c in common])

    @property
    def common(self) -> Complex:
        """Everything that lines share, (receivers, lines, r + s): `shared`, then `modal`."""
        return self.common_at(...)

    def common_at(self, rows: Any) -> Complex:
        """The same of some receivers and lines."""
        if self.modal is None:
            return self.shared[rows]
        return np.concatenate([self.shared[rows], self.modal[rows]], axis=-1)

    @cached_property
    def measured(self) -> Array:
        """Real parts, then imaginary parts."""
        return self.stack(self.response)

    @cached_property
    def conditions(self) -> Mapping[str, Array]:
        """Frequency of every row."""
        return {"frequency": self.rows(self.frequency_hz)}

    @cached_property
    def observable(self) -> NDArray[np.str_]:
        """Observable of every row."""
        return self.rows(np.array(self.observables)[:, None])

    @cached_property
    def labels(self) -> Mapping[str, NDArray[Any]]:
        """Third octave and receiver of every row."""
        thirds = np.array([nominal_frequency(band_at(f, 3), 3) for f in self.frequency_hz])
        return {"third_octave_hz": self.rows(thirds), "channel": self.channel_of_row}

    @property
    def variables(self) -> Mapping[str, Variable]:
        """Words of the labels."""
        third = Variable("third octave", "Hz", partial=self.partial_thirds)
        return {"third_octave_hz": third, "channel": Variable("channel")}

    @property
    def partial_thirds(self) -> frozenset[float]:
        """Third octaves at the ends of the lines in use that these do not fill."""
        used = self.frequency_hz[self.kept.any(axis=0)]
        step = float(np.median(np.diff(used))) if used.size > 1 else 0.0
        found = set()
        for side, frequency in enumerate((used[0], used[-1])):
            band = band_at(frequency, 3)
            if abs(band_edges(band, 3)[side] - frequency) > step:
                found.add(nominal_frequency(band, 3))
        return frozenset(found)

    @property
    def along(self) -> Array:
        """Where each row lies, in units of two thirds of an octave: a smooth error changes over a third octave."""
        return 1.5 * np.log2(np.maximum(self.conditions["frequency"], self.line_hz))

    @property
    def unshared(self) -> Array:
        """Standard uncertainty of every row that it shares with no other: its noise."""
        return self.rows(self.noise)

    @property
    def usual_sizes(self) -> tuple[Array, Array]:
        """Sizes that what no equation describes may be relative to: each line's own, and the RMS over the receivers."""
        power = np.where(self.kept, np.abs(self.response) ** 2, 0.0).sum(axis=0)
        mean = np.sqrt(power / np.maximum(self.kept.sum(axis=0), 1) / 2)
        return self.sizes(self.measured), self.rows(mean)

    def powers(self) -> tuple[Array, Array]:
        """Lines 10 dB above noise and background, in third octaves that the band does not cut, where there are such."""
        noise = 2 * self.random[self.kept] ** 2
        clear = np.abs(self.response[self.kept]) ** 2 > ABOVE_NOISE * noise
        whole = ~np.isin(self.labels["third_octave_hz"], list(self.partial_thirds))
        counted = np.tile(clear, 2) & (whole if whole.any() else True)
        return counted.astype(float), np.zeros(self.n)

    def predict_many(self, assembly: Assembly, many: Sequence[Mapping[str, Any]]) -> Array:
        """Predictions for several sets of values; what does not depend on what changed is kept."""
        return np.stack([self.stack(response) for response in self.responses(assembly, many)], axis=1)

    def responses(self, assembly: Assembly, many: Sequence[Mapping[str, Any]]) -> list[Complex]:
        """Transfer functions (receivers, lines) as the analysis would see them, for several sets of values."""
        return self.at_each(assembly, many, self.conditions_at_nodes)

    def at_each(
        self, assembly: Assembly, many: Sequence[Mapping[str, Any]], conditions: Mapping[str, Any]
    ) -> list[Complex]:
        """The same at given conditions of the nodes."""
        wanted = list(dict.fromkeys(self.quantities))
        with np.errstate(all="ignore"):  # what is not finite is told by the fit
            evaluations = assembly.evaluate_many(conditions, many, wanted)
            return [self.folding(self._at_nodes(found)) for found in evaluations]

    def whiten(self, array: Array) -> Array:
        """Apply V^(-1/2) along axis 0."""
        flat = self.whiten_each(array.reshape(self.n, -1))
        basis, shrink = self.of_all
        if basis.size:
            flat -= basis @ (shrink[:, None] * (basis.T @ flat))
        return flat.reshape(array.shape)

    def whiten_each(self, flat: Array) -> Array:
        """V^(-1/2) without what the receivers have in common, along axis 0 of a matrix."""
        shape = (2, self.n // 2, flat.shape[1])
        parts = np.split(flat.reshape(shape), np.cumsum(self.kept.sum(axis=1))[:-1], axis=1)
        white = [whitener(part) for part, whitener in zip(parts, self._whiteners, strict=True)]
        return np.concatenate(white, axis=1).reshape(flat.shape)

    @cached_property
    def of_all(self) -> tuple[Array, Array]:
        """Directions that the errors of the modes widen, orthonormal, and by how much each is shortened."""
        if self.modal is None or not self.n:
            return np.empty((self.n, 0)), np.empty(0)
        columns = np.concatenate([self.modal.real[self.kept], self.modal.imag[self.kept]])
        return widened(self.whiten_each(columns))

    @property
    def strategy(self) -> Strategy:
        """Narrow peaks."""
        return Strategy(self.rough, continuation=True)

    def subsample(self, assembly: Assembly, values: Mapping[str, Any], rows: int) -> Self:
        """About `rows` of the rows, predicted without windows; the residual at `values` stays what it is.

        What windows do to the small change that a candidate makes hardly matters for its rank, and the
        model is evaluated at a tenth of the frequencies.
        """
        used = np.flatnonzero(self.kept.any(axis=0))
        every = max(1, int(np.ceil(self.n / rows)))
        lines = used[(every // 2) % max(used.size, 1) :: every]
        part = self.of_lines(lines)
        folded = self.responses(assembly, [values])[0][:, lines]
        plain = part.responses(assembly, [values])[0]
        return replace(part, response=part.response + plain - folded)

    def down_weighted(self, percent: float) -> Self:
        """A few lines, predicted without windows, each known to `percent` of the RMS around it."""
        used = np.flatnonzero(self.kept.any(axis=0))
        # 3 Hz: between its lines; 5 on either side: over which its uncertainty is averaged
        apart = float(np.min(np.diff(self.frequency_hz[used]), initial=3.0))
        part = self.of_lines(used[:: max(1, round(3.0 / apart))])
        power = np.sum(np.abs(part.response) ** 2 * part.kept, axis=0) / part.kept.sum(axis=0)
        around = np.convolve(np.pad(power, 5, mode="edge"), np.full(11, 1 / 11), mode="valid")
        return replace(
            part,
            noise=np.hypot(part.random, percent / 100 * np.sqrt(around)),
            shared=np.empty((*part.response.shape, 0), dtype=complex),
            modal=None,
            rough=True,
        )

    def of_lines(self, lines: NDArray[np.intp]) -> Self:
        """Some of the lines, predicted without windows."""
        frequency = self.frequency_hz[lines]
        names = ["response", "noise", "random", "shared", "kept"] + ["modal"] * (self.modal is not None)
        return replace(
            self,
            **{name: getattr(self, name)[:, lines] for name in names},
            frequency_hz=frequency,
            folding=Folding.none(frequency),
            conditions_at_nodes=self.conditions_at(frequency),
        )

    def without_leakage(self, assembly: Assembly, values: Mapping[str, Any]) -> Self:
        """The same without windows, as far as the model at these values knows what they do."""
        plain = self.of_lines(np.arange(self.frequency_hz.size))
        windows = self.responses(assembly, [values])[0] - plain.responses(assembly, [values])[0]
        return replace(plain, response=self.response - windows)

    # --- how it is done -----------------------------------------------------------------------

    def _at_nodes(self, evaluation: Evaluation) -> Complex:
        """Transfer functions (receivers, nodes) out of what the model was evaluated to."""
        parts = [np.broadcast_arrays(evaluation[q], self.folding.nodes)[0] for q in self.quantities]
        return np.vstack(parts).astype(complex, copy=False)

    def conditions_at(self, frequency: Array) -> dict[str, Array]:
        """Conditions of the model at given lines."""
        known = self.conditions_at_nodes.items()
        return {n: np.interp(frequency, self.folding.nodes, v) if np.ndim(v) else v for n, v in known}

    @cached_property
    def _whiteners(self) -> list[_Whitener]:
        number = np.round(self.frequency_hz / self.line_hz).astype(int)
        return [
            _Whitener.make(number[k], self.noise[m][k], self.shared[m][k], self.line_correlation)
            for m, k in enumerate(self.kept)
        ]


@dataclass(frozen=True)
class _Whitener:
    """V^(-1/2) of one receiver: V = S (C + U U^T) S with S the random sigma, C the lines' correlation."""

    sigma: Array
    banded: Array | None  # lower Cholesky factor of C; None where no lines are near each other
    basis: Array  # orthonormal, (2 lines, r)
    shrink: Array  # by how much each direction of the basis is shortened

    @classmethod
    def make(
        cls, number: NDArray[np.intp], sigma: Array, shared: Complex, correlation: tuple[float, ...]
    ) -> _Whitener:
        from scipy.linalg import cholesky_banded

        banded = np.zeros((len(correlation), len(number)))
        banded[0] = 1.0
        for lag in range(1, len(correlation)):
            gap = number[lag:] - number[:-lag]
            for distance in range(1, len(correlation)):
                banded[lag, : len(gap)] += np.where(gap == distance, correlation[distance], 0.0)
        root = cholesky_banded(banded, lower=True) if banded[1:].any() else None
        plain = cls(sigma, root, np.empty((2 * len(number), 0)), np.empty(0))
        if not len(number) or not shared.shape[1]:
            return plain
        both = plain(np.stack([shared.real, shared.imag]))
        basis, shrink = widened(both.reshape(2 * len(number), -1))
        return replace(plain, basis=basis, shrink=shrink)

    def __call__(self, both: Array) -> Array:
        """Whiten an array (2, lines, columns)."""
        lines = len(self.sigma)
        if not lines:
            return both
        scaled = both / self.sigma[:, None]
        if self.banded is not None:
            from scipy.linalg.lapack import dtbtrs

            rows = scaled.transpose(1, 0, 2).reshape(lines, -1)
            scaled = dtbtrs(self.banded, rows, uplo="L")[0].reshape(lines, 2, -1).transpose(1, 0, 2)
        white = scaled.reshape(2 * lines, -1)
        if self.basis.size:
            white = white - self.basis @ (self.shrink[:, None] * (self.basis.T @ white))
        return white.reshape(2, lines, -1)


def widened(columns: Array) -> tuple[Array, Array]:
    """Basis U and shrink s for which I - U s U^T = (I + C C^T)^(-1/2), C the columns (n, r)."""
    left, size, _ = np.linalg.svd(columns, full_matrices=False)
    seen = size > 1e-6
    return left[:, seen], 1 - 1 / np.sqrt(1 + size[seen] ** 2)


def piecewise_linear_basis(frequency_hz: Array) -> Array:
    """Hat functions a third of an octave apart: a smooth error is a mixture of them."""
    place = 3 * np.log2(frequency_hz)  # three an octave: how quickly the model's own error may turn
    centres = np.arange(np.floor(place[0]), np.ceil(place[-1]) + 1)
    basis = np.clip(1 - np.abs(place - centres[:, None]), 0, None)
    return basis[basis.any(axis=1)]
