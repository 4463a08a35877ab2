"""Two ways to the same field: marched in time on elements, and the model's. Neither knows the other."""

from dataclasses import replace

import numpy as np
import pytest

from specan.models.catalogue import load_model
from truth.room.field import Room, march, pressure_per_velocity
from truth.room.layout import at_temperature, draw_layout, rig_file

pytestmark = pytest.mark.long

CENTRES = 1000.0 * 2.0 ** (np.arange(-14, -2) / 3)  # third octaves from 40 to 500 Hz


@pytest.mark.parametrize(("seed", "admittance"), [(1, 0.01), (2, 0.02)])
def test_field_of_the_undisturbed_room(seed: int, admittance: float) -> None:
    layout = draw_layout(np.random.default_rng(seed), 8)
    walls = (admittance,) * 6
    room = at_temperature(Room(layout.dims_m, 0.0, 0.0, walls, layout.piston, layout.position_m), 20.0)
    # The truth's ideal gas is 1e-4 faster than the 343.2 m/s of ISO 9613-1 (0.06 K); the field is what is compared.
    room = replace(room, sound_speed=343.2)
    f = np.arange(35.0, 561.0, 2.0)
    truth = pressure_per_velocity(march(room), f)
    model = load_model("room", rig_file(layout, seed)).assemble()
    field = model.evaluate({"frequency": f}, {"wall_admittance.common": admittance})["field"]
    for centre in CENTRES:
        band = (f >= centre * 2 ** (-1 / 6)) & (f < centre * 2 ** (1 / 6))
        error = np.sqrt(np.mean(np.abs(truth - field)[:, band] ** 2))
        assert error < 0.01 * np.sqrt(np.mean(np.abs(truth[:, band]) ** 2)), f"{centre:.0f} Hz"
