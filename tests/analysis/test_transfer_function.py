"""Transfer functions of recordings: sign of the phase, corrections, alignment, flags, refusals."""

from dataclasses import replace

import numpy as np
import pytest

from specan.analysis.transfer_function import TransferFunction, TransferFunctionAccumulator, quotient
from specan.data.channel import Channel, PhaseCalibration
from specan.data.recording import ArraySource, Recording
from specan.errors import InputError, RequestError

RATE, N = 8000.0, 40000
RNG = np.random.default_rng(17)
NOISE = RNG.standard_normal(N)
LINES = TransferFunction(lines=400)


def delayed(samples, late):
    """Circularly delayed by any number of samples, band-limited to 90 % of the band."""
    spectrum = np.fft.rfft(samples)
    f = np.arange(len(spectrum)) / len(samples)
    return np.fft.irfft(spectrum * np.exp(-2j * np.pi * f * late) * (f < 0.45), len(samples))


def recording(responses, vibrometer=NOISE, generator=None, **changes):
    samples = [vibrometer, *responses] + ([] if generator is None else [generator])
    common = {"sampling_rate": RATE, "n_samples": len(vibrometer)}
    channels = [Channel("Vibrometer", role="vibrometer", unit="m/s", **common)]
    channels += [
        Channel(f"Mic {k + 1}", role="microphone", unit="Pa", **common) for k in range(len(responses))
    ]
    if generator is not None:
        channels.append(Channel("Generator", role="generator", unit="V", **common))
    channels = [replace(c, **changes.get(c.name.replace(" ", ""), {})) for c in channels]
    return Recording("a.tdms", tuple(channels), ArraySource(samples))


@pytest.mark.parametrize("late", [0.0, 3.0, 2.6, 0.25, -1.4])
def test_a_delayed_response_has_a_falling_phase(late):
    found = LINES(recording([5 * delayed(NOISE, late)]))
    f = found.frequency_hz
    inside = f < 0.4 * RATE
    expected = -360 * f * late / RATE
    np.testing.assert_allclose(found.unwrapped_phase_deg[0, inside], expected[inside], atol=0.6)
    np.testing.assert_allclose(found.magnitude[0, inside], 5, rtol=0.02)
    assert np.polyfit(f[inside], found.unwrapped_phase_deg[0, inside], 1)[0] == pytest.approx(
        -360 * late / RATE, abs=2e-5
    )


def test_a_section_that_the_look_took_in_is_averaged_once():
    """Its own averages give every bit that those of the first look give."""
    noisy = 3 * NOISE + RNG.standard_normal(N)
    looked, own = (
        TransferFunction(lines=3200, align=align)(recording([noisy], generator=NOISE))
        for align in (True, False)
    )
    np.testing.assert_array_equal(looked.response, own.response)
    np.testing.assert_array_equal(looked.u_magnitude_percent, own.u_magnitude_percent)
    assert looked.n_effective == own.n_effective


def test_lines_reach_to_rate_over_2_56_and_leave_out_zero():
    found = LINES(recording([NOISE]))
    assert len(found.frequency_hz) == 400
    assert found.frequency_hz[0] == pytest.approx(RATE / 1024)
    assert found.frequency_hz[-1] == pytest.approx(RATE / 2.56)


@pytest.mark.parametrize(("derivatives", "phase"), [(1, -90.0), (-1, 90.0)])
def test_displacement_and_acceleration_become_velocity(derivatives, phase):
    """p / (j w x) lags by 90 degrees behind p / x, p / (a / j w) leads by 90."""
    plain = LINES(recording([5 * NOISE]))
    found = LINES(recording([5 * NOISE], Vibrometer={"derivatives": derivatives, "unit": "m"}))
    omega = 2 * np.pi * found.frequency_hz
    np.testing.assert_allclose(found.phase_deg[0], phase, atol=1e-9)
    np.testing.assert_allclose(found.magnitude[0], plain.magnitude[0] * omega**-derivatives, rtol=1e-12)
    assert found.units == ("Pa/(m/s)",)
    assert any("velocity" in note for note in found.notes)


def test_calibrated_phase_and_known_delay_are_taken_out():
    leads = PhaseCalibration((1000.0,), (4.0,), (0.2,), model="constant")
    found = LINES(
        recording([delayed(NOISE, 8.0)], Mic1={"delay_s": 8 / RATE, "u_delay_s": 1e-6, "phase": leads})
    )
    inside = found.frequency_hz < 0.4 * RATE
    np.testing.assert_allclose(found.phase_deg[0, inside], -4.0, atol=0.6)
    late = 360 * found.frequency_hz * 1e-6
    np.testing.assert_allclose(
        found.u_common_phase_deg[0], np.hypot(late, leads.u_at(found.frequency_hz)), rtol=1e-9
    )


def test_common_uncertainties_of_both_channels_are_kept_apart():
    found = LINES(
        recording(
            [NOISE], Mic1={"u_gain_percent": 3.0}, Vibrometer={"u_gain_percent": 4.0, "u_delay_s": 1e-5}
        )
    )
    np.testing.assert_allclose(found.u_common_percent, 5.0)
    np.testing.assert_allclose(found.u_common_phase_deg[0], 360 * found.frequency_hz * 1e-5)
    assert found.u_magnitude_percent.max() < 0.1  # no noise was added


def test_a_long_delay_is_aligned_and_costs_nothing():
    late = 200  # samples, a fifth of a block
    responses = [2 * delayed(NOISE, late), NOISE]
    aligned = LINES(recording(responses))
    plain = TransferFunction(lines=400, align=False)(recording(responses))
    inside = aligned.frequency_hz < 0.35 * RATE
    assert aligned.delay_s[0] == pytest.approx(late / RATE)
    assert aligned.delay_s[1] == 0
    assert np.mean(plain.magnitude[0, inside]) < 1.6  # theory: 2 * 0.80
    np.testing.assert_allclose(aligned.magnitude[0, inside], 2, rtol=1e-3)
    turned = np.exp(-2j * np.pi * aligned.frequency_hz * late / RATE)
    np.testing.assert_allclose(np.angle(aligned.response[0, inside] / turned[inside]), 0, atol=1e-3)
    assert any("aligned" in note for note in aligned.notes)


def test_a_tone_is_not_aligned():
    tone = np.sin(2 * np.pi * 440 * np.arange(N) / RATE)
    found = LINES(recording([np.roll(tone, 300) + 0.01 * NOISE], vibrometer=tone))
    assert found.delay_s[0] == 0


def test_generator_as_instrument_overcomes_a_noisy_vibrometer():
    drive = NOISE
    noisy = drive + RNG.standard_normal(N)
    responses = [3 * drive + 0.1 * RNG.standard_normal(N)]
    h1 = LINES(recording(responses, noisy, drive))
    found = TransferFunction(lines=400, estimator="H3c")(recording(responses, noisy, drive))
    assert np.mean(h1.magnitude) == pytest.approx(1.5, rel=0.02)
    assert np.mean(found.magnitude) == pytest.approx(3.0, rel=0.03)
    error = np.abs(found.response / 3 - 1) ** 2 / 2
    assert np.mean(error) == pytest.approx(np.mean((found.u_magnitude_percent / 100) ** 2), rel=0.25)


def test_result_does_not_depend_on_pieces_or_other_channels():
    source = recording([delayed(NOISE, 2.0) + RNG.standard_normal(N) for _ in range(4)])
    whole = LINES(source)
    accumulator = TransferFunctionAccumulator(source, TransferFunction(lines=400, channels=("Mic 3",)))
    for samples in source.blocks(accumulator.channels, 777):
        accumulator.add(samples)
    assert accumulator.result().response.tobytes() == whole.response[2:3].tobytes()


def test_time_section():
    late = np.concatenate([np.zeros(20000), NOISE[20000:]])
    found = TransferFunction(lines=400, start_s=2.5)(recording([late]))
    np.testing.assert_allclose(found.response, 1, atol=1e-9)


def test_default_responses_are_the_microphones():
    assert LINES(recording([NOISE], generator=NOISE)).channels == ("Mic 1",)
    only = recording([NOISE], generator=NOISE, Mic1={"role": "other"})
    assert LINES(only).channels == ("Mic 1", "Generator")


def test_flags():
    nan = NOISE.copy()
    nan[5] = np.nan
    found = LINES(recording([0 * NOISE, nan, 0.01 * NOISE + RNG.standard_normal(N), NOISE]))
    assert list(found.flags) == [("dead",), ("not-finite",), ("low-snr", "low-coherence"), ()]
    assert found.line_flags["low-snr"][2].mean() > 0.9
    assert not found.line_flags["low-snr"][3].any()
    silent = LINES(recording([NOISE], vibrometer=0 * NOISE))
    assert silent.flags == (("no-reference",),)
    assert np.isnan(silent.response).all()


def test_refusals():
    with pytest.raises(InputError, match="vibrometer"):
        LINES(recording([NOISE], Vibrometer={"role": "other"}))
    with pytest.raises(InputError, match="generator"):
        TransferFunction(estimator="H3c")(recording([NOISE]))
    with pytest.raises(RequestError, match="did you mean 'Mic 1'"):
        TransferFunction(reference="Mic1")(recording([NOISE]))
    with pytest.raises(InputError, match="block"):
        TransferFunction(lines=100_000)(recording([NOISE]))
    with pytest.raises(InputError, match="sampled together"):
        LINES(recording([NOISE], Mic1={"sampling_rate": 2 * RATE}))
    with pytest.raises(RequestError, match="section"):
        TransferFunction(start_s=9.0)(recording([NOISE]))


@pytest.mark.parametrize(
    ("unit", "over", "expected"), [("Pa", "m/s", "Pa/(m/s)"), ("V", "V", "1"), ("Pa", "1", "Pa")]
)
def test_units_of_a_ratio(unit, over, expected):
    assert quotient(unit, over) == expected
