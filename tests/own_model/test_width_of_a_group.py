"""Rivals are in a group where the data cannot tell them apart, and nowhere else."""

import numpy as np
import pandas as pd
import pytest

import specan
from specan.models import Model, Parameter, effect

NOISE = 0.1
X = np.repeat(np.linspace(0.5, 10, 20), 2)


def force(x, a):
    return a * x


@effect("square", adds_to="force", neutral={"size": 0.0})
def square(x, *, size=Parameter(0.1, "N/mm^2", min=0.001, max=1, lower=-2, upper=2)):
    """Stiffer with the square of its travel."""
    return size * x**2


@effect("cube", adds_to="force", neutral={"size": 0.0})
def cube(x, *, size=Parameter(0.01, "N/mm^3", min=0.0001, max=0.1, lower=-0.2, upper=0.2)):
    """Stiffer with the third power of its travel."""
    return size * x**3


@pytest.mark.parametrize("apart", [1.0, 28.0])
def test_a_rival_counts_by_how_much_worse_it_fits(apart) -> None:
    columns = np.column_stack([X, X**2, X**3])
    noise = np.random.default_rng(1).normal(size=X.size)
    noise -= columns @ np.linalg.lstsq(columns, noise)[0]
    noise *= np.sqrt(X.size - 2) / np.linalg.norm(noise)
    rival = columns[:, [0, 2]]
    left = X**2 - rival @ np.linalg.lstsq(rival, X**2)[0]
    # so that the best fit with the cube has exactly so much more chi-square than that with the square
    size = np.sqrt(apart) / np.linalg.norm(left)
    frame = pd.DataFrame({"x": X, "force": 2 * X + NOISE * (size * X**2 + noise)})
    model = Model.from_function(
        force, conditions={"x": ("mm", 0, 10)}, observables={"force": ("N", NOISE)},
        parameters={"a": (2.0, 0.5, 5, "N/mm")}, effects=[square, cube],
    )  # fmt: skip
    found = specan.Study(model, frame).diagnose()
    # at 28 the odds of two laws with as many parameters are exp(14); at 1 they are two to one
    assert set(found.alternatives) == ({("square",)} if apart > 20 else {("square",), ("cube",)})
    assert found.verdict == ("effect" if apart > 20 else "group")
