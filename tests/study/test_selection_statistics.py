"""The statistics of the selection against independent references: Monte Carlo and refits."""

import numpy as np
import pytest

from specan.study.estimation.left_out import left_out_score
from specan.study.estimation.linear import Projection


def test_a_left_out_block_is_predicted_as_by_a_refit_without_it():
    # A block that holds nearly all that is known of one parameter: leverage 0.99.
    rng = np.random.default_rng(4)
    x = np.column_stack([np.ones(12), np.r_[10.0, np.full(11, 1.0) + 0.1 * np.arange(11)]])
    y = x @ [1.0, 0.5] + rng.standard_normal(12)
    block = np.array([0])
    solution = np.linalg.lstsq(x, y, rcond=None)[0]
    left = 1 - float(np.diag(x @ np.linalg.pinv(x))[0])
    assert 1e-3 < left < 1e-1
    rest = np.linalg.lstsq(x[1:], y[1:], rcond=None)[0]
    variance = 1 + x[0] @ np.linalg.inv(x[1:].T @ x[1:]) @ x[0]
    missed = y[0] - x[0] @ rest
    want = missed**2 / variance + np.log(variance)
    fit = Projection.of(x @ solution - y, x)
    assert left_out_score(fit, [block]) == pytest.approx(want, rel=1e-6)
