"""Shock response spectra: the closed form of a half sine, scipy's simulation, and exact invariances."""

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.signal import lsim

import specan
from specan.analysis.shock_response import oscillator
from specan.errors import RequestError
from specan_cli.main import main

RATE, LENGTH, PEAK = 50_000.0, 0.011, 300.0  # a half sine of 11 ms, as in IEC 60068-2-27


def half_sine(lead_s: float = 0.0) -> np.ndarray:
    t = np.arange(int(0.1 * RATE)) / RATE - lead_s
    return np.where((t >= 0) & (t <= LENGTH), PEAK * np.sin(np.pi * t / LENGTH), 0.0)


def spectrum(samples: np.ndarray, unit: str = "m/s^2", **settings):
    recording = specan.Recording.from_arrays({"a": samples}, RATE, units={"a": unit})
    return specan.srs(recording, channels="a", **settings)


def undamped(frequency: float) -> tuple[float, float]:
    """Largest primary and residual response of an oscillator without damping (Harris, Shock and Vibration Handbook)."""
    ratio = 1 / (2 * LENGTH * frequency)  # of the pulse's angular frequency over the natural one
    t = np.linspace(0, LENGTH, 200_001)
    primary = (np.sin(np.pi * t / LENGTH) - ratio * np.sin(2 * np.pi * frequency * t)) / (1 - ratio**2)
    return PEAK * primary.max(), PEAK * abs(2 * ratio * np.cos(np.pi / (2 * ratio)) / (1 - ratio**2))


def test_half_sine_against_the_closed_form():
    found = spectrum(half_sine(), quality=1e7, fmin=7.0, fmax=2000.0, per_octave=7)
    for f, value in zip(found.frequency_hz, found.maximax[0], strict=True):
        assert value == pytest.approx(max(undamped(f)), rel=2e-3), f
    # From the table of every handbook: 1.77 times the peak of the pulse, where f times length is 0.8.
    assert found.maximax[0].max() / PEAK == pytest.approx(1.77, abs=0.01)


@pytest.mark.parametrize("response", ["acceleration", "pseudo-velocity", "displacement"])
@pytest.mark.parametrize("frequency", [20.0, 90.0, 1500.0])
def test_filters_against_a_simulation_of_the_differential_equation(response, frequency):
    """`lsim` integrates between samples as if they were joined by lines: what ramp invariance means."""
    from scipy.signal import lfilter

    omega, zeta = 2 * np.pi * frequency, 1 / 20
    base = np.random.default_rng(0).normal(size=2000)
    of = {"acceleration": [2 * zeta * omega, omega**2], "displacement": [-1.0], "pseudo-velocity": [-omega]}
    _, expected, _ = lsim((of[response], [1, 2 * zeta * omega, omega**2]), base, np.arange(2000) / RATE)
    b, a = oscillator(frequency, 10.0, RATE, response)
    # The samples before the first are zero: the ramp up to it is a part of the input.
    base[0] = 0.0
    _, expected, _ = lsim((of[response], [1, 2 * zeta * omega, omega**2]), base, np.arange(2000) / RATE)
    np.testing.assert_allclose(lfilter(b, a, base), expected, atol=1e-9 * np.abs(expected).max())


def test_low_frequencies_see_the_velocity_step_and_high_ones_the_pulse():
    step = 2 * PEAK * LENGTH / np.pi
    velocity = spectrum(half_sine(), quality=1e7, response="pseudo-velocity", fmin=1.0, fmax=1.0)
    assert velocity.maximax[0, 0] == pytest.approx(step, rel=2e-3)
    assert spectrum(half_sine(), fmin=4900.0, fmax=4900.0).maximax[0, 0] == pytest.approx(PEAK, rel=0.02)


def test_signs_pieces_and_units():
    one, other = spectrum(half_sine()), spectrum(-half_sine())
    np.testing.assert_allclose(one.positive, other.negative)
    assert (one.positive >= one.negative).all()
    long = np.concatenate([np.zeros(100_000), half_sine()])  # more than one block of reading
    np.testing.assert_allclose(spectrum(long).maximax, one.maximax, rtol=1e-9)
    np.testing.assert_allclose(spectrum(half_sine() / 9.80665, unit="g").maximax, one.maximax)
    assert "detrend" in " ".join(spectrum(half_sine() + 30).notes)
    # A constant acceleration from the first sample on is a step: the displacement overshoots by exp(-pi zeta / root).
    over = 1 + np.exp(-np.pi * 0.05 / np.sqrt(1 - 0.05**2))
    found = spectrum(np.ones(50_000), response="pseudo-velocity", fmin=100.0, fmax=100.0).maximax[0, 0]
    assert 2 * np.pi * 100 * found == pytest.approx(over, rel=1e-3)


def test_the_verb_prints_writes_and_refuses(tmp_path):
    lines = "\n".join(f"{k / RATE:.6f},{a:.6f}" for k, a in enumerate(half_sine()))
    (tmp_path / "drop.csv").write_text(f"time [s],a [m/s^2]\n{lines}\n", encoding="utf-8")
    done = CliRunner().invoke(
        main,
        [
            "srs",
            str(tmp_path / "drop.csv"),
            "-o",
            str(tmp_path / "srs.csv"),
            "--plot",
            str(tmp_path / "s.svg"),
        ],
    )
    assert done.exit_code == 0, done.output
    assert "peak Hz" in done.output
    assert "maximax" in (tmp_path / "srs.csv").read_text(encoding="utf-8")
    with pytest.raises(RequestError, match="no acceleration"):
        spectrum(half_sine(), unit="Pa")
    with pytest.raises(RequestError, match="half the sampling rate"):
        spectrum(half_sine(), fmax=25_000.0)
