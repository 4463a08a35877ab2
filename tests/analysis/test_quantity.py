"""Displacement, velocity and acceleration from each other: a sine has w and w^2 between them."""

import numpy as np
import pytest

from specan.analysis.octave import Octave
from specan.analysis.spectrum import FourierSpectrum
from specan.analysis.transfer_function import TransferFunction
from specan.data.recording import ArraySource, Channel, Recording
from specan.errors import RequestError

RATE, N = 8000.0, 80000
T = np.arange(N) / RATE
OMEGA = 2 * np.pi * 160.0
# 1 um at 160 Hz.
MOTIONS = {
    "m": 1e-6 * np.sin(OMEGA * T),
    "m/s": 1e-6 * OMEGA * np.cos(OMEGA * T),
    "m/s^2": -1e-6 * OMEGA**2 * np.sin(OMEGA * T),
}
EXPECTED = {
    "displacement": ("m", 1e-6),
    "velocity": ("m/s", 1e-6 * OMEGA),
    "acceleration": ("m/s^2", 1e-6 * OMEGA**2),
}


def recording() -> Recording:
    units = [*MOTIONS, "Pa"]
    channels = tuple(Channel(unit, unit=unit, sampling_rate=RATE, n_samples=N) for unit in units)
    return Recording("sine.tdms", channels, ArraySource([*MOTIONS.values(), MOTIONS["m"]]))


@pytest.mark.parametrize("quantity", EXPECTED)
def test_every_motion_becomes_the_one_that_is_asked_for(quantity: str) -> None:
    unit, amplitude = EXPECTED[quantity]
    shown = recording().in_quantity(quantity)
    found = FourierSpectrum(lines=3125, window="flat-top")(shown)
    assert found.units == (unit, unit, unit, "Pa")
    line = int(np.argmin(np.abs(found.frequency_hz - 160.0)))
    assert found.values[:3, line] == pytest.approx([amplitude] * 3, rel=1e-3)
    assert found.values[3, line] == pytest.approx(1e-6, rel=1e-3)  # a pressure is no motion
    bands = Octave(band=160)(shown)
    reference = bands.references[0].value
    assert bands.level_dB[:3, 0] == pytest.approx(
        [20 * np.log10(amplitude / np.sqrt(2) / reference)] * 3, abs=0.05
    )
    assert len({r.text for r in bands.references[:3]}) == 1


def test_transfer_functions_have_its_phase() -> None:
    rng = np.random.default_rng(1)
    noise = rng.standard_normal(N)
    channels = (
        Channel("Force", unit="N", role="generator", sampling_rate=RATE, n_samples=N),
        Channel("Acc", unit="m/s^2", role="accelerometer", sampling_rate=RATE, n_samples=N),
    )
    shown = Recording("hit.tdms", channels, ArraySource([noise, 2 * noise])).in_quantity("velocity")
    found = TransferFunction(reference="Force", lines=400)(shown)
    f = found.frequency_hz
    assert np.allclose(found.response[0], 2 / (2j * np.pi * f))
    assert found.units == ("m/s/N",)
    assert any("acceleration is converted to velocity" in note for note in found.notes)


def test_without_motion_it_is_refused() -> None:
    mic = Channel("Mic", unit="Pa", sampling_rate=RATE, n_samples=N)
    with pytest.raises(RequestError, match="no channel can be shown as velocity"):
        Recording("a.tdms", (mic,), ArraySource([MOTIONS["m"]])).in_quantity("velocity")


@pytest.mark.parametrize("quantity", ["displacement", "velocity"])
@pytest.mark.parametrize(
    ("frequency", "settings"),
    [
        (100.3, {"whole": True}),
        (100.3, {"lines": 400, "averaging": "linear"}),
        (57.0, {"lines": 1600, "window": "flat-top"}),
    ],
)
def test_what_a_window_leaks_is_not_integrated(
    quantity: str, frequency: float, settings: dict[str, object]
) -> None:
    """1 m/s^2 beside an offset: the largest line is the tone's, and nothing is lower than a stated frequency."""
    rate = 5120.0
    t = np.arange(round(5 * rate)) / rate
    channel = Channel("Acc", unit="m/s^2", sampling_rate=rate, n_samples=t.size)
    acceleration = 0.02 + np.cos(2 * np.pi * frequency * t + 0.4)
    shown = Recording("a.tdms", (channel,), ArraySource([acceleration])).in_quantity(quantity)
    found = FourierSpectrum(**settings)(shown)
    true = 1 / (2 * np.pi * frequency) ** (2 if quantity == "displacement" else 1)
    spacing = found.frequency_hz[1]
    away = np.abs(found.frequency_hz - frequency) > 8 * spacing
    assert found.frequency_hz[np.argmax(found.values[0])] == pytest.approx(frequency, abs=spacing)
    assert found.rms[0] == pytest.approx(true / np.sqrt(2), rel=5e-3)
    assert found.values[0, away].max() < 0.01 * true
    assert (found.values[0, :3] == 0).all()
    assert any("integrated from" in note for note in found.notes)


@pytest.mark.parametrize("settings", [{"lines": 3200}, {"whole": True, "stop_s": 0.16}])
def test_the_foot_of_a_tone_below_the_lowest_line_is_no_peak(settings: dict[str, object]) -> None:
    """63 um at 20 Hz, where a flat-top of 6.25 Hz a line has no line: 1.9 um at 43.75 Hz are its lobe, not a motion."""
    rate = 51200.0
    t = np.arange(round(2 * rate)) / rate
    channels = tuple(Channel(name, unit="m/s^2", sampling_rate=rate, n_samples=t.size) for name in ("a", "b"))
    low, high = np.cos(2 * np.pi * 20 * t), np.cos(2 * np.pi * 500 * t)
    shown = Recording("a.tdms", channels, ArraySource([low + 0.3 * high, high])).in_quantity("displacement")
    found = FourierSpectrum(window="flat-top", **settings)(shown)
    assert found.flags == (("mostly-below-the-lowest-line",), ())
    peaks = [float(row[2]) for row in found.sheets()[0].rows]
    assert peaks == pytest.approx([500.0, 500.0], abs=3)
    assert found.values[0, round(500 / 6.25)] == pytest.approx(0.3 / (2 * np.pi * 500) ** 2, rel=5e-3)
    assert any("more lines go lower" in note for note in found.notes)


def test_the_foot_of_a_tone_outside_the_range_is_no_peak() -> None:
    rate = 8000.0
    t = np.arange(8000) / rate
    channel = Channel("Mic 1", unit="Pa", sampling_rate=rate, n_samples=t.size)
    samples = np.cos(2 * np.pi * 500 * t) + 1e-3 * np.cos(2 * np.pi * 800 * t) + np.cos(2 * np.pi * 1500 * t)
    shown = Recording("a.tdms", (channel,), ArraySource([samples]))
    found = FourierSpectrum(whole=True, fmin=501.0, fmax=1499.0)(shown)
    assert float(found.sheets()[0].rows[0][2]) == 800.0
