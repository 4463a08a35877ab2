"""Many systems solved at once by iteration: what a direct solution gives."""

import numpy as np
import pytest

from specan.room.model import mesh_field
from specan.room.model.mesh_field import Lines


def room(vectors, soft):
    """A reduced room with walls drawn at random."""
    random = np.random.default_rng(3)
    felt = random.standard_normal((2, vectors, vectors // 4)) / np.sqrt(vectors // 4)
    k = np.linspace(2.0, 12.0, 90)
    return Lines(
        np.sort(random.uniform(0, 400, vectors)),
        4 * felt @ felt.transpose(0, 2, 1),
        k**2 - 1e-3j * k,
        1j * k * np.array([[0.005], [soft]]),
    )


@pytest.mark.long
@pytest.mark.parametrize("soft", [0.02, 0.3 + 0.4j, 3.0])
@pytest.mark.parametrize("most", [48, 3])  # iterations; with 3 most lines fall back to a direct solution
def test_iteration_and_direct_solution_agree(monkeypatch, soft, most):
    monkeypatch.setattr(mesh_field, "_MOST", most)
    lines = room(200, soft)
    loads = np.random.default_rng(4).standard_normal((200, 2))
    loads[:, 1] = 0  # a port in a nodal plane
    loads[3, 1] = 1
    assert len(lines.values) > mesh_field.DIRECT
    got = lines.solve(loads)
    matrix = np.einsum("gl,gij->lij", lines.soft, lines.walls)
    matrix[:, np.arange(200), np.arange(200)] += lines.values - lines.k2[:, None]
    left = np.linalg.norm(np.einsum("lij,ljs->lis", matrix, got) - loads, axis=1) / np.linalg.norm(
        loads, axis=0
    )
    assert got.shape == (90, 200, 2)
    assert left.max() < 1e-7


def test_nothing_in_gives_nothing_out():
    assert not np.any(room(200, 0.1).solve(np.zeros((200, 1))))
