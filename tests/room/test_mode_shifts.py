"""Modes that ring elsewhere than in the ideal box: against the closed form, and against differences."""

import numpy as np
import pytest

from specan.errors import RequestError
from specan.models.catalogue import load_model
from specan.room.model import EXAMPLE_RIG
from specan.room.model.mode_shifts import COLUMNS_READ, columns
from specan.room.model.places import named_shifts, receivers_of

RIG = {
    "room": {"dims_m": [0.9, 0.6, 0.7]},
    "piston": {"wall": "x0", "centre_m": [0.0, 0.246, 0.3229], "radius_m": 0.05},
    "band": {"f_min_hz": 40.0, "f_max_hz": 500.0},
    "mics": {"position_m": [[0.1548, 0.0931, 0.1376], [0.62, 0.41, 0.29]]},
}
DENSE, SPARSE = np.arange(40.0, 500.0, 1.0), np.arange(40.0, 500.0, 10.0)
PANEL = {"panel-resonance@z1.coverage": 0.3, "panel-resonance@z1.resonance": 250.0}


def room(**uncertainty):
    return load_model("room", {**RIG, "uncertainty": uncertainty})


def response(model, frequency, shifts, uses=(), values=None):
    given = {**(values or {}), **named_shifts(shifts)}
    return model.assemble(uses).evaluate({"frequency": frequency}, given)["field"]


def test_a_shifted_mode_is_that_of_the_closed_form():
    """Sum over rigid modes (Kuttruff, Room Acoustics, 6th ed., eq. 3.16): one term with another wave number."""
    model = room(mode_frequency_percent=0.1, mode_damping_percent=3.0)
    number = model.axes["mode"].index("x1 y1")
    assert model.axes["mode"][:3] == ("x1", "z1", "y1")
    shifts = np.zeros(2 * len(model.axes["mode"]))
    shifts[number] = 2.0  # 0.2 % in frequency
    known = {"wall_admittance.common": 0.003}
    found = response(model, DENSE, shifts, values=known) - response(model, DENSE, 0 * shifts, values=known)

    air = model.assemble().evaluate({"frequency": DENSE}, known)
    edges, place = np.array(RIG["room"]["dims_m"]), np.array(RIG["mics"]["position_m"])
    orders = np.array([1, 1, 0])
    k = 2 * np.pi * DENSE / float(air["sound_speed"])
    walls = np.where(orders > 0, 2, 1) * 2 / edges
    k2 = np.sum((np.pi * orders / edges) ** 2)
    shape = np.prod(np.cos(np.pi * orders * place / edges), axis=1)
    at_piston = np.prod(np.cos(np.pi * orders * np.array(RIG["piston"]["centre_m"]) / edges))
    size = np.prod(np.where(orders > 0, 2, 1)) / np.prod(edges) * np.pi * RIG["piston"]["radius_m"] ** 2
    damping = 1j * k * 0.003 * np.sum(walls)
    terms = [1 / (k2 * (1 + e) ** 2 + damping - k**2) for e in (0.002, 0.0)]
    expected = (
        2j * np.pi * DENSE * float(air["density"]) * size * at_piston * np.outer(shape, terms[0] - terms[1])
    )
    gap = np.linalg.norm(found - expected) / np.linalg.norm(expected)
    assert gap < 0.06, (
        gap
    )  # the mean over the diaphragm, air, and walls that bend the modes are not in that sum


@pytest.mark.parametrize(
    ("frequency", "uses", "values", "poles"),
    [
        (DENSE, [], {}, True),
        (SPARSE, [], {}, False),
        (DENSE, ["wall-impedance@z1"], {"wall-impedance@z1.conductance": 0.6}, True),
        (DENSE, ["panel-resonance@z1"], PANEL, False),
    ],
)
def test_columns_are_derivatives(frequency, uses, values, poles):
    model = room(mode_frequency_percent=0.1)
    shifts = receivers_of(model).shifts
    here = np.random.default_rng(3).standard_normal(2 * shifts)
    at = {**values, **named_shifts(here)}
    known = model.assemble(uses).evaluate({"frequency": frequency}, at, wanted=COLUMNS_READ)
    assert (known["room_modes"].resonances is not None) == poles
    for k, (change, sizes) in enumerate(columns(known.values)):
        for part, size in enumerate(sizes):
            step = np.zeros(here.size)
            step[part * shifts + k] = 0.02
            sides = [response(model, frequency, here + s * step, uses, values) for s in (1, -1)]
            slope = (sides[0] - sides[1]) / 0.04
            assert np.linalg.norm(slope - change * size) < 0.08 * np.linalg.norm(slope) + 1e-9


def test_nothing_declared_changes_nothing():
    plain, declared = room(), room(mode_frequency_percent=0.1)
    assert not receivers_of(plain).shifts
    assert "mode" not in plain.axes
    unshifted = response(declared, DENSE, np.zeros(2 * receivers_of(declared).shifts))
    assert np.array_equal(unshifted, plain.assemble().evaluate({"frequency": DENSE})["field"])


def test_a_large_natural_frequency_percent_means_each_mode():
    one, other = (
        room(natural_frequency_percent=0.1),
        room(mode_frequency_percent=0.1, mode_damping_percent=3.0),
    )
    both = [m.quantities["mode_shift_sd"]() for m in (one, other)]
    assert np.array_equal(*both)
    assert receivers_of(one).errors.detuning == receivers_of(other).errors.detuning == pytest.approx(5e-5)
    assert receivers_of(room(natural_frequency_percent=0.01)).errors.detuning == pytest.approx(1e-4)


def test_the_modes_of_a_mesh_have_no_numbers():
    rig = {**EXAMPLE_RIG, "room": {"mesh": "room.msh"}, "uncertainty": {"mode_frequency_percent": 0.1}}
    with pytest.raises(RequestError, match="mode_frequency_percent"):
        load_model("room", rig)
