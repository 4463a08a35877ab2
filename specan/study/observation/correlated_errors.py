"""What is uncertain in common over a microphone's lines: its place, its calibration, the model's own error."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.models import Assembly

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Responses = Callable[[Assembly, Sequence[Mapping[str, Any]]], list[Complex]]

DISCREPANCY_BANDS = 3  # an octave: how quickly the model's own error may turn with frequency
AXES = ("dx", "dy", "dz")
STEP_M, STEP_K = 1e-3, 0.02
PLACE = slice(0, 3)  # columns of the three coordinates


@dataclass(frozen=True)
class CommonErrors:
    """Declared standard uncertainties.

    Attributes
    ----------
    position_m : float
        Of each coordinate of a microphone.
    calibration_dB, calibration_phase_deg : float
        Of a microphone's calibration.
    discrepancy, detuning : float
        Of the model: part of the response, and half of that part of the third octave's RMS response over all
        microphones (where modes cancel, their errors do not); part of its natural frequencies and bandwidths.
    nominal_K : float
        Temperature to which an offset is added.
    """

    position_m: float
    calibration_dB: float
    calibration_phase_deg: float
    discrepancy: float
    detuning: float
    nominal_K: float

    def columns(
        self, responses: Responses, assembly: Assembly, values: Mapping[str, Any], frequency_hz: Array
    ) -> tuple[Complex, Complex, Complex]:
        """One standard deviation of each error, array (microphones, lines, errors), and slopes a metre.

        Returns
        -------
        of_each : array (microphones, lines, errors)
            Errors that each microphone has for itself.
        of_all : array (microphones, lines, errors)
            Errors of the modes, which every microphone sees: their natural frequencies and bandwidths.
        slopes : array (3, microphones, lines)

        The errors are taken where a fit has brought the model: by the measured response, a line that noise has made
        small would seem to be known better, and by the drawn room a microphone near a nodal plane that has moved
        would seem to stand still.
        """
        response, moved, detuned = _with_slopes(responses, assembly, values, self.nominal_K)
        found = [
            *(self.position_m * slope for slope in moved),
            response * (np.log(10) / 20 * self.calibration_dB),
            1j * response * np.radians(self.calibration_phase_deg),
        ]
        of_all: list[Complex] = []
        for hat in _hats(frequency_hz):
            level = np.sqrt(np.mean(hat * np.abs(response) ** 2) / np.mean(hat))
            of = [self.discrepancy * response, 0.5 * self.discrepancy * level + 0 * response]
            found += [hat * size * turn for size in of for turn in (1, 1j)]
            of_all += [hat * self.detuning * detuned * turn for turn in (1, 1j)]
        return np.stack(found, axis=-1), np.stack(of_all, axis=-1), np.stack(moved)


def _with_slopes(
    responses: Responses, assembly: Assembly, values: Mapping[str, Any], nominal_K: float
) -> tuple[Complex, list[Complex], Complex]:
    """Response; its change a metre along x, y and z (all microphones move at once); its change with ln k."""
    model = assembly.model
    places = [f"microphone-position@{name}" for name in model.axes["microphone"]]
    whole = model.assemble({*map(str, assembly.uses), *places, "temperature"})
    here = {**whole.neutral, **values}
    many = [here]
    for axis in AXES:
        for sign in (1, -1):
            names = [f"{use}.{axis}" for use in places]
            many.append({**here, **{n: here[n] + sign * STEP_M for n in names}})
    many += [{**here, "temperature.offset": here["temperature.offset"] + sign * STEP_K} for sign in (1, -1)]
    found = responses(whole, many)
    steps = ((1, STEP_M), (3, STEP_M), (5, STEP_M), (7, STEP_K))
    slopes = [(found[k] - found[k + 1]) / (2 * step) for k, step in steps]
    # k goes as T^(-1/2), and the response as the density besides
    return found[0], slopes[:3], -2 * (nominal_K * slopes[3] + found[0])


def moved_to(
    assembly: Assembly, many: Sequence[Mapping[str, Any]], moved: Array
) -> tuple[Assembly, list[dict[str, Any]]]:
    """The model with its microphones somewhere else than drawn, on top of what an effect moves them."""
    places = [f"microphone-position@{name}" for name in assembly.model.axes["microphone"]]
    by = {f"{use}.{axis}": moved[m, a] for m, use in enumerate(places) for a, axis in enumerate(AXES)}
    whole = assembly.model.assemble({*map(str, assembly.uses), *places})
    return whole, [{**values, **{n: values.get(n, 0.0) + d for n, d in by.items()}} for values in many]


def _hats(frequency_hz: Array) -> Array:
    """Hat functions a third of an octave apart: a smooth error is a mixture of them."""
    place = DISCREPANCY_BANDS * np.log2(frequency_hz)
    centres = np.arange(np.floor(place[0]), np.ceil(place[-1]) + 1)
    hats = np.clip(1 - np.abs(place - centres[:, None]), 0, None)
    found: Array = hats[hats.any(axis=1)]
    return found
