"""Walls of which something is known beforehand, and walls that are tied together."""

from copy import deepcopy

import numpy as np
import pytest
from scipy.integrate import quad

from specan.errors import SpecanError
from specan.models.catalogue import load_model, read_rig_file, rig_files
from specan.room.model.known_walls import KnownWall, wall_table
from specan.room.model.rig import EXAMPLE_RIG

FREQUENCY = np.arange(50.0, 600.0, 2.0)
BAND = (40.0, 600.0)


def model(walls=None, tied=()):
    rig = deepcopy(EXAMPLE_RIG)
    rig["walls"] = walls or {}
    rig["room"]["tied_walls"] = tied
    return load_model("room", rig)


def field(made, uses=(), values=None, wanted="indicated_frf"):
    return made.assemble(uses).evaluate({"frequency": FREQUENCY}, values)[wanted]


def test_a_wall_of_measured_impedance_acts_as_the_lining_that_was_measured(tmp_path):
    lining = {"conductance": 0.4, "mass": 0.3, "stiffness": 2e5}
    values = {f"wall-impedance@z1.{name}": value for name, value in lining.items()}
    values["wall_admittance.common"] = 0.005
    expected = field(model(), ["wall-impedance@z1"], values)
    rho_c, omega = 1.2041 * 343.2, 2 * np.pi * FREQUENCY  # of the example's air at 20 degrees
    z = 1 / (0.005 + 1 / (1 / 0.4 + 1j * (0.3 * omega - 2e5 / omega) / rho_c))
    rows = zip(FREQUENCY, z.real, z.imag, 0.01 * np.abs(z), strict=True)
    lines = [",".join(f"{v:.9g}" for v in row) for row in rows]
    (tmp_path / "tube.csv").write_text("frequency_hz,z_re,z_im,u_z\n" + "\n".join(lines))
    (tmp_path / "rig.toml").write_text('[walls.z1]\nfile = "tube.csv"\n')
    assert rig_files(tmp_path / "rig.toml") == (tmp_path / "rig.toml", tmp_path / "tube.csv")
    content = deepcopy(EXAMPLE_RIG) | read_rig_file(tmp_path / "rig.toml")
    content["band"] = {"f_min_hz": 50.0, "f_max_hz": 590.0}
    made = load_model("room", content)
    assert np.abs(field(made) - expected).max() < 2e-4 * np.abs(expected).max()


def test_errors_of_a_measured_impedance_have_the_stated_size_octave_by_octave():
    made = model({"z1": {"frequency_hz": BAND, "z_re": [4.0, 4.0], "z_im": [3.0, 3.0], "u_z": 0.5}})
    assert {(n.effect, n.parameter, n.prior_sd) for n in made.nuisances if "wall" in n.effect} == {
        ("wall-data@z1", "conductance", 1.0),
        ("wall-data@z1", "susceptance", 1.0),
    }
    off = np.eye(len(made.axes["octave"]))[2]
    values = {"wall-data@z1.conductance": off, "wall-data@z1.susceptance": 0 * off}
    found = field(made, ["wall-data@z1"], values, "known_admittance")[0] - 1 / (4 + 3j)
    # |d(1/Z)| = u / |Z|^2 = 0.5 / 25, at the octave's middle, and half of it half an octave away
    at = np.interp([125.9, 125.9 * 10**0.15, 251.2], FREQUENCY, found.real)
    assert at == pytest.approx([0.02, 0.01, 0.0], abs=2e-4)
    assert not found.imag.any()


@pytest.mark.parametrize("alpha", [0.02, 0.2, 0.6])
def test_an_absorption_coefficient_at_normal_incidence_gives_the_resistance_of_closed_form(alpha):
    given = KnownWall(frequency_hz=BAND, absorption_normal=(alpha, alpha), u_absorption=0.01, depth_m=0.0)
    found = wall_table("z1", given, BAND)
    reflected = np.sqrt(1 - alpha)
    assert found.admittance == pytest.approx((1 - reflected) / (1 + reflected), rel=1e-3)
    slope = 1 / (reflected * (1 + reflected) ** 2)  # of (1 - r) / (1 + r), r = sqrt(1 - alpha)
    assert found.deviation.real == pytest.approx(0.01 * slope, rel=0.05)


def test_a_coefficient_of_a_reverberation_room_is_the_mean_over_all_angles():
    given = KnownWall(
        frequency_hz=(50.0, 500.0), absorption_diffuse=(0.1, 0.5), u_absorption=0.05, depth_m=0.04
    )
    found = wall_table("z1", given, (60.0, 450.0))
    for alpha, beta in zip((0.1, 0.5), found.admittance, strict=True):

        def by_angle(mu, beta=beta):
            return 2 * mu * 4 * mu * np.real(beta) / abs(mu + beta) ** 2

        assert quad(by_angle, 0, 1, limit=200)[0] == pytest.approx(alpha, rel=2e-3)
    # between a rigid filling and a layer of air, 0 to k d, with k d / 2 of uncertainty
    assert found.admittance.imag == pytest.approx(np.pi * np.array([50.0, 500.0]) / 343 * 0.04)
    assert np.all(found.deviation.imag >= found.admittance.imag)


def test_tied_walls_act_as_one_and_are_one_candidate():
    made = model(tied=[["z1", "z0"]])
    names = set(map(str, made.candidates(made.assemble())))
    assert {"wall-impedance@z0+z1", "wall-impedance@x0", "leak@z0", "leak@z1"} <= names
    assert "wall-impedance@z0" not in names
    both = {f"wall-impedance@{w}.conductance": 0.2 for w in ("z0", "z1")}
    expected = field(model(), ["wall-impedance@z0", "wall-impedance@z1"], both)
    found = field(made, ["wall-impedance@z0+z1"], {"wall-impedance@z0+z1.conductance": 0.2})
    assert np.array_equal(found, expected)


def test_one_table_tells_of_all_walls_that_are_tied():
    table = {"frequency_hz": BAND, "z_re": [8.0, 8.0], "z_im": [0.0, 0.0], "u_z": 0.5}
    admittance = field(model({"x1": table}, [["x1", "y0"]]), wanted="face_admittance")
    assert admittance[:, 0] == pytest.approx([0.005, 0.125, 0.125, 0.005, 0.005, 0.005])


TABLE = {"frequency_hz": [40.0, 600.0], "z_re": [5.0, 4.0], "z_im": [0.0, 0.0], "u_z": 0.2}
COEFFICIENTS = {"frequency_hz": [40.0, 600.0], "absorption_normal": [0.1, 0.2], "u_absorption": 0.02}


@pytest.mark.parametrize(
    ("walls", "tied", "message"),
    [
        ({"w": TABLE}, [], "[walls.w] is about no wall of the room; expected one of x0, x1"),
        ({"z1": {"frequency_hz": [40.0, 600.0]}}, [], "neither an impedance nor an absorption coefficient"),
        ({"z1": TABLE | COEFFICIENTS}, [], "states z_re and absorption_normal"),
        ({"z1": TABLE | {"z_im": [0.0]}}, [], "has 1 values of z_im for 2 frequencies"),
        ({"z1": TABLE | {"u_z": None}}, [], "lacks u_z"),
        ({"z1": TABLE | {"z_re": [5.0, -1.0]}}, [], "z_re = -1 at 600 Hz: such a wall would emit energy"),
        ({"z1": TABLE | {"frequency_hz": [100.0, 600.0]}}, [], "from 100 to 600 Hz, the band from 40 to 600 Hz"),
        ({"z1": TABLE | {"frequency_hz": [600.0, 40.0]}}, [], "at least two, the lowest first"),
        ({"z1": COEFFICIENTS}, [], "expected depth_m, the thickness of the covering"),
        ({"z1": COEFFICIENTS | {"absorption_normal": [10.0, 20.0]}}, [], "above 0 and below 1, not percent"),
        ({"z1": {"file": "nowhere.csv"}}, [], "the file nowhere.csv does not exist"),
        ({"z0": TABLE, "z1": TABLE}, [["z0", "z1"]], "the second table of the tied walls z0+z1"),
        ({}, [["z0", "w"]], "tied_walls names 'w'; expected walls of the room: x0, x1"),
        ({}, [["z0", "z1"], ["z1", "x0"]], "tied_walls names 'z1' twice"),
        ({}, [["z0"]], "a group of one wall"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_told(walls, tied, message):
    with pytest.raises(SpecanError) as told:
        model(walls, tied)
    assert message in str(told.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("f,z_re\n1,2\n", "has the columns f, z_re; expected frequency_hz"),
        ("frequency_hz,z_re\n1;2,x\n", "no number"),
    ],
)
def test_a_table_of_another_form_is_told(tmp_path, text, message):
    (tmp_path / "tube.csv").write_text(text)
    with pytest.raises(SpecanError, match=message):
        model({"z1": {"file": str(tmp_path / "tube.csv")}})
