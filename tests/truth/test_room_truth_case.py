"""Recordings of simulated rooms: what is hidden, what is drawn, what is written."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from specan.errors import RequestError
from specan.io.open import open_recording
from truth.room import EFFECTS, RoomCase, simulate, write
from truth.room.layout import UNCERTAINTY
from truth.room.response import BEFORE_S, SAMPLING_RATE

pytestmark = pytest.mark.long

SEED = 22
FIELD = {
    "wall-impedance", "panel-resonance", "helmholtz-resonator", "leak", "temperature", "dimension-error",
    "microphone-position", "piston-size", "flanking-source", "porous-absorber", "scatterer",
}  # fmt: skip


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("responses")


def run(cache: Path, effects: dict[str, float] | None = None, **options: object) -> RoomCase:
    return simulate(SEED, effects, n_mics=10, duration_s=1.0, cache=cache, **options)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def plain(cache: Path) -> RoomCase:
    return run(cache)


def test_every_effect_of_the_list_can_be_hidden() -> None:
    named = {"microphone-delay", "microphone-gain", "piston-breakup", "vibrometer-noise", "air-absorption"}
    named |= {"extended-reaction", "drifting-air", "shaken-microphone"}  # outside the catalogue
    assert set(EFFECTS) == FIELD | named


@pytest.mark.parametrize("name", sorted(FIELD))
def test_an_effect_on_the_field_changes_it_and_nothing_else(name: str, plain: RoomCase, cache: Path) -> None:
    case = run(cache, {name: EFFECTS[name].high})
    np.testing.assert_array_equal(case.take.volts[-2:], plain.take.volts[-2:])
    assert case.rig == plain.rig
    np.testing.assert_array_equal(case.truth.gain_dB, plain.truth.gain_dB)
    error = np.std(case.take.truth[:10] - plain.take.truth[:10], axis=1) / np.std(
        plain.take.truth[:10], axis=1
    )
    assert error.max() > 0.02
    if name == "microphone-position":
        assert np.count_nonzero(error > 1e-9) == 1


def test_a_leak_softens_the_room_at_low_frequencies(plain: RoomCase, cache: Path) -> None:
    case = run(cache, {"leak": 5e-3})
    assert np.abs(case.responses.sum(axis=1)).max() < 0.6 * np.abs(plain.responses.sum(axis=1)).min()


def test_none_hides_nothing(plain: RoomCase, cache: Path) -> None:
    case = run(cache, {"none": 0.0})
    np.testing.assert_array_equal(case.take.volts, plain.take.volts)
    assert case.effects == {}


def test_delay_of_a_card_is_a_delay_of_its_microphones(plain: RoomCase, cache: Path) -> None:
    quiet = run(cache, noise=False)
    case = run(cache, {"microphone-delay@2": 1e-4}, noise=False)
    assert case.truth.details == {"microphone-delay@2": {"card": 2.0}}
    np.testing.assert_allclose(case.take.volts[:8], quiet.take.volts[:8], atol=1e-12)
    later, before = (np.fft.rfft(c.take.volts[8:10] * np.hanning(2048)) for c in (case, quiet))
    lines = slice(200, 500)  # 1 s: whole hertz
    phase = np.angle(np.sum(later[:, lines] * before[:, lines].conj(), axis=0))
    np.testing.assert_allclose(phase, -2 * np.pi * np.arange(200, 500) * 1e-4, atol=0.03)


def test_gain_of_a_microphone(cache: Path) -> None:
    ratio = (
        run(cache, {"microphone-gain@Mic 3": 1.0}, noise=False).take.volts
        / run(cache, noise=False).take.volts
    )
    np.testing.assert_allclose(ratio[2], 10 ** (1 / 20), rtol=1e-9)
    np.testing.assert_allclose(np.delete(ratio, 2, axis=0), 1.0, rtol=1e-9)


def test_the_vibrometer_is_late_and_off_by_what_was_drawn(cache: Path) -> None:
    case = run(cache, noise=False)
    window = np.hanning(2048)
    shown = np.fft.rfft(case.take.volts[-2] * 0.05 * window)[100:600]
    moved = np.fft.rfft(case.take.truth[-2] * window)[100:600]
    f = np.arange(100.0, 600.0)
    late = np.exp(-2j * np.pi * f * case.truth.vibrometer_delay_s)
    assert np.vdot(moved * late, shown) / np.vdot(moved, moved) == pytest.approx(
        1 + case.truth.vibrometer_gain, rel=2e-4
    )
    assert abs(case.truth.vibrometer_delay_s) > 3e-6


def test_noise_and_breakup_stay_in_the_vibrometer(plain: RoomCase, cache: Path) -> None:
    noisy = run(cache, {"vibrometer-noise": 0.1})
    added = (noisy.take.volts - plain.take.volts)[-2] * 0.05
    assert np.std(added) == pytest.approx(0.1 * np.std(plain.take.truth[-2]), rel=0.05)
    broken = run(cache, {"piston-breakup": 0.4})
    for case in (noisy, broken):
        np.testing.assert_array_equal(
            np.delete(case.take.volts, -2, axis=0), np.delete(plain.take.volts, -2, axis=0)
        )
    drawn = broken.truth.details["piston-breakup"]
    x = 400.0 / float(drawn["frequency_hz"])
    factor = 1 + 0.4 * x**2 / (1 - x**2 + 1j * float(drawn["loss_factor"]) * x)
    quiet = run(cache, noise=False).take.volts[-2]
    spectra = np.fft.rfft([run(cache, {"piston-breakup": 0.4}, noise=False).take.volts[-2], quiet])[
        :, 395:406
    ]
    assert np.vdot(spectra[1], spectra[0]) / np.vdot(spectra[1], spectra[1]) == pytest.approx(
        factor, rel=0.02
    )


def test_pressure_is_velocity_through_the_response_with_its_history(cache: Path) -> None:
    case = simulate(SEED, n_mics=10, duration_s=6.0, cache=cache)
    before = round(BEFORE_S * SAMPLING_RATE)
    response = np.roll(case.responses[4], before)
    full = np.convolve(case.take.truth[-2], response)[before:]
    start, stop = len(response), case.take.truth.shape[1] - before
    np.testing.assert_allclose(
        full[start:stop],
        case.take.truth[4, start:stop],
        atol=1e-6 * np.max(np.abs(case.take.truth[4])),
    )
    # The field is there from the first sample on.
    assert np.std(case.take.truth[4, :200]) > 0.3 * np.std(case.take.truth[4])


def test_the_same_seed_gives_the_same_bits_with_and_without_a_cache(plain: RoomCase) -> None:
    again = simulate(SEED, n_mics=10, duration_s=1.0)
    np.testing.assert_array_equal(again.take.volts, plain.take.volts)
    np.testing.assert_array_equal(again.responses, plain.responses)


def test_another_take_is_the_same_room_with_other_noise(plain: RoomCase, cache: Path) -> None:
    kept = set(cache.iterdir())
    other = run(cache, take=1)
    assert set(cache.iterdir()) == kept
    np.testing.assert_array_equal(other.responses, plain.responses)
    assert not np.allclose(other.take.truth[-1], plain.take.truth[-1])
    assert not np.allclose(other.truth.gain_dB, plain.truth.gain_dB)


def test_truth_is_off_by_what_the_rig_declares() -> None:
    from truth.room.case import _draw_truth

    truths = [_draw_truth(seed, 0, 24) for seed in range(40)]
    off = np.array([np.array(t.room.dims_m) / np.array(t.layout.dims_m) - 1 for t in truths])
    assert 100 * np.std(off) == pytest.approx(UNCERTAINTY["dimension_percent"], rel=0.25)
    moved = np.array([np.array(t.room.position_m) - np.array(t.layout.position_m) for t in truths])
    assert np.std(moved) == pytest.approx(UNCERTAINTY["position_m"], rel=0.1)
    assert np.std([t.temperature_C for t in truths]) == pytest.approx(UNCERTAINTY["temperature_K"], rel=0.35)
    assert np.std([t.gain_dB for t in truths]) == pytest.approx(UNCERTAINTY["calibration_dB"], rel=0.1)
    assert len({t.layout.dims_m for t in truths}) == 40
    for t in truths:
        places = np.array(t.layout.position_m)
        assert np.all((places > 0.05) & (places < np.array(t.layout.dims_m) - 0.05))
        assert np.all((np.array(t.layout.dims_m) >= 0.7) & (np.array(t.layout.dims_m) <= 1.2))


def test_files_hold_what_was_recorded_and_tell_nothing(cache: Path, tmp_path: Path) -> None:
    case = run(cache, {"panel-resonance@" + ("z0" if simulate_wall(cache) != "z0" else "z1"): 0.3})
    path, rig_file = write(case, tmp_path / "out")
    recording = open_recording(path)
    assert [c.name for c in recording.channels] == list(case.take.names)
    assert recording.channels[0].sampling_rate == SAMPLING_RATE
    pascal = recording.read(recording.by_role("microphone"))
    gain = 10 ** (case.truth.gain_dB / 20)
    np.testing.assert_allclose(pascal, case.take.volts[:10] / 0.05, atol=1.3e-5)
    close = np.std(pascal / gain[:, None] - case.take.truth[:10], axis=1) / np.std(
        case.take.truth[:10], axis=1
    )
    assert close.max() < 0.03
    assert recording.group_properties["Measurement"]["Excitation"] == "gaussian noise"
    assert tomllib.loads(rig_file.read_text(encoding="utf-8")) == case.rig
    everything = path.read_bytes() + rig_file.read_bytes()
    assert b"panel" not in everything


def simulate_wall(cache: Path) -> str:
    return run(cache).truth.layout.piston.wall


@pytest.mark.parametrize(
    ("effects", "word"),
    [
        ({"wall-impedence": 0.1}, "wall-impedance"),
        ({"leak": -1.0}, "positive"),
        ({"temperature": float("nan")}, "finite"),
        ({"microphone-gain@30": 1.0}, "1 to 10"),
        ({"microphone-delay@x": 1.0}, "1 to 2"),
        ({"wall-impedance@floor": 0.1}, "floor"),
        ({"dimension-error@w": 0.1}, "edge"),
    ],
)
def test_what_cannot_be_hidden_is_refused(effects: dict[str, float], word: str, cache: Path) -> None:
    with pytest.raises(RequestError, match=word):
        run(cache, effects)


def test_too_many_microphones() -> None:
    with pytest.raises(RequestError, match="1 to 24"):
        simulate(1, n_mics=25)


def test_calibrator_recordings_tell_the_sensitivities_and_nothing_of_what_is_hidden(
    cache: Path, tmp_path: Path
) -> None:
    from specan.analysis.calibration import calibrate

    case = run(cache, {"microphone-gain@Mic 3": 2.0}, calibrated=False)
    write(case, tmp_path, calibrations=True)
    files = sorted(tmp_path.glob("calibration_*.tdms"))
    assert len(files) == 2  # ten microphones, six at a time, the first in both
    found = calibrate([open_recording(f) for f in files])
    assert [c.channel for c in found.channels] == [f"Mic {m}" for m in range(1, 11)]
    delivered = case.at_calibration
    measured = np.array([c.sensitivity / 1000.0 for c in found.channels])
    np.testing.assert_allclose(measured, delivered.sensitivity_V_per_Pa, rtol=4e-3)
    phases = np.array([c.phase.phase_deg[0] for c in found.channels])
    np.testing.assert_allclose(phases, delivered.phase_deg - delivered.phase_deg[0], atol=0.1)
    assert np.std(delivered.sensitivity_dB) > 0.3
    left = case.hardware.sensitivity_dB - delivered.sensitivity_dB
    np.testing.assert_allclose(left, case.truth.gain_dB, atol=1e-12)
    assert left[2] > 1.5
