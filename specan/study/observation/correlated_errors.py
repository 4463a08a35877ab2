"""What is uncertain in common over a receiver's lines: its place, its calibration, the model's own error."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.models import Assembly, Receivers

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Responses = Callable[[Assembly, Sequence[Mapping[str, Any]]], list[Complex]]

STEP_M = 1e-3  # of the differences that give slopes of the field
PLACE = slice(0, 3)  # columns of the three coordinates


@dataclass(frozen=True, eq=False)
class CommonErrors:
    """Declared errors of receivers and model, as columns of standard deviations.

    Attributes
    ----------
    receivers : Receivers
        What the model says of its receivers and their errors.
    """

    receivers: Receivers

    @property
    def position_m(self) -> float | Array:
        """Standard uncertainty of each coordinate of a receiver."""
        return self.receivers.errors.position_m

    def columns(
        self, responses: Responses, assembly: Assembly, values: Mapping[str, Any], frequency_hz: Array
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
        response, moved, detuned = _with_slopes(self.receivers, responses, assembly, values)
        errors = self.receivers.errors
        found = [
            *(_of_all(errors.position_m, response) * slope for slope in moved),
            response * (np.log(10) / 20 * _of_all(errors.calibration_dB, response)),
            1j * response * np.radians(_of_all(errors.calibration_phase_deg, response)),
        ]
        of_all = _of_frame(self.receivers, np.stack(moved))
        if errors.common_dB:
            of_all.append(response * (np.log(10) / 20 * errors.common_dB))
        basis = piecewise_linear_basis(frequency_hz)
        # Many columns of long records take much memory: they are written where they stay.
        of_each = np.empty((*response.shape, len(found) + 4 * len(basis)), dtype=complex)
        common = np.empty((*response.shape, len(of_all) + 2 * len(basis)), dtype=complex)
        for k, column in enumerate(found):
            of_each[..., k] = column
        for k, column in enumerate(of_all):
            common[..., k] = column
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


def _of_frame(receivers: Receivers, slopes: Complex) -> list[Complex]:
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
    receivers: Receivers, responses: Responses, assembly: Assembly, values: Mapping[str, Any]
) -> tuple[Complex, list[Complex], Complex]:
    """Response; its change a metre along x, y and z (all receivers move at once); its change with ln k."""
    model, tuned = assembly.model, receivers.wave_number
    places = movers(assembly)
    whole = model.assemble({*map(str, assembly.uses), *places, tuned.effect})
    here = {**whole.neutral, **values}
    many = [here]
    for axis in receivers.along:
        for sign in (1, -1):
            names = [f"{use}.{axis}" for use in places]
            many.append({**here, **{n: here[n] + sign * STEP_M for n in names}})
    by = f"{tuned.effect}.{tuned.parameter}"
    many += [{**here, by: here[by] + sign * tuned.step} for sign in (1, -1)]
    found = responses(whole, many)
    steps = ((1, STEP_M), (3, STEP_M), (5, STEP_M), (7, tuned.step))
    slopes = [(found[k] - found[k + 1]) / (2 * step) for k, step in steps]
    return found[0], slopes[:3], tuned.slope * slopes[3] + tuned.own * found[0]


def movers(assembly: Assembly) -> list[str]:
    """Uses that move each of the model's receivers."""
    receivers = assembly.model.receivers
    assert receivers is not None
    return [f"{receivers.moved_by}@{name}" for name in assembly.model.axes[receivers.axis]]


def moved_to(
    assembly: Assembly, many: Sequence[Mapping[str, Any]], moved: Array
) -> tuple[Assembly, list[dict[str, Any]]]:
    """The model with its receivers somewhere else than drawn, on top of what an effect moves them."""
    receivers, places = assembly.model.receivers, movers(assembly)
    assert receivers is not None
    by = {
        f"{use}.{axis}": moved[m, a] for m, use in enumerate(places) for a, axis in enumerate(receivers.along)
    }
    whole = assembly.model.assemble({*map(str, assembly.uses), *places})
    return whole, [{**values, **{n: values.get(n, 0.0) + d for n, d in by.items()}} for values in many]


def piecewise_linear_basis(frequency_hz: Array) -> Array:
    """Hat functions a third of an octave apart: a smooth error is a mixture of them."""
    place = 3 * np.log2(frequency_hz)  # three an octave: how quickly the model's own error may turn
    centres = np.arange(np.floor(place[0]), np.ceil(place[-1]) + 1)
    basis = np.clip(1 - np.abs(place - centres[:, None]), 0, None)
    found: Array = basis[basis.any(axis=1)]
    return found
