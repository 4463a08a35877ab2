"""Rig files with the mistakes that a person makes, and what is said of them."""

import numpy as np
import pytest

from specan.errors import RequestError
from specan.models.catalogue import load_model
from specan.models.room import EXAMPLE_RIG


def refused(said, **changed):
    rig = {
        **EXAMPLE_RIG,
        **{table: {**EXAMPLE_RIG.get(table, {}), **keys} for table, keys in changed.items()},
    }
    with pytest.raises(RequestError, match=said):
        load_model("room", rig)


@pytest.mark.parametrize(("size", "unit"), [(100, "centimetres"), (1000, "millimetres")])
def test_positions_in_another_unit_are_recognised(size, unit):
    places = (size * np.array(EXAMPLE_RIG["mics"]["position_m"])).tolist()
    refused(f"divide the positions by {size}: they look like {unit}", mics={"position_m": places})


def test_a_room_in_millimetres_is_recognised():
    big = [1000 * edge for edge in EXAMPLE_RIG["room"]["dims_m"]]
    centre = [1000 * c for c in EXAMPLE_RIG["piston"]["centre_m"]]
    refused("divide them by 1000 if they are millimetres", room={"dims_m": big}, piston={"centre_m": centre})


def test_what_is_misspelt_or_missing_is_named():
    refused("unknown key 'mics.postion_m'; did you mean 'position_m'", mics={"postion_m": [[0.1, 0.1, 0.1]]})
    refused("position_m", mics={"position_m": []})
    refused("does not lie in wall x1", piston={"wall": "x1"})
