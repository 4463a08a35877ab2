"""Rig files with the mistakes that a person makes, and what is said of them."""

import re

import numpy as np
import pytest

from specan.errors import RequestError
from specan.models.catalogue import load_model
from specan.room.model import EXAMPLE_RIG


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


@pytest.mark.parametrize(
    ("table", "key", "value", "said"),
    [
        ("uncertainty", "position_m", -1, "'uncertainty.position_m' is -1; expected at least 0"),
        ("uncertainty", "position_m", "2 mm", "'uncertainty.position_m' is '2 mm'; expected a number"),
        ("uncertainty", "position_m", [1e-3, -1.0], "'uncertainty.position_m' entry 2 is -1.0; expected at least 0"),
        ("rig", "id", 1.5, "'rig.id' is 1.5; expected a whole number"),
        ("mics", "position_m", [[0.1, 0.2]], "'mics.position_m' entry 1 is [0.1, 0.2]; expected at least 3 entries"),
        ("mics", "position_m", [[0.1, 0.2, "a"]], "'mics.position_m' entry 1 entry 3 is 'a'; expected a number"),
        ("mics", "cards", [[1, 2, 3]], "'mics.cards' entry 1 is [1, 2, 3]; expected at most 2 entries"),
        ("band", "left_out_hz", [80, 85], "'band.left_out_hz' entry 1 is 80; expected a list in square brackets"),
        ("band", "block_s", 50, "'band.block_s' is 50; expected at most 20"),
        ("walls", "z1", {"u_zz": 1}, "unknown key 'walls.z1.u_zz'; did you mean 'u_z'"),
    ],
)  # fmt: skip
def test_a_value_of_another_form_is_told_in_the_user_s_words(table, key, value, said):
    refused(re.escape(said), **{table: {key: value}})


def test_what_lacks_in_one_of_several_tables_is_named():
    with pytest.raises(RequestError, match="the key 'centre_m' is missing in 'loudspeakers' entry 1"):
        load_model("room", {**EXAMPLE_RIG, "loudspeakers": [{"wall": "x0"}]})


def test_what_is_misspelt_or_missing_is_named():
    refused("unknown key 'mics.postion_m'; did you mean 'position_m'", mics={"postion_m": [[0.1, 0.1, 0.1]]})
    refused("position_m", mics={"position_m": []})
    refused("does not lie in wall x1", piston={"wall": "x1"})
