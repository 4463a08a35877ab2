"""Two loudspeakers, against the independent field marched in time."""

from dataclasses import replace

import numpy as np
import pytest

from specan.errors import RequestError
from specan.models.catalogue import load_model
from specan.room.model import EXAMPLE_RIG
from specan.room.model.places import receivers_of
from truth.room.box import Disc
from truth.room.field import Room, march, pressure_per_velocity
from truth.room.layout import at_temperature, draw_layout, rig_file

FREQUENCY = np.arange(35.0, 561.0, 2.0)
CENTRES = 1000.0 * 2.0 ** (np.arange(-14, -2) / 3)  # third octaves from 40 to 500 Hz
ADMITTANCE, LEVEL_DB, DELAY_S = 0.01, -3.0, 2e-4


@pytest.fixture(scope="module")
def room():
    """A room, its second loudspeaker, and the rig file of both loudspeakers."""
    layout = draw_layout(np.random.default_rng(1), 6)
    x, y, z = layout.dims_m
    other = next(w for w in ("y1", "z0") if w != layout.piston.wall)
    centre = (0.3 * x, y, 0.6 * z) if other == "y1" else (0.3 * x, 0.6 * y, 0.0)
    second = Disc(other, centre, 0.06)
    room = Room(layout.dims_m, 0.0, 0.0, (ADMITTANCE,) * 6, layout.piston, layout.position_m)
    room = replace(at_temperature(room, 20.0), sound_speed=343.2)  # as ISO 9613-1 has it
    rig = rig_file(layout, 1)
    rig["loudspeakers"] = [
        {"wall": other, "centre_m": centre, "radius_m": 0.06, "level_dB": LEVEL_DB, "delay_s": DELAY_S}
    ]
    rig["recordings"] = [{"file": "a.tdms", "driven": [1]}, {"file": "b.tdms", "driven": [2]}]
    return room, second, rig


@pytest.fixture(scope="module")
def fields(room):
    """Fields of either loudspeaker alone, marched in time; and the rig file of both."""
    room, second, rig = room
    both = (room.piston, second)
    return [pressure_per_velocity(march(replace(room, piston=p)), FREQUENCY) for p in both], rig


def predicted(rig, file="other.tdms", values=None):
    model = load_model("room", rig)
    own = receivers_of(model).in_recording(file, None, 5.0)
    given = {"frequency": FREQUENCY, **own.conditions}
    uses = ["loudspeaker-ratio@loudspeaker 2"] if values else []
    values = {"wall_admittance.common": ADMITTANCE, **(values or {})}
    return model.assemble(uses).evaluate(given, values)["field"]


def assert_alike(found, truth):
    for centre in CENTRES:
        band = np.abs(np.log2(FREQUENCY / centre)) < 1 / 6
        error = np.sqrt(np.mean(np.abs(truth - found)[:, band] ** 2))
        assert error < 0.01 * np.sqrt(np.mean(np.abs(truth[:, band]) ** 2)), f"{centre:.0f} Hz"


def ratio(level_dB, delay_s):
    return 10 ** (level_dB / 20) * np.exp(-2j * np.pi * FREQUENCY * delay_s)


@pytest.mark.long
def test_one_after_the_other_is_the_field_of_each(fields):
    (first, second), rig = fields
    assert_alike(predicted(rig, "a.tdms"), first)
    assert_alike(predicted(rig, "b.tdms"), second)


@pytest.mark.long
def test_together_they_add_by_the_stated_ratio_and_by_the_fitted_one(fields):
    (first, second), rig = fields
    assert_alike(predicted(rig), first + ratio(LEVEL_DB, DELAY_S) * second)
    off = {f"loudspeaker-ratio@loudspeaker 2.{name}": v for name, v in (("level", 1.0), ("delay", 1e-4))}
    assert_alike(predicted(rig, values=off), first + ratio(LEVEL_DB + 1.0, DELAY_S + 1e-4) * second)
    rig["loudspeakers"][0]["inverted"] = True
    assert_alike(predicted(rig), first - ratio(LEVEL_DB, DELAY_S) * second)
    rig["loudspeakers"][0]["inverted"] = False


@pytest.mark.long
def test_the_vibrometer_may_look_at_the_other_one_while_both_move(fields):
    (first, second), rig = fields
    turned = {**rig, "recordings": [{"file": "c.tdms", "driven": [2, 1]}]}
    assert_alike(predicted(turned, "c.tdms"), second + first / ratio(LEVEL_DB, DELAY_S))


def test_the_ratio_is_held_by_its_stated_uncertainty(room):
    *_, rig = room
    held = {n.parameter: n.prior_sd for n in load_model("room", rig).nuisances if "loudspeaker" in n.effect}
    assert held == {"level": 0.5, "delay": 1e-5}
    assert "loudspeaker-ratio" in load_model("room", EXAMPLE_RIG).unsuited


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"wall": "w"}, "wall of loudspeaker 2 is 'w'; expected one of x0"),
        ({"centre_m": [0.4, 0.5, 0.3]}, "loudspeaker 2's centre [0.4, 0.5, 0.3] m does not lie in wall y1"),
        ({"centre_m": [0.01, 0.6, 0.3]}, "reaches over the wall's edge"),
        ({"level_db": 1.0}, "unknown key"),
    ],
)
def test_a_loudspeaker_that_cannot_be_is_told(change, message):
    good = {"wall": "y1", "centre_m": [0.4, 0.6, 0.3], "radius_m": 0.05}
    with pytest.raises(RequestError) as told:
        load_model("room", {**EXAMPLE_RIG, "loudspeakers": [good | change]})
    assert message in str(told.value)
