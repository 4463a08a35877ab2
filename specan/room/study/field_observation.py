"""Transfer functions of microphones in a room: with what is uncertain of their places and of the field's modes."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from specan.models import Assembly
from specan.room.model.mode_shifts import COLUMNS_READ, columns
from specan.room.model.places import FieldReceivers, shifts_of
from specan.study.observation import Array, Strategy
from specan.study.observation.frf import Complex, FrfObservation, piecewise_linear_basis

FARTHEST = 3.5  # standard uncertainties that a receiver may be found away
STEP_M, STEP_K = 1e-3, 0.02  # of the differences that give slopes of the field
ALONG = ("dx", "dy", "dz")  # parameters that move a microphone
PLACE = slice(0, 3)  # columns of the three coordinates


@dataclass(frozen=True, eq=False)
class Drift:
    """A condition that changed while a recording was made.

    Attributes
    ----------
    condition : str
    sd : float
        Standard deviation over the recording.
    by_line : array (lines,)
        Its mean in the blocks, as the estimate of each line weighs them, off the plain mean; over `sd`.
    """

    condition: str
    sd: float
    by_line: Array

    @classmethod
    def of(cls, condition: str, course: Array, power: Array) -> Drift:
        """From its course over a record, and the reference's power (blocks, lines) in half-overlapping blocks.

        An estimate H1 is the mean of what the blocks show, weighed by the power that drives each: sum_b |V_b|^2 H(T_b).
        """
        step = 1 / (len(power) + 1)
        middle = np.interp(step * np.arange(1, len(power) + 1), np.linspace(0, 1, course.size), course)
        sd = float(course.std())
        return cls(condition, sd, middle @ power / power.sum(axis=0) / sd)


@dataclass(frozen=True, eq=False)
class FieldObservation(FrfObservation):
    """Measured transfer functions of one recording in a field.

    Attributes
    ----------
    declared : FieldReceivers, optional
        What `about` makes `shared` of.
    moved : array (receivers, 3), optional
        Where the receivers probably stand, m from the drawing: `shared` holds the slopes there.
    offset : complex array (receivers, lines)
        Added to a prediction for the moved places: back along the slopes to the drawn ones.
    shifts : int
        How many of the last columns of `modal` are shifts of single modes. `offset` takes what the model holds of
        them back along these columns: they are uncertain about no shift.
    drift : Drift, optional
        Of a condition that changed while it was recorded.
    warming : Drift, optional
        What `drift` is where the air warms steadily, by one kelvin from the beginning to the end.
    """

    declared: FieldReceivers | None = None
    moved: Array | None = None
    offset: Complex | float = 0.0
    shifts: int = 0
    drift: Drift | None = None
    warming: Drift | None = None
    kind: ClassVar[str] = "frf"
    plural: ClassVar[str] = "microphones"

    def responses(self, assembly: Assembly, many: Sequence[Mapping[str, Any]]) -> list[Complex]:
        """Transfer functions (receivers, lines) as the analysis would see them, for several sets of values."""
        assembly, many = self._where_moved(assembly, many)
        here, drift = self.conditions_at_nodes, self.drift
        if drift is None:
            return [response + self.offset for response in self.at_each(assembly, many, here)]
        sides = [{**here, drift.condition: here.get(drift.condition, 0.0) + s * drift.sd} for s in (-1, 1)]
        low, high = (self.at_each(assembly, many, at) for at in sides)
        # two places with the mean and the spread of the condition; and the slope between them
        means = [(a + b) / 2 + (b - a) / 2 * drift.by_line for a, b in zip(low, high, strict=True)]
        return [mean + self.offset for mean in means]

    def _where_moved(
        self, assembly: Assembly, many: Sequence[Mapping[str, Any]]
    ) -> tuple[Assembly, Sequence[Mapping[str, Any]]]:
        """The model with its receivers where they were found, on top of what an effect moves them."""
        if self.moved is None:
            return assembly, many
        places = movers(assembly)
        by = {
            f"{use}.{axis}": self.moved[m, a] for m, use in enumerate(places) for a, axis in enumerate(ALONG)
        }
        whole = assembly.model.assemble({*map(str, assembly.uses), *places})
        return whole, [{**values, **{n: values.get(n, 0.0) + d for n, d in by.items()}} for values in many]

    @property
    def strategy(self) -> Strategy:
        """A covariance about a fit where errors are declared that act through the field."""
        return replace(super().strategy, linearised_covariance=self.declared is not None)

    def down_weighted(self, percent: float) -> FieldObservation:
        """A few lines, predicted without windows and with nothing declared."""
        few = super().down_weighted(percent)
        return replace(few, shifts=0, declared=None, moved=None, offset=0.0)

    def of_lines(self, lines: Any) -> FieldObservation:
        """Some of the lines, predicted without windows."""
        return replace(
            super().of_lines(lines),
            offset=self.offset[:, lines] if isinstance(self.offset, np.ndarray) else self.offset,
            drift=self.drift and replace(self.drift, by_line=self.drift.by_line[lines]),
        )

    def without_leakage(self, assembly: Assembly, values: Mapping[str, Any]) -> FieldObservation:
        """The same without windows, about the drawn places."""
        return FrfObservation.without_leakage(replace(self, moved=None, offset=0.0), assembly, values)

    def about(
        self, assembly: Assembly, values: Mapping[str, Any], seen: bool = True, placed: Collection[str] = ()
    ) -> FieldObservation:
        """The same with the declared errors where the model at these values says that they act.

        Where the data may be `seen`, the slopes are taken where the receivers probably stand: at a nodal plane
        the field bends within some millimetres. A receiver with a free place of its own (`placed`) has no error of
        place beside it, which would take a part of what that effect should say.
        """
        if self.declared is None:
            return self
        found = self.about_unshifted(assembly, values, seen, placed)
        if not self.declared.shifts or found.modal is None:
            return found
        own = found.shift_columns(assembly, values)
        modal = np.concatenate([found.modal, own], axis=-1)
        back = own @ shifts_of(values, self.declared.shifts)
        return replace(found, modal=modal, offset=found.offset - back, shifts=own.shape[-1])

    def about_unshifted(
        self, assembly: Assembly, values: Mapping[str, Any], seen: bool, placed: Collection[str] = ()
    ) -> FieldObservation:
        """The same without the uncertainty of single modes."""
        assert self.declared is not None
        drawn = replace(self, noise=self.random, moved=None, offset=0.0, shifts=0)
        stand = np.isin(movers(assembly), [str(use) for use in placed])

        def standing(moved: Array | None) -> FieldObservation:
            there = replace(drawn, moved=moved)
            shared, modal, slopes = error_columns(there, assembly, values)
            shared[stand, :, PLACE] = 0
            back = 0.0 if moved is None else -np.einsum("ma,aml->ml", moved, slopes)
            return replace(there, shared=shared, modal=modal, offset=back)

        found = standing(None)
        # 2: times that the places of receivers are improved
        for _ in range(2 if seen else 0):
            moved = self.declared.errors.position_m * found._places(assembly, values)
            del found  # it holds by far the largest arrays
            found = standing(moved)
        return found

    def shift_columns(self, assembly: Assembly, values: Mapping[str, Any]) -> Complex:
        """One standard uncertainty of each mode's natural frequency, then of each mode's damping, where they are."""
        size = len(assembly.model.axes["mode"])
        assembly, (there,) = self._where_moved(assembly, [values])
        known = assembly.evaluate(self.conditions_at_nodes, there, wanted=COLUMNS_READ)
        out = np.empty((*self.response.shape, 2 * size), dtype=complex)
        for k, (column, units) in enumerate(columns(known.values)):
            folded = self.folding(column)
            out[..., k], out[..., size + k] = folded * units[0], folded * units[1]
        return out

    def plain(self, assembly: Assembly, values: Mapping[str, Any]) -> Array:
        """Prediction as it is shown: shifts of modes that were found are not taken back."""
        predicted = super().plain(assembly, values)
        if not self.shifts or self.modal is None:
            return predicted
        return predicted + self.stack(self.modal[..., -self.shifts :] @ shifts_of(values, self.shifts // 2))

    def knowing_shifts(self, root: Array) -> FieldObservation:
        """The same where other data tell the shifts that the model holds: `root` is that of their covariance."""
        if not self.shifts or self.modal is None:
            return self
        columns = self.modal[..., -self.shifts :]
        modal = np.concatenate([self.modal[..., : -self.shifts], columns @ root], axis=-1)
        return replace(self, modal=modal, offset=0.0, shifts=0)

    def _places(self, assembly: Assembly, values: Mapping[str, Any]) -> Array:
        """Most probable displacement of each receiver, in standard uncertainties, array (receivers, 3).

        Where the model fails, its residual counts as noise: it must not be explained by moving receivers.
        """
        rest = self.response - self.responses(assembly, [values])[0]
        out = np.zeros((len(self.channels), 3))
        for m, whitener in enumerate(self._whiteners):
            if not self.kept[m].any():
                continue
            plain = replace(whitener, basis=np.empty((0, 0)), shrink=np.empty(0))
            parts = np.concatenate([rest[m, self.kept[m], None], self.shared[m, self.kept[m]]], axis=1)
            white = plain(np.stack([parts.real, parts.imag])).reshape(-1, parts.shape[1])
            gap, columns = white[:, 0], white[:, 1:]
            excess = max(float(np.mean(whitener(np.stack([parts.real, parts.imag])[..., :1]) ** 2)), 1.0)
            inner = columns.T @ columns / excess + np.eye(columns.shape[1])
            likely = np.linalg.solve(inner, columns.T @ gap / excess)
            out[m] = np.clip(likely[PLACE], -FARTHEST, FARTHEST)
        return out


def field_observations(observations: Iterable[Any]) -> list[FieldObservation]:
    """Those of a sound field, with their type."""
    return [o for o in observations if isinstance(o, FieldObservation)]


def error_columns(
    observation: FieldObservation, assembly: Assembly, values: Mapping[str, Any]
) -> tuple[Complex, Complex, Complex]:
    """One standard deviation of each error, array (receivers, lines, errors), and slopes a metre.

    Returns
    -------
    of_each : array (receivers, lines, errors)
        Errors that each receiver has for itself.
    of_all : array (receivers, lines, errors)
        Errors that all receivers share: of their frame, of the calibrator, and of the modes' natural frequencies
        and bandwidths.
    slopes : array (3, receivers, lines)

    The errors are taken where a fit has brought the model: by the measured response, a line that noise has made
    small would seem to be known better, and by the drawn geometry a receiver near a nodal plane that has moved
    would seem to stand still.
    """
    receivers = observation.declared
    assert receivers is not None
    response, moved, detuned = _with_slopes(observation, assembly, values)
    errors = receivers.errors
    found = [
        *(_of_all(errors.position_m, response) * slope for slope in moved),
        response * (np.log(10) / 20 * _of_all(errors.calibration_dB, response)),
        1j * response * np.radians(_of_all(errors.calibration_phase_deg, response)),
    ]
    of_all = _of_frame(receivers, np.stack(moved))
    if errors.common_dB:
        of_all.append(response * (np.log(10) / 20 * errors.common_dB))
    basis = piecewise_linear_basis(observation.frequency_hz)
    # Many columns of long records take much memory: they are written where they stay.
    of_each = np.empty((*response.shape, len(found) + 4 * len(basis)), dtype=complex)
    common = np.empty((*response.shape, len(of_all) + 2 * len(basis)), dtype=complex)
    of_each[..., : len(found)] = np.stack(found, axis=-1)
    if of_all:
        common[..., : len(of_all)] = np.stack(of_all, axis=-1)
    for n, part in enumerate(basis):
        level = np.sqrt(np.mean(part * np.abs(response) ** 2) / np.mean(part))
        of = [errors.discrepancy * response, 0.5 * errors.discrepancy * level + 0 * response]
        for k, turn in enumerate((1, 1j)):
            of_each[..., len(found) + 4 * n + k] = part * of[0] * turn
            of_each[..., len(found) + 4 * n + 2 + k] = part * of[1] * turn
            common[..., len(of_all) + 2 * n + k] = part * errors.detuning * detuned * turn
    return of_each, common, np.stack(moved)


def _of_all(uncertainty: float | Array, response: Complex) -> float | Array:
    """Uncertainties of the receivers; of places where one may stand some day, those of the usual receiver."""
    if np.ndim(uncertainty) == 0:
        return uncertainty
    known = np.asarray(uncertainty)
    further = len(response) - len(known)
    return np.concatenate([known, np.full((further, 1), np.median(known))])


def _of_frame(receivers: FieldReceivers, slopes: Complex) -> list[Complex]:
    """A shift of all receivers along each axis, and a rotation about each through their middle."""
    errors, found = receivers.errors, []
    arm = receivers.positions_m - receivers.positions_m.mean(axis=0)
    for axis in np.eye(3):
        if errors.frame_m:
            found.append(errors.frame_m * np.tensordot(axis, slopes, axes=1))
        if errors.frame_tilt_deg:
            moved = np.radians(errors.frame_tilt_deg) * np.cross(axis, arm)
            found.append(np.einsum("ma,aml->ml", moved, slopes))
    return found


def _with_slopes(
    observation: FieldObservation, assembly: Assembly, values: Mapping[str, Any]
) -> tuple[Complex, list[Complex], Complex]:
    """Response; its change a metre along x, y and z (all receivers move at once); its change with ln k."""
    places = movers(assembly)
    whole = assembly.model.assemble({*map(str, assembly.uses), *places, "temperature"})
    here = {**whole.neutral, **values}
    steps = [([f"{use}.{axis}" for use in places], STEP_M) for axis in ALONG]
    steps.append((["temperature.offset"], STEP_K))
    sides = [{n: here[n] + s * step for n in names} for names, step in steps for s in (1, -1)]
    response, *found = observation.responses(whole, [here, *({**here, **side} for side in sides)])
    pairs = zip(found[::2], found[1::2], steps, strict=True)
    *slopes, warmer = ((up - down) / (2 * step) for up, down, (_, step) in pairs)
    # k goes as T^(-1/2), and the response as the density besides: dH/d ln k = -2 (T dH/dT + H)
    nominal_K = assembly.model.settings["rig"]["air"]["nominal_temperature_C"] + 273.15
    return response, slopes, -2 * nominal_K * warmer - 2.0 * response


def movers(assembly: Assembly) -> list[str]:
    """Uses that move each of the model's receivers."""
    return [f"microphone-position@{name}" for name in assembly.model.axes["place"]]
