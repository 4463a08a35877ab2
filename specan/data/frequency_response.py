"""Transfer functions of several channels over one reference, with what each line is worth."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from specan.arrays import Complex, Flags, Real
from specan.data.levels import decibels
from specan.errors import RequestError
from specan.result import RecordingResult, Sheet, counted, picked

if TYPE_CHECKING:
    import xarray as xr


# A line whose magnitude is known to no better than 10 % (0.9 dB), and one of which less than half is
# linearly related to the reference.
LOW_SNR_PERCENT, LOW_COHERENCE = 10.0, 0.5
# Leakage of a line is flagged above 1 % (0.09 dB), where it is the larger part of the uncertainty.
LEAKAGE_PERCENT = 1.0
# Attributes (channels, lines) beside the response: of each line, and common to all.
LINES = "coherence u_magnitude_percent u_phase_deg u_leakage_percent"
COMMON = "u_common_percent u_common_phase_deg"


@dataclass(frozen=True, repr=False)
class FrequencyResponse(RecordingResult):
    """Transfer functions (channels, lines): response over reference, exp(+j w t).

    A response that is delayed by tau has the phase -360 f tau degrees.

    Attributes
    ----------
    label : str
        Which recording, or which directory of stepped sines.
    frequency_hz : array (n,)
        Without the line at 0 Hz.
    channels, units : tuple of str
        Responses and the units of their transfer functions ("Pa/(m/s)").
    reference : str
    response : complex array (channels, n)
        Corrected for calibrated phase, delay, and differentiations.
    coherence : array (channels, n)
        NaN for stepped sines.
    u_magnitude_percent, u_phase_deg : arrays (channels, n)
        Standard uncertainties of noise and leakage, per real component. Twice them is the 95 % interval, however few
        the averages: the part of noise is raised by the factor of Student's distribution.
    u_leakage_percent : array (channels, n)
        The part of leakage: what blocks that are too short for the response take from a line.
    degrees_of_freedom : array (channels, n)
        Behind the part of noise.
    u_common_percent, u_common_phase_deg : arrays (channels, n)
        Standard uncertainties of calibration and delay, which are common to all lines or
        vary slowly with frequency: no averaging over lines makes them smaller.
    estimator : str
        "H1", "H2", "Hv", "H3c" or "stepped sine".
    n_blocks : int
    n_effective : float
        Number of independent averages behind each line.
    line_correlation : float
        Correlation of the random errors of neighbouring lines, that of the window (Hann: 4/9).
    delay_s : array (channels,)
        Delay by which each channel was shifted before the analysis (and turned back).
    reference_rms : float
        RMS of the reference, in its unit after correction where it is within the lines.
    reference_unit : str
    flags : tuple of tuples of str
        Words for each channel.
    """

    verb = "frf"

    frequency_hz: Real
    reference: str
    response: Complex
    coherence: Real
    u_magnitude_percent: Real
    u_phase_deg: Real
    u_leakage_percent: Real
    degrees_of_freedom: Real
    u_common_percent: Real
    u_common_phase_deg: Real
    estimator: str
    n_blocks: int
    n_effective: float
    line_correlation: float
    delay_s: Real
    reference_rms: float
    reference_unit: str

    dimensions = ("channel", "frequency_hz")
    over = f"magnitude phase_deg {LINES} {COMMON}"
    common = (
        "reference reference_unit reference_rms estimator n_blocks n_effective line_correlation frequency_hz"
    )
    each = f"unit=units magnitude phase_deg {LINES} degrees_of_freedom {COMMON} delay_s flags"

    @property
    def u_total_percent(self) -> Real:
        """Standard uncertainty of the magnitude (channels, n): random and common parts in quadrature."""
        return np.hypot(self.u_magnitude_percent, self.u_common_percent)

    @property
    def u_total_phase_deg(self) -> Real:
        """The same of the phase."""
        return np.hypot(self.u_phase_deg, self.u_common_phase_deg)

    def to_xarray(self) -> xr.Dataset:
        """As `Result.to_xarray`, with the complex transfer functions as ``H``."""
        return super().to_xarray().assign(H=(self.dimensions, self.response))

    def summary(self) -> str:
        """What it is, on one line."""
        return (
            f"{self.label}, {self.estimator} of {counted(len(self.channels), 'channel')} over {self.reference}, "
            f"{counted(self.frequency_hz.size, 'line')}, {self.n_blocks} blocks"
        )

    def about(self) -> list[str]:
        """Lines above the table in a text file."""
        return [
            f"transfer functions of {self.label}: {self.estimator} over {self.reference} ({self.reference_unit})",
            "magnitude in " + ", ".join(f"{u} ({n})" for n, u in zip(self.channels, self.units)),
            "phase in degrees: exp(+j w t), response over reference",
            "u: standard uncertainty of noise and leakage, u_leakage: its part of leakage; u_common: that of "
            "calibration and delay",
        ]

    def tables(self) -> Iterable[dict[str, Any]]:
        """The columns, with words for each line."""
        for row, (table, own) in enumerate(zip(super().tables(), self.flags)):
            yield {**table, "flags": self.line_words(row, own)}

    def line_words(self, row: int, own: tuple[str, ...]) -> list[str]:
        """The words of a channel, and those of each of its lines."""
        extra = {name: lines[row] for name, lines in self.line_flags.items() if name not in own}
        code = sum(lines.astype(int) << bit for bit, lines in enumerate(extra.values()))
        texts = [
            " ".join((*own, *(name for bit, name in enumerate(extra) if combination >> bit & 1)))
            for combination in range(1 << len(extra))
        ]
        return [texts[combination] for combination in np.broadcast_to(code, self.frequency_hz.size).tolist()]

    def sheets(self, at_hz: Sequence[float] = ()) -> list[Sheet]:
        """A row a channel: its highest line, or the lines nearest to some frequencies."""
        f = self.frequency_hz
        spacing = f[1] - f[0] if len(f) > 1 else 0.0
        title = (
            f"{self.label}: {self.estimator} over {self.reference} ({self.reference_rms:.4g} {self.reference_unit} "
            f"RMS), {counted(len(f), 'line')} {spacing:.4g} Hz apart, {counted(self.n_blocks, 'block')} "
            f"({self.n_effective:.0f} independent)"
        )
        u_percent, u_phase = self.u_total_percent, self.u_total_phase_deg
        one_unit = self.units[0] if len(set(self.units)) == 1 else ""
        rows = []
        for row, (name, unit, magnitude) in enumerate(zip(self.channels, self.units, self.magnitude)):
            lines = [int(np.argmin(np.abs(f - wanted))) for wanted in at_hz]
            if not at_hz and np.isfinite(magnitude).any():
                lines = [int(np.nanargmax(magnitude))]
            rows += [
                [
                    name, f"{f[k]:.6g}", f"{magnitude[k]:.5g}" + ("" if one_unit else f" {unit}"),
                    *(f"{self.phase_deg[row, k]:.2f}", f"{self.coherence[row, k]:.4f}"),
                    *(f"{u_percent[row, k]:.3g}", f"{u_phase[row, k]:.3g}"),
                ]
                for k in lines
            ] or [[name, *[""] * 6]]  # fmt: skip
        hertz = "Hz" if at_hz else "peak Hz"
        header = ["channel", hertz, one_unit or "magnitude", "phase deg", "coherence", "u %", "u deg"]
        return [Sheet(title, header, rows)]

    def between(self, fmin: float, fmax: float) -> FrequencyResponse:
        """The lines from `fmin` to `fmax`.

        Raises
        ------
        RequestError
            There are none.
        """
        kept = lines_between(self.frequency_hz, fmin, fmax)
        lines = picked(self, f"response {LINES} degrees_of_freedom {COMMON}")
        return replace(
            self,
            frequency_hz=self.frequency_hz[kept],
            **{name: values[:, kept] for name, values in lines.items()},
        )

    @property
    def magnitude(self) -> Real:
        """|H| in `units`."""
        return np.abs(self.response)

    @property
    def level_dB(self) -> Real:
        """20 log10 |H|, re 1 of its unit."""
        return decibels(self.response)

    @property
    def phase_deg(self) -> Real:
        """Phase in degrees, in (-180, 180]."""
        phase = np.degrees(np.angle(self.response))
        return np.where(phase <= -180.0, 180.0, phase)

    @property
    def unwrapped_phase_deg(self) -> Real:
        """Phase without jumps of 360 degrees; NaN lines stay."""
        phase = self.phase_deg.copy()
        for row in phase:
            known = np.isfinite(row)
            row[known] = np.unwrap(row[known], period=360.0)
        return phase

    @cached_property
    def line_flags(self) -> dict[str, Flags]:
        """Lines (channels, n) that are worth little: ``low-snr``, ``low-coherence`` and ``leakage``."""
        with np.errstate(invalid="ignore"):
            return {
                "low-snr": ~(self.u_magnitude_percent <= LOW_SNR_PERCENT),
                "low-coherence": self.coherence < LOW_COHERENCE,
                "leakage": leaking(self.u_leakage_percent, self.u_magnitude_percent),
            }


def lines_between(frequency_hz: Real, fmin: float, fmax: float) -> Flags:
    """Lines from `fmin` to `fmax`.

    Raises
    ------
    RequestError
        There are none.
    """
    kept = (frequency_hz >= fmin) & (frequency_hz <= fmax)
    if not kept.any():
        raise RequestError(
            f"no line lies between {fmin:g} and {fmax:g} Hz",
            expected=f"a range within {frequency_hz[0]:g} to {frequency_hz[-1]:g} Hz",
        )
    return np.asarray(kept)


def leaking(u_leakage_percent: Real, u_magnitude_percent: Real) -> Flags:
    """Lines whose leakage exceeds 1 % and what noise makes uncertain."""
    with np.errstate(invalid="ignore"):
        found = (u_leakage_percent > LEAKAGE_PERCENT) & (2 * u_leakage_percent**2 >= u_magnitude_percent**2)
    return np.asarray(found)
