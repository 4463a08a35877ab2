"""The inverse root of a correlation matrix is the same whether alike rows are taken together or not."""

import numpy as np
import pytest

from specan.study.observation.table import InverseRoot

SETS = np.array([0, 1, 0, 2, 3, 1, 0, 4, 4, 4])  # 3 three times, pairs and single ones, not in order


def correlation(own: np.ndarray) -> np.ndarray:
    """Something smooth over the sets, and what each row has of its own."""
    place = np.linspace(0, 1, 5)[SETS]
    smooth = np.exp(-0.5 * ((place[:, None] - place) / 0.4) ** 2)
    whole = smooth + np.diag(own)
    root = np.sqrt(np.diag(whole))
    return whole / np.outer(root, root)


def direct(matrix: np.ndarray) -> np.ndarray:
    values, vectors = np.linalg.eigh(matrix)
    return (vectors / np.sqrt(values)) @ vectors.T


@pytest.mark.parametrize("own", [np.full(10, 0.3), 0.1 + 0.2 * SETS, 0.3 + 0.1 * (np.arange(10) == 2)])
def test_it_is_the_symmetric_root_whatever_is_alike(own) -> None:
    matrix = correlation(own)
    root = InverseRoot(matrix, SETS)
    assert root(np.eye(10)) == pytest.approx(direct(matrix), abs=1e-12)
    assert root(np.arange(10.0)) == pytest.approx(direct(matrix) @ np.arange(10.0), abs=1e-11)
    assert root.least == pytest.approx(np.linalg.eigvalsh(matrix)[0])


def test_only_rows_that_are_alike_are_taken_together() -> None:
    alike = InverseRoot(correlation(np.full(10, 0.3)), SETS)
    assert alike._root.shape == (5, 5)
    one_differs = InverseRoot(correlation(0.3 + 0.1 * (np.arange(10) == 2)), SETS)
    assert one_differs._root.shape == (7, 7)
    none = InverseRoot(correlation(np.full(10, 0.3)), np.arange(10))
    assert none._root.shape == (10, 10)


def test_copies_have_no_root() -> None:
    assert InverseRoot(correlation(np.zeros(10)), SETS).least < 1e-10
