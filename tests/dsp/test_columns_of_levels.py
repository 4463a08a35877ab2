"""Weighted sound levels are columns only where a channel is a sound pressure."""

import numpy as np

import specan


def test_columns_of_sound_pressure_stand_only_where_there_is_one():
    rng = np.random.default_rng(3)
    signals = {"Ear": rng.normal(size=4000), "Shaker": rng.normal(size=4000)}
    recording = specan.Recording.from_arrays(signals, 4000, units={"Ear": "Pa", "Shaker": "m/s^2"})
    assert {"Leq A", "LE A", "C peak"} <= set(specan.rms(recording).sheets()[1].header)
    alone = specan.rms(recording, channels="Shaker").sheets()
    assert alone[1].header == ["channel", "level", "F max", "F min"]  # one reference stands in the title
    assert not any("A-weighted" in sheet.title for sheet in alone)
    assert "dB re 1 um/s^2" in alone[1].title
