"""Names of the modes of a box."""

import numpy as np
import pytest

from specan.room.model.mode_shifts import mode_names


def test_a_mode_is_named_by_family_order_and_direction():
    named = {name: frequency for frequency, name in mode_names([2.0, 1.0, 0.5], 340.0, 450.0)}
    assert named["5th axial mode along x"] == pytest.approx(425.0)
    assert named["tangential mode x1 z1"] == pytest.approx(170 * np.hypot(0.5, 2), abs=0.05)
    assert named["oblique mode x2 y1 z1"] == pytest.approx(170 * np.sqrt(6), abs=0.05)


def test_all_modes_of_the_band_are_there():
    # every triple of orders, counted by brute force
    dims, c, top = np.array([0.9, 0.6, 0.7]), 343.0, 700.0
    grid = np.stack(np.meshgrid(*3 * [np.arange(20)], indexing="ij"), axis=-1).reshape(-1, 3)
    all_hz = c / 2 * np.sqrt(np.sum((grid / dims) ** 2, axis=1))
    found = mode_names(dims, c, top)
    assert len(found) == int(np.sum((all_hz > 0) & (all_hz <= top)))
    assert [f for f, _ in found] == sorted(f for f, _ in found)
