"""Octave analysis: what is asked for, what is refused, what the result says."""

from __future__ import annotations

import numpy as np
import pytest

from specan.analysis.octave import Octave, OctaveAccumulator
from specan.data.recording import ArraySource, Channel, Recording
from specan.errors import RequestError
from specan.schema import parse

RATE, N = 8000.0, 32000
TIME = np.arange(N) / RATE
TONE = np.sqrt(2) * np.sin(2 * np.pi * 500.0 * TIME)


def recording(*channels: tuple[str, str, np.ndarray], rate: float = RATE, **more: float) -> Recording:
    return Recording(
        "r.tdms",
        tuple(
            Channel(name, unit=unit, sampling_rate=rate, n_samples=len(x), **more)
            for name, unit, x in channels
        ),
        ArraySource([x for _, _, x in channels]),
    )


def test_a_tone_has_its_level_in_its_band_and_in_all_totals() -> None:
    found = Octave()(recording(("Mic 1", "Pa", 0.02 * TONE), ("Vib", "m/s", 1e-3 * TONE)))
    band = int(np.argmin(np.abs(found.nominal_hz - 500)))
    assert found.level_dB[:, band] == pytest.approx([60.0, 120.0], abs=0.01)
    assert [r.text for r in found.references] == ["20 uPa", "1 nm/s"]
    assert found.overall_dB["Z"] == pytest.approx([60.0, 120.0], abs=1e-6)
    assert found.overall_dB["A"][0] == pytest.approx(60.0 - 3.25, abs=0.03)
    assert np.isnan(found.overall_dB["A"][1])
    assert found.nominal_hz[[0, -1]].tolist() == [20.0, 3150.0]
    assert "at rest at the start" in found.settling


def test_another_reference_of_velocity_can_be_chosen() -> None:
    found = Octave(velocity_reference="50 nm/s")(recording(("Vib", "m/s", 50e-9 * TONE)))
    assert found.overall_dB["Z"][0] == pytest.approx(0.0, abs=1e-6)
    assert found.references[0].text == "50 nm/s"


def test_a_band_level_with_a_weighting() -> None:
    source = recording(("Mic 1", "Pa", 0.02 * TONE))
    plain, weighted = Octave(band=500)(source), Octave(band=500, weighting="A")(source)
    assert plain.exact_hz == pytest.approx([501.187], abs=1e-3)
    assert (weighted.level_dB - plain.level_dB)[0, 0] == pytest.approx(-3.25, abs=0.01)
    assert weighted.weighting == "A"


def test_a_range_and_a_section() -> None:
    louder = np.where(TIME < 2.0, TONE, 10 * TONE)
    source = recording(("Mic 1", "Pa", louder))
    found = Octave(fmin=100, fmax=1000, start_s=2.5, stop_s=3.5)(source)
    assert found.nominal_hz[[0, -1]].tolist() == [100.0, 1000.0]
    assert found.overall_dB["Z"][0] == pytest.approx(94 + 20 - 0.02, abs=0.01)
    assert (found.start_s, found.duration_s) == (2.5, 1.0)


def test_other_bands_from_the_same_pass() -> None:
    source = recording(("Mic 1", "Pa", np.random.default_rng(0).standard_normal(N)))
    accumulator = OctaveAccumulator(source, Octave())
    accumulator.add(source.read(accumulator.channels))
    spectrum = accumulator.spectrum()
    for settings in (Octave(fraction=24, weighting="A"), Octave(fraction=1, fmin=60)):
        again = OctaveAccumulator(source, settings).of_spectrum(spectrum)
        # A short record is transformed no longer than its widest bands need: equal far below the printed digits.
        np.testing.assert_allclose(again.level_dB, settings(source).level_dB, rtol=0, atol=1e-8)


def test_a_displacement_becomes_a_velocity() -> None:
    velocity = recording(("Vib", "m/s", TONE))
    for unit, factor, derivatives in (("m", 1 / (2 * np.pi * 500), 1), ("m/s^2", 2 * np.pi * 500, -1)):
        faded = TONE * np.sin(np.pi * np.arange(N) / N) ** 2
        source = recording(("Vib", unit, factor * faded), derivatives=derivatives)
        expected = Octave()(recording(("Vib", "m/s", faded)))
        found = Octave()(source)
        near = np.abs(found.nominal_hz - 500) < 10
        assert found.units == ("m/s",)
        assert found.level_dB[0, near] == pytest.approx(expected.level_dB[0, near], abs=0.001)
        assert found.overall_dB["Z"] == pytest.approx(expected.overall_dB["Z"], abs=0.001)
    assert velocity.channels[0].target_unit == "m/s"


def test_the_scatter_of_noise_is_what_is_stated() -> None:
    rng = np.random.default_rng(8)
    source = recording(*((f"{i}", "Pa", rng.standard_normal(N)) for i in range(100)))
    found = Octave(fmin=20, fmax=2000)(source)
    scatter = found.level_dB.std(axis=0)
    wide = found.u_dB < 0.7  # few degrees of freedom are not Gaussian in dB
    assert wide.sum() > 8
    np.testing.assert_allclose(scatter[wide] / found.u_dB[wide], 1.0, atol=0.25)
    narrow = ["low-BT" in found.band_flags(0, band) for band in range(found.u_dB.size)]
    assert narrow[0]
    assert narrow == (found.u_dB > 1.0).tolist()
    assert found.band_flags(0, -1) == ()


def test_flags_of_channels_and_of_the_file() -> None:
    broken = np.where(np.arange(N) == 5, np.nan, TONE)
    source = recording(("Mic 1", "Pa", broken), ("Mic 2", "Pa", np.zeros(N)), ("Mic 3", "Pa", TONE))
    found = Octave()(Recording(source.label, source.channels, source.source, flags=("truncated",)))
    assert found.flags == (("nan", "truncated"), ("dead", "truncated"), ("truncated",))
    assert np.isnan(found.level_dB[0]).all()
    assert np.isneginf(found.level_dB[1]).all()
    assert np.array_equal(found.level_dB[2], Octave()(recording(("Mic 3", "Pa", TONE))).level_dB[0])


def test_weightings_are_for_sound_pressure() -> None:
    source = recording(("Mic 1", "Pa", TONE), ("Vib", "m/s", TONE))
    found = Octave(weighting="A")(source)
    assert found.channels == ("Mic 1",)
    assert found.notes == ("Vib is left out: A is for Pa, not m/s",)
    with pytest.raises(RequestError, match=r"Vib is in m/s; expected sound pressure"):
        Octave(weighting="A", channels=("Vib",))(source)
    with pytest.raises(RequestError, match="sound pressure"):
        Octave(weighting="B")(recording(("Vib", "m/s", TONE)))


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (Octave(fmax=4000), r"band at 4000 Hz reaches above half the sampling rate.*up to 3150 Hz"),
        (Octave(band=5000), r"up to 3150 Hz"),
        (Octave(fraction=1, fmin=3000), r"up to 2000 Hz"),
        (Octave(start_s=4.0), "holds no sample"),
        (Octave(channels=("Mik 1",)), "did you mean 'Mic 1'"),
    ],
)
def test_what_cannot_be_done_is_refused(settings: Octave, message: str) -> None:
    with pytest.raises(RequestError, match=message):
        settings(recording(("Mic 1", "Pa", TONE)))


def test_settings_that_contradict_each_other() -> None:
    with pytest.raises(RequestError, match="settings: one band or a range"):
        parse(Octave, {"band": 100, "fmin": 50}, "settings")
    with pytest.raises(RequestError, match="is above fmax"):
        parse(Octave, {"fmin": 100, "fmax": 50}, "settings")
    with pytest.raises(RequestError, match="'fraction' is 5"):
        parse(Octave, {"fraction": 5}, "settings")


def test_a_time_weighted_analysis_has_a_history_and_says_what_has_not_settled() -> None:
    louder = np.where(TIME < 2.0, TONE, 10 * TONE)
    source = recording(("Mic 1", "Pa", louder), ("Vib", "m/s", 1e-3 * louder))
    found = Octave(averaging="fast", fraction=1, fmin=30)(source)
    history = found.history
    assert history is not None
    assert (history.time_s[[0, -1]].tolist(), history.interval_s) == ([0.015625, 4.0], 0.015625)
    band = int(np.argmin(np.abs(found.nominal_hz - 500)))
    before = np.abs(history.time_s - 1.9) < 0.0078
    assert history.level_dB[0, band, before] == pytest.approx([93.98], abs=0.05)
    assert history.overall_dB["Z"][:, before].ravel() == pytest.approx([93.98, 120.0], abs=0.05)
    assert found.level_dB[:, band] == pytest.approx([113.98, 140.0], abs=0.05)
    assert np.isnan(found.overall_dB["A"][1])
    assert (found.averaging, found.hold) == ("fast", None)
    assert found.u_dB[band] == pytest.approx(4.343 / np.sqrt(353.08 * 0.25), rel=1e-3)
    slow = Octave(averaging="slow", fraction=1)(source)
    assert slow.unsettled is not None
    assert slow.unsettled.all()
    assert "unsettled" in slow.band_flags(0, band)
    assert found.unsettled is not None
    assert not found.unsettled[band]


def test_the_largest_and_the_smallest_level() -> None:
    louder = np.where((TIME > 1.5) & (TIME < 2.5), 10 * TONE, TONE)
    source = recording(("Mic 1", "Pa", louder))
    largest = Octave(averaging=0.1, hold="max", band=500)(source)
    smallest = Octave(averaging=0.1, hold="min", band=500)(source)
    assert largest.level_dB[0, 0] == pytest.approx(113.98, abs=0.1)
    assert smallest.level_dB[0, 0] == pytest.approx(93.98, abs=0.1)
    assert (largest.averaging, smallest.hold) == ("0.1 s", "min")
    assert "leaves out" in smallest.settling
    with pytest.raises(RequestError, match="settings: hold, interval and percentiles need averaging fast"):
        parse(Octave, {"hold": "max"}, "settings")
    for wrong in (-1.0, "quick", True):
        with pytest.raises(
            RequestError, match=r"'averaging' is .*; expected linear, fast, slow, impulse, or a time"
        ):
            parse(Octave, {"averaging": wrong}, "settings")
    assert parse(Octave, {"averaging": 2}, "settings").time_constant == 2.0


@pytest.mark.parametrize("seconds", [1.0, 20.0])
def test_a_history_holds_the_largest_level_of_a_knock(seconds: float) -> None:
    """1 ms of 1 Pa: 10 lg(1 - exp(-0.001 / tau)) below 1 Pa when it ends, wherever the readings are."""
    knock = np.where(np.abs(np.arange(round(seconds * RATE)) / RATE - 0.5505) < 0.0005, 1.0, 0.0)
    found = Octave(averaging="fast", fraction=1, band=1000)(recording(("Mic 1", "Pa", knock)))
    true = 93.98 + 10 * np.log10(1 - np.exp(-0.001 / 0.125))
    assert found.history is not None
    assert found.history.overall_max_dB["Z"][0] == pytest.approx(true, abs=0.05)
    assert found.history.overall_dB["Z"].max() == pytest.approx(true - 0.3, abs=0.3)
    held = Octave(averaging="fast", fraction=1, band=1000, hold="max")(recording(("Mic 1", "Pa", knock)))
    assert np.array_equal(found.history.max_dB, held.level_dB)


def test_a_long_history_has_a_bounded_number_of_readings() -> None:
    assert Octave(averaging="fast").reading_interval(15.0) == 0.015625
    assert Octave(averaging="fast").reading_interval(3600.0) == pytest.approx(3.609375)
    assert Octave(averaging="fast", interval_s=0.5).reading_interval(3600.0) == 0.5


@pytest.mark.parametrize("n", [1, 2, 40])
def test_a_few_samples_are_no_error(n: int) -> None:
    few = recording(("Mic 1", "Pa", TONE[7 : 7 + n]))
    assert Octave()(few).level_dB.shape == (1, 23)
    found = Octave(averaging="slow", hold="min")(few)
    assert np.isnan(found.level_dB).all()
    assert found.unsettled is not None
    assert found.unsettled.all()


def test_samples_that_are_not_finite_or_huge_cost_their_channel_only() -> None:
    infinite = np.where(np.arange(N) == 5, np.inf, TONE)
    source = recording(("a", "Pa", infinite), ("b", "Pa", 1e200 * TONE), ("c", "Pa", TONE))
    for averaging in ("linear", "fast"):
        found = Octave(averaging=averaging, fraction=1)(source)
        assert np.isnan(found.level_dB[0]).all()
        assert found.flags[0] == ("nan",)
        alone = Octave(averaging=averaging, fraction=1)(recording(("c", "Pa", TONE)))
        assert np.array_equal(found.level_dB[2], alone.level_dB[0])
