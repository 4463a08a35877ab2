"""The uncertainty that the printed digits of a condition bring, against a Monte Carlo of rounding."""

import numpy as np
from open_tables import read_tables

from specan.study.data.open_tables import declared_reading

STEP = 1.0  # N m: the torque was written down without decimals


class Slopes:
    """A reference model whose reading grows by a known slope with the output torque only."""

    def __init__(self, slope):
        self.slope_of_torque = slope

    def slope(self, rows, name):
        return np.full(rows.n, self.slope_of_torque if name.endswith("output_torque") else 0.0)

    def predict(self, rows):
        return rows.measured


def test_a_rounded_condition_adds_the_variance_of_rounding(tables, tmp_path, monkeypatch):
    columns = tables.bench(repeats=2)
    rng = np.random.default_rng(0)
    columns["output_torque_Nm"] = (
        np.round(
            (columns["output_torque_Nm"] + rng.uniform(-0.9, 0.9, len(columns["output_torque_Nm"]))) / STEP
        )
        * STEP
    )
    gear = tables.model()
    kept = []
    from specan.study.data import open_tables as opened

    def seen(model, centre, rows):
        kept.append(rows)
        return declared_reading(model, centre, rows)

    monkeypatch.setattr(opened, "declared_reading", seen)
    read_tables(gear, [tables.write_table(tmp_path / "table.csv", columns)])
    rows = kept[0]
    name = next(n for n in rows.conditions if n.endswith("output_torque"))
    assert not rows.is_set[name]
    np.testing.assert_allclose(rows.steps[name], STEP)
    slope = 0.15
    true = rng.uniform(0.0, 100.0, 400_000)
    monte_carlo = np.var(slope * (np.round(true / STEP) * STEP - true))
    found = declared_reading(gear, Slopes(slope), rows) - declared_reading(gear, Slopes(0.0), rows)
    np.testing.assert_allclose(found, monte_carlo, rtol=0.01)
