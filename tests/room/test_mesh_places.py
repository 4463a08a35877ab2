"""Which simplex holds a point."""

import numpy as np

from specan.room.model.mesh_elements import Simplices


def test_a_large_simplex_is_found_behind_many_small_ones():
    large = np.array([[0.0, 0, 0], [9, 0, 0], [0, 9, 0], [0, 0, 9]])
    small = 0.01 * np.array([[0.0, 0, 0], [-1, 0, 0], [0, -1, 0], [0, 0, -1]])
    shifts = 0.02 * np.random.default_rng(2).uniform(-1, 0, (200, 3))
    found = Simplices(np.concatenate([shifts[:, None] + small, large[None]]))
    number, place, distance = found.nearest(np.array([[0.01, 0.02, 0.01], [2.0, 3.0, 1.0]]))
    assert number.tolist() == [200, 200]
    np.testing.assert_allclose(place, [[0.01, 0.02, 0.01], [2.0, 3.0, 1.0]], atol=1e-12)
    assert distance.max() < 1e-12


def test_a_point_beside_a_triangle_goes_to_the_triangle():
    triangle = np.array([[[0.0, 0, 1], [1, 0, 1], [0, 1, 1]]])
    _, place, distance = Simplices(triangle).nearest(np.array([[0.2, 0.3, 1.5], [0.5, -0.2, 1.0]]))
    np.testing.assert_allclose(place[0], [0.2, 0.3, 1.0], atol=1e-12)
    assert place[1, 1] == 0.0
    np.testing.assert_allclose(distance[0], 0.5)
    assert distance[1] >= 0.2
