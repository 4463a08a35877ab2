"""What is hidden in a simulated room does what physics says of it, worked out another way."""

from dataclasses import replace

import numpy as np
import pytest

from truth.room import simulate
from truth.room.box import Box, Disc
from truth.room.branch import Lining, Motion
from truth.room.case import _over_time
from truth.room.field import Room, march, pressure_per_velocity
from truth.room.hidden_in_walls import GRAZING_OVER_NORMAL
from truth.room.layer import POROSITY, STATIC_PRESSURE, STRUCTURE, Layer, layer_motions
from truth.room.losses import Air
from truth.room.obstacle import Block, _mirrored
from truth.room.record import DRIVE_V, Session, record
from truth.room.response import SAMPLING_RATE

pytestmark = pytest.mark.long

C, RHO = 343.2, 1.204
F = np.arange(60.0, 601.0, 20.0)
OMEGA = 2 * np.pi * F


def admittance(motion: Motion) -> np.ndarray:
    return 1 / (motion.resistance + 1j * (OMEGA * motion.mass - motion.stiffness / OMEGA))


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    return tmp_path_factory.mktemp("responses")


# --- in the walls --------------------------------------------------------------------------------------


@pytest.mark.parametrize("thickness", [0.03, 0.05, 0.08])
@pytest.mark.parametrize("resistivity", [6e3, 4e4])
def test_the_oscillators_of_a_porous_layer_are_its_transmission_line(thickness, resistivity):
    series = resistivity + 1j * OMEGA * STRUCTURE * RHO / POROSITY
    shunt = 1j * OMEGA * POROSITY / STATIC_PRESSURE
    exact = np.sqrt(shunt / series) * np.tanh(np.sqrt(series * shunt) * thickness)
    found = sum(admittance(m) for m in layer_motions(Layer(thickness, resistivity), RHO))
    assert np.max(np.abs(found / exact - 1)) < 0.025
    assert np.all(np.diff((RHO * C * exact).real) > 0)  # a thin layer takes more with frequency


def test_part_of_a_wall_takes_that_part():
    motion = Motion(0.1, 300.0, 1e5)
    np.testing.assert_allclose(admittance(motion.spread_over(0.3)), 0.3 * admittance(motion))


def duct_mode(beta: np.ndarray, along: int, dims: tuple[float, float, float], x: float) -> np.ndarray:
    """Pressure of the duct mode cos(along pi y / Ly) at x, driven with unit velocity of its shape at x = 0."""
    k = np.sqrt((OMEGA / C) ** 2 - (along * np.pi / dims[1]) ** 2 + 0j)
    k0 = OMEGA / C
    rest, whole = k * (dims[0] - x), k * dims[0]
    ratio = k0 * beta / k
    return (
        RHO
        * C
        * k0
        / k
        * (np.cos(rest) + 1j * ratio * np.sin(rest))
        / (ratio * np.cos(whole) + 1j * np.sin(whole))
    )


@pytest.mark.parametrize("tension", [0.0, 6e4])
def test_a_sheet_under_tension_answers_each_angle_in_its_own_way(tension):
    """A duct with the sheet as its end: every mode across it has an admittance of its own, that of tension k_y^2."""
    dims = (0.9, 0.6, 0.08)
    motion = Motion(mass=0.8, resistance=1500.0, stiffness=0.8 * (2 * np.pi * 180.0) ** 2)
    # Four listening points of one height tell the modes 0 and 1 across the duct apart: weights of a cosine transform.
    y = dims[1] * (np.arange(4) + 0.5) / 4
    places = tuple((0.7, float(value), 0.04) for value in y)
    piston = Disc("x0", (0.0, 0.1, 0.04), 0.03)
    walls = (
        0.0,
        0.05,
        0.0,
        0.0,
        0.0,
        0.0,
    )  # beside the sheet; a closed room would keep the air that was pushed in
    room = Room(dims, C, RHO, walls, piston, places, (Lining("x1", motion, tension),), air_losses=False)
    heard = pressure_per_velocity(march(room), F)
    shapes = np.cos(np.pi * np.arange(2)[:, None] * y / dims[1])
    found = shapes @ heard / np.array([[4.0], [2.0]])
    z = motion.resistance + 1j * (OMEGA * motion.mass - motion.stiffness / OMEGA)
    for mode, norm in ((0, 1.0), (1, 2.0)):
        beta = 0.05 + RHO * C / (z + tension * (mode * np.pi / dims[1]) ** 2 / (1j * OMEGA))
        share = norm * np.cos(mode * np.pi * 0.1 / dims[1]) * piston.area_m2 / (dims[1] * dims[2])
        share *= 1 - (mode * np.pi / dims[1] * 0.03) ** 2 / 8  # mean of the mode over the disc
        exact = share * duct_mode(beta, mode, dims, 0.7)
        low = F < 550.0  # mode 4 across, which these points take for mode 0, is far below its cut-on there
        error = np.abs(found[mode] - exact)[low]
        assert error.max() < 0.02 * np.sqrt(np.mean(np.abs(exact[low]) ** 2))


def test_extended_reaction_is_hidden_as_such_a_sheet(cache):
    case = simulate(3, {"extended-reaction": 0.2}, n_mics=3, duration_s=1.0, cache=cache)
    (part,) = case.truth.room.parts
    drawn = case.truth.details["extended-reaction"]
    grazing = 2 * np.pi * GRAZING_OVER_NORMAL * float(drawn["frequency_hz"])
    k = grazing / case.truth.room.sound_speed
    assert part.motion.stiffness + part.tension * k**2 == pytest.approx(part.motion.mass * grazing**2)
    assert RHO * C / part.motion.resistance == pytest.approx(0.2, rel=0.01)


# --- in the room ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("edges", "factors"),
    [
        ((0.1, 0.1, 0.1), (1.5, 1.5, 1.5)),
        ((10.0, 0.1, 0.1), (1.0, 2.0, 2.0)),  # along a needle nothing flows around; a cylinder doubles
    ],
)
def test_flow_around_an_object(edges, factors):
    np.testing.assert_allclose(Block((0, 0, 0), edges).flow_factors, factors, rtol=2e-3)
    assert np.sum(1 - 1 / Block((0, 0, 0), (0.2, 0.1, 0.05)).flow_factors) == pytest.approx(1.0)


def test_a_dipole_at_a_wall_feels_its_image():
    """Twice as far away as the wall a dipole of 1 along or across gives 2 or 1 over 4 pi times the distance cubed."""
    height, box = 0.1, Box((1.1, 1.0, 1.2))
    far, near = (_mirrored(box, Block((0.55, 0.5, z), (0.1, 0.1, 0.1))) for z in (0.6, height))
    expected = np.array([1.0, 1.0, 2.0]) / (4 * np.pi * (2 * height) ** 3)
    np.testing.assert_allclose(
        near - far, expected, rtol=0.06
    )  # the other walls give about the same at both places


def test_an_object_moves_modes_as_a_perturbation_does():
    """df/f = (V psi^2 - V_i (d psi / k)^2) / (2 integral psi^2): up where pressure, down where velocity is highest."""
    dims = (1.0, 0.31, 0.29)
    k = np.pi / dims[0]
    free = _resonance(dims, None)
    for place in (0.02 + 0.05, 0.5):
        block = Block((place, 0.15, 0.14), (0.08, 0.1, 0.07))
        moved = _resonance(dims, block)
        x = block.centre_m[0] + block.edges_m[0] * np.linspace(-0.5, 0.5, 41)
        compressed = np.mean(np.cos(k * x) ** 2)
        flowing = block.flow_factors[0] * np.mean(np.sin(k * x) ** 2)
        exact = block.volume_m3 * (compressed - flowing) / np.prod(dims)
        assert moved / free - 1 == pytest.approx(exact, abs=0.12 * block.volume_m3 / np.prod(dims))


def _resonance(dims, block):
    """Frequency of the first mode along x."""
    piston = Disc("x0", (0.0, 0.15, 0.14), 0.05)
    room = Room(dims, C, RHO, (0.002,) * 6, piston, ((0.98, 0.02, 0.02),), air_losses=False, block=block)
    near = C / 2 / dims[0] + np.linspace(-6.0, 6.0, 1201)
    return near[np.argmax(np.abs(pressure_per_velocity(march(room), near)[0]))]


def test_dry_air_takes_most_where_nitrogen_relaxes_slowly():
    """Attenuation at 20 degC of ISO 9613-1, table 1: 10 % and 70 % at 250 and 500 Hz, dB/km."""
    table = {(10.0, 250.0): 1.58, (10.0, 500.0): 4.25, (70.0, 250.0): 1.13, (70.0, 500.0): 2.80}
    for (humidity, hz), decibels in table.items():
        air = Air.at_humidity(humidity)
        x = hz / air.nitrogen_hz
        w = 2 * np.pi * hz
        loss = 1.27e-4 / 2 * w / C * x / (1 + x**2) + air.viscous_s * w**2 / (2 * C)
        assert 8686.0 * loss == pytest.approx(decibels, rel=0.06)


def test_air_that_warms_up_is_marched_from_its_coldest_to_its_warmest(cache):
    truth = simulate(5, n_mics=2, duration_s=1.0, cache=cache).truth
    rooms = _over_time(replace(truth, drift_K=3.0))
    ends = (rooms[-1].sound_speed / rooms[0].sound_speed) ** 2
    assert ends == pytest.approx((truth.temperature_C + 274.65) / (truth.temperature_C + 271.65), rel=1e-6)
    middle = rooms[len(rooms) // 2]
    assert middle.sound_speed == pytest.approx(truth.room.sound_speed)
    assert np.abs(np.diff([r.sound_speed for r in rooms])).max() < 0.31  # half a kelvin


def test_what_changes_with_time_is_heard_when_it_is_so(cache):
    """Responses that are nothing but a gain: the pressure is the velocity times the gain of that moment."""
    case = simulate(5, n_mics=2, duration_s=1.0, cache=cache)
    gains = [1.0, 3.0, 2.0]
    responses = [np.zeros((2, 400)) for _ in gains]
    for response, gain in zip(responses, gains, strict=True):
        response[:, 0] = gain
    take = record(case.truth, case.hardware, responses, Session(2.0, noise=False), np.random.default_rng(1))
    n = take.truth.shape[1]
    now = np.interp(np.arange(n), [0, (n - 1) / 2, n - 1], gains)
    np.testing.assert_allclose(take.truth[0], take.truth[2] * now, atol=1e-9 * np.abs(take.truth[2]).max())


# --- in the instruments --------------------------------------------------------------------------------


def test_a_shaken_stand_adds_its_resonance_to_its_microphones_alone(cache):
    plain, shaken = (
        simulate(5, effects, n_mics=6, duration_s=4.0, noise=False, cache=cache)
        for effects in ({}, {"shaken-microphone": 0.1})
    )
    added = np.fft.rfft((shaken.take.truth - plain.take.truth)[:6])
    drawn = shaken.truth.details["shaken-microphone"]
    mine = [int(m) - 1 for m in str(drawn["microphones"]).split(",")]
    power = np.sum(np.abs(added) ** 2, axis=1)
    assert set(np.flatnonzero(power > 1e-12 * power.max())) == set(mine)
    velocity = np.fft.rfft(plain.take.truth[6])
    f = np.fft.rfftfreq(plain.take.truth.shape[1], 1 / SAMPLING_RATE)
    at = np.abs(f - float(drawn["frequency_hz"])) < 1.0
    gain = np.sqrt(np.sum(np.abs(added[:, at]) ** 2, axis=1) / np.sum(np.abs(velocity[at]) ** 2))
    assert 0.5 * 0.1 * RHO * C < gain[mine].min() <= gain[mine].max() < 1.1 * 0.1 * RHO * C
    far = (f > 2 * float(drawn["frequency_hz"])) & (f < 600)
    assert (
        np.sum(np.abs(added[mine[0], far]) ** 2)
        < 0.05 * np.sum(np.abs(added[mine[0], at]) ** 2) * far.sum() / at.sum()
    )


@pytest.mark.long
def test_hidden_noise_of_the_vibrometer_is_a_bias_where_noise_is_left_out(cache):
    """H1 with noise, averaged over many recordings, is the transfer function of the recording without noise."""
    effects = {"vibrometer-noise": 0.3}
    quiet = simulate(5, effects, n_mics=2, duration_s=4.0, noise=False, cache=cache).take.volts
    plain = simulate(5, n_mics=2, duration_s=4.0, noise=False, cache=cache).take.volts
    noisy = [
        simulate(5, effects, n_mics=2, duration_s=30.0, repeat=k, cache=cache).take.volts for k in range(2)
    ]

    def h1(signals, band):
        spectra = np.fft.rfft(signals[1:3])
        f = np.fft.rfftfreq(signals.shape[1], 1 / SAMPLING_RATE)
        at = (f > band[0]) & (f < band[1])
        return np.sum(np.abs(spectra[1, at]) ** 2)

    for band in ((30.0, 60.0), (100.0, 160.0), (500.0, 600.0)):
        biased = np.sqrt(h1(quiet, band) / h1(plain, band))  # factor 1 + N/S on the velocity
        expected = np.mean([h1(v, band) for v in noisy]) / 30.0
        clean = h1(simulate(5, n_mics=2, duration_s=30.0, noise=False, cache=cache).take.volts, band) / 30.0
        assert biased == pytest.approx(expected / clean, rel=0.15)
        assert biased > 1.01


def test_a_tone_is_a_tone(cache):
    case = simulate(5, n_mics=2, duration_s=2.0, tone_hz=201.5, noise=False, cache=cache)
    spectrum = np.abs(np.fft.rfft(case.take.truth, axis=1))
    assert np.all(np.argmax(spectrum, axis=1) == 403)
    spectrum[:, 403] = 0.0
    assert spectrum.max() < 1e-3 * DRIVE_V * case.take.truth.shape[1]
    assert case.take.properties["ExcitationFrequency_Hz"] == 201.5


def test_another_repeat_has_the_same_instruments(cache):
    first, second = (simulate(5, n_mics=2, duration_s=1.0, repeat=k, cache=cache) for k in (0, 1))
    np.testing.assert_array_equal(first.truth.gain_dB, second.truth.gain_dB)
    assert first.truth.vibrometer_delay_s == second.truth.vibrometer_delay_s
    assert np.abs(first.take.volts - second.take.volts).max() > 1e-3
