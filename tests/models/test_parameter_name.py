"""Names of parameters are taken apart in one place, whatever their elements are called."""

import json

import pytest

from specan.models.effect import ParameterName

CHANNELS = ["", "Mic 1", "cDAQ1Mod1/ai0.x", "31.5", "day 2.csv", "a]b"]


@pytest.mark.parametrize("owner", ["oil", "seal-drag", "wall-impedance@z1", "panel-resonance@2"])
@pytest.mark.parametrize("element", CHANNELS)
def test_parts_come_back(owner: str, element: str) -> None:
    name = ParameterName.of(owner, "beta", element)
    assert (name.owner, name.own, name.element) == (owner, "beta", element)
    assert name.whole == f"{owner}.beta"
    assert name.whole.at(element) == name


def test_it_is_the_text_that_files_keep() -> None:
    name = ParameterName.of("gain-error", "gain", "Channel 3")
    assert name == "gain-error.gain[Channel 3]"
    assert {name: 1.0}["gain-error.gain[Channel 3]"] == 1.0
    assert json.dumps({name: name}) == '{"gain-error.gain[Channel 3]": "gain-error.gain[Channel 3]"}'
