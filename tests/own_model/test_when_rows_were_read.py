"""Rows of a table that are not in the order in which they were read: a column says when that was."""

from __future__ import annotations

import numpy as np
import pandas as pd

import specan
from specan.models import Model, Reading


def head(flow, shutoff, friction):
    """Head of a pump."""
    return shutoff - friction * flow**2


def test_a_drift_is_found_by_the_time_of_each_reading_whatever_the_order_of_the_rows():
    model = Model.from_function(
        head,
        conditions={"flow": ("m3/h", 5, 60)},
        observables={"head": Reading("m", 0.1)},
        parameters={"shutoff": (32.0, 20, 50, "m"), "friction": (0.004, 0.001, 0.01, "m/(m3/h)^2")},
    )
    rng = np.random.default_rng(1)
    flow, order = np.linspace(5, 60, 40), rng.permutation(40)
    read = 30 - 0.004 * flow**2 + 0.1 * rng.standard_normal(40) + 0.02 * order  # 0.8 m from first to last
    table = pd.DataFrame({"flow": flow, "head": read})
    timed = table.assign(elapsed_time=60.0 * order)
    assert specan.Study(model, table).diagnose().verdict == "nothing-missing"  # readings that scatter more
    found = specan.Study(model, timed).diagnose()
    assert found.verdict == "faulty-data"
    assert "drifts" in found.reason
