"""Teeth of a rig file that are not those of the recording: lines of a set that is known, in noise."""

from dataclasses import replace

import numpy as np
import pytest

import specan
from specan.analysis.orders import Orders
from specan.errors import InputError
from specan.planetary_gear.model.rig import Gear
from specan.planetary_gear.study.teeth import check_teeth

SET = Gear(z_sun=24, z_planet=21, z_ring=66, module_mm=2.0)


def recorded(level: float, tacho: str):
    """Eight seconds of the lines of 24/21/66 with 3 planets at multiples of 3 orders, beside white noise and a tone."""
    rate, carrier_hz, time = 12800, 7.9, np.arange(8 * 12800) / 12800
    rng = np.random.default_rng(3)
    turns = carrier_hz * time + 0.3
    signal = rng.normal(size=time.size) + 3 * np.cos(2 * np.pi * 1234.5 * time)
    for order in (63, 66, 69, 132, 198):
        signal += level * np.cos(2 * np.pi * order * turns + rng.uniform(0, 6))
    marks = np.sin(2 * np.pi * 32 * turns * (90 / 24 if tacho == "Tacho sun" else 1.0))
    plain = specan.Recording.from_arrays(
        {"Acc 1": signal, tacho: marks}, rate, units={"Acc 1": "m/s^2"}, roles={tacho: "tacho"}
    )
    acc, pulses = plain.channels
    return replace(plain, channels=(acc, replace(pulses, properties={"PulsesPerRevolution": 32})))


def checked(recording, gear: Gear, tacho: str) -> list[str]:
    ratio = 1 + gear.z_ring / gear.z_sun if tacho == "Tacho sun" else 1.0
    settings = Orders(channels=("Acc 1",), tacho=tacho, ratio=ratio, turns=1000)
    return check_teeth(settings(recording), settings, gear)


@pytest.mark.parametrize(
    ("tacho", "teeth"),
    [("Tacho sun", (27, 21, 69, 3)), ("Tacho sun", (24, 21, 66, 5)), ("Tacho carrier", (24, 24, 72, 4))],
)
def test_teeth_that_were_not_recorded_are_refused_and_those_that_were_are_named(tacho, teeth) -> None:
    recording = recorded(0.4, tacho)
    assert checked(recording, SET, tacho) == []
    names = ("z_sun", "z_planet", "z_ring", "planets")
    with pytest.raises(InputError) as fault:
        checked(recording, SET.model_copy(update=dict(zip(names, teeth, strict=True))), tacho)
    assert "stands out of the noise" in str(fault.value)
    if tacho == "Tacho sun":
        assert "24/21/66 with 3 planets" in str(fault.value)


def test_a_mesh_below_the_noise_is_said() -> None:
    assert "no line of the tooth mesh" in checked(recorded(0.0, "Tacho sun"), SET, "Tacho sun")[0]
