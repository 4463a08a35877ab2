"""The room model: its limits, its air, and one table of cases that every effect passes."""

import numpy as np
import pytest

from specan.errors import RequestError
from specan.models import check_effect
from specan.models.catalogue import load_model

LENGTHS = np.array([0.9, 0.6, 0.7])


def rig(**parts):
    places = np.random.default_rng(3).uniform(0.05, 0.95, (6, 3)) * LENGTHS
    whole = {
        "room": {"dims_m": LENGTHS.tolist()},
        "piston": {"wall": "x0", "centre_m": [0.0, 0.246, 0.3229], "radius_m": 0.05},
        "band": {"f_max_hz": 700.0},
        "mics": {"position_m": places.tolist(), "cards": [[1, 3], [4, 6]]},
    }
    return {**whole, **parts}


@pytest.fixture(scope="module")
def model():
    return load_model("room", rig())


CONDITIONS = {"frequency": np.linspace(30.0, 700.0, 24), "velocity_psd": np.full(24, 1e-11)}

EFFECTS = [
    "air-absorption", "dimension-error", "flanking-source", "helmholtz-resonator", "leak", "leaning-wall",
    "microphone-delay", "microphone-gain", "microphone-position", "panel-resonance", "piston-breakup", "piston-size",
    "porous-absorber", "scatterer", "temperature", "vibrometer-delay", "vibrometer-gain", "vibrometer-noise",
    "wall-impedance",
]  # fmt: skip


def test_the_table_names_every_effect(model):
    assert sorted(model.effects) == EFFECTS


@pytest.mark.parametrize("name", EFFECTS)
def test_every_effect_keeps_the_rules(model, name):
    check_effect(model.effects[name], model, CONDITIONS)


def test_at_low_frequency_the_room_is_a_spring(model):
    f = np.array([5.0, 10.0])
    values = {"wall_admittance.common": 0.0}
    got = np.abs(model.assemble().evaluate({"frequency": f}, values)["field"])
    volume, area = LENGTHS.prod(), np.pi * 0.05**2
    expected = 101325 * 1.4 * area / (2 * np.pi * f * volume)  # adiabatic spring, gamma p0 / V
    np.testing.assert_allclose(
        got, np.broadcast_to(expected, got.shape), rtol=0.012
    )  # 10 Hz lies a little up the slope of the first mode


def test_air_attenuation_is_that_of_the_standards_table(model):
    # ISO 9613-1:1993, table 1: 20 degC, 50 %, 1 kHz: 4.66 dB/km
    got = model.assemble().evaluate({"frequency": np.array([1000.0])}, wanted=["air_attenuation"])[
        "air_attenuation"
    ]
    assert got[0] * 20 / np.log(10) * 1000 == pytest.approx(4.66, abs=0.01)


def test_a_helmholtz_resonator_splits_the_mode_it_is_tuned_to(model):
    f = np.arange(170.0, 212.0, 0.25)  # first axial mode along x: 343.2 / 1.8 = 190.7 Hz
    plain = np.abs(model.assemble().evaluate({"frequency": f})["field"]).mean(axis=0)
    uses = model.assemble(["helmholtz-resonator@x1"])
    tuned = {
        "helmholtz-resonator@x1.resonance": 190.5,
        "helmholtz-resonator@x1.neck_area": 3e-4,
        "helmholtz-resonator@x1.quality": 60.0,
    }
    split = np.abs(uses.evaluate({"frequency": f}, tuned)["field"]).mean(axis=0)
    peaks = [np.sum((y[1:-1] > y[:-2]) & (y[1:-1] > y[2:])) for y in (plain, split)]
    assert peaks == [1, 2]


@pytest.mark.parametrize("long", [1.0, 2.0])
def test_a_rigid_object_moves_a_mode_as_perturbation_theory_says(model, long):
    # Rayleigh: the axial mode cos(pi x / L) with a small rigid object of volume V at x:
    # d(k^2) / k^2 = (V / room) (2 cos^2 - 2 sin^2 / (1 - L_x)); a ball has L_x = 1/3, a prolate spheroid
    # L_x = (1 - e^2) (atanh(e) / e - 1) / e^2 (Lamb, Hydrodynamics, section 114)
    f = np.arange(186.0, 195.0, 0.02)
    volume, across = 3e-4, 1 / np.sqrt(long)
    e = np.sqrt(1 - (across / long) ** 2)
    share = (1 - e**2) * (np.arctanh(e) / e - 1) / e**2 if e else 1 / 3

    def peak(x, size):
        own = {"volume": size, "x": x, "y": 0.5, "z": 0.5, "length_x": long, "length_y": across}
        values = {f"scatterer.{n}": v for n, v in own.items()}
        level = np.abs(model.assemble(["scatterer"]).evaluate({"frequency": f}, values)["field"][0])
        i = int(np.argmax(level))
        a, b, c = level[i - 1 : i + 2]
        return f[i] + 0.02 * 0.5 * (a - c) / (a - 2 * b + c)

    for x in (0.1, 0.5):
        wave = np.pi * x
        expected = volume / LENGTHS.prod() * (np.cos(wave) ** 2 - np.sin(wave) ** 2 / (1 - share))
        assert peak(x, volume) / peak(x, 0.0) - 1 == pytest.approx(expected, rel=0.03)


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"mics": {"position_m": [[2.0, 0.1, 0.1]]}}, "outside the room"),
        ({"mics": {"position_m": [[0.1, 0.1, 0.1], [0.1, 0.1, 0.1]]}}, "same place"),
        ({"piston": {"wall": "x0", "centre_m": [0.1, 0.2, 0.3], "radius_m": 0.05}}, "does not lie in wall"),
        ({"piston": {"wall": "x0", "centre_m": [0.0, 0.02, 0.3], "radius_m": 0.05}}, "reaches over"),
        ({"band": {"f_max_hz": 30000.0}}, "modes"),
        ({"band": {"f_maxhz": 300.0}}, "f_max_hz"),
        ({"room": {}}, "dims_m"),
    ],
)
def test_an_impossible_rig_is_refused_in_a_sentence(parts, message):
    with pytest.raises(RequestError, match=message):
        load_model("room", rig(**parts))
