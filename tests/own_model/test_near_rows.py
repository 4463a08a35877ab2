"""Rows that are merely near each other are no repeats, unless somebody says how well a condition is set."""

import numpy as np
from open_tables import read_tables

from specan.models import Condition, Model, Observable, Parameter, quantity
from specan.models.quantity import RigStatement

NOISE = 1.0  # m/s^2 of one reading of a falling ball's acceleration


def falling(speed, drag):
    return 9.81 - drag * speed**2


def model(**more):
    return Model.from_function(
        falling, conditions={"speed": ("m/s", 0.5, 12)}, observables={"falling": "m/s^2"},
        parameters={"drag": (0.03, 0, 0.5, "1/m")}, **more,
    )  # fmt: skip


def balls(path, marks=""):
    """Readings of three balls, of which the lighter ones are slowed down more; which is which stands nowhere."""
    random, lines = np.random.default_rng(4), ["speed,falling" + (",repeat" if marks else "")]
    for drag in (0.02, 0.05, 0.09):
        for k, speed in enumerate(np.linspace(1, 8, 15)):
            read = speed * (1 + 0.004 * random.standard_normal())
            found = 9.81 - drag * read**2 + NOISE * random.standard_normal()
            lines.append(f"{read:.4f},{found:.4f}" + (f",{k}" if marks else ""))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_near_rows_are_not_taken_for_repeats_and_this_is_said(tmp_path):
    data = read_tables(model(), [balls(tmp_path / "balls.csv")])
    said = " ".join(data.statements)
    assert (
        "and not treated as repeats: how well it is set is not stated (declare speed_setting_percent" in said
    )
    assert "lines 2, 17, 32" in said  # the three readings near 1 m/s
    assert not data.known  # the difference between the balls is no scatter
    assert "from repeats" not in said


def test_a_declared_uncertainty_is_not_widened_by_near_rows(tmp_path):
    data = read_tables(model(uncertainty={"falling": NOISE}), [balls(tmp_path / "balls.csv")])
    np.testing.assert_allclose(data.fitted[0].sigma, NOISE, rtol=1e-6)


def test_near_rows_are_repeats_where_the_scatter_of_setting_is_declared_and_this_is_said(tmp_path):
    declared = model(uncertainty={"speed_setting_percent": 1.0})
    said = " ".join(read_tables(declared, [balls(tmp_path / "balls.csv")]).statements)
    assert "treated as repeats: they differ in speed by no more than the scatter of setting" in said
    assert "lines 2, 17, 32" in said


def test_equal_rows_are_repeats(tmp_path):
    random, path = np.random.default_rng(5), tmp_path / "t.csv"
    rows = [
        f"{v:g},{9.81 - 0.03 * v**2 + NOISE * random.standard_normal():.4f}"
        for v in range(1, 9)
        for _ in range(5)
    ]
    path.write_text("speed,falling\n" + "\n".join(rows) + "\n", encoding="utf-8")
    data = read_tables(model(), [path])
    assert data.known
    assert np.median(data.fitted[0].sigma) == np.clip(
        np.median(data.fitted[0].sigma), 0.75, 1.3
    )  # 32 degrees of freedom
    assert not any("near each other" in text for text in data.statements)


def test_a_dense_sweep_of_readings_has_the_scatter_that_was_put_in(tmp_path):
    """Neighbours are second readings at settings that differ a little: what the model's slope lacks is no scatter."""

    def force(travel, rate):
        return rate * travel

    spring = Model.from_function(
        force, conditions={"travel": ("m", 0, 1)}, observables={"force": "N"},
        parameters={"rate": (2.0, 0.1, 10, "N/m")}, uncertainty={"travel_setting_percent": 2.0},
    )  # fmt: skip
    random, travel = np.random.default_rng(3), np.linspace(0.1, 1, 900)
    read = 2 * travel + 0.36 * travel**3 + 0.01 * random.standard_normal(900)
    np.savetxt(tmp_path / "t.csv", np.c_[travel, read], "%.9g", ",", header="travel,force", comments="")
    data = read_tables(spring, [tmp_path / "t.csv"])
    assert "back to back" in " ".join(data.statements)
    np.testing.assert_allclose(data.fitted[0].sigma, 0.01, rtol=0.1)  # some 750 degrees of freedom: 3 %


def test_a_condition_without_a_stated_setting_makes_no_repeats_of_neighbours(tmp_path):
    """What the model lacks over a dense sweep is not taken for scatter: the declared uncertainty stands."""

    @quantity(unit="N")
    def force(travel, *, rate=Parameter(2.0, "N/m", min=0.1, max=10.0)):
        "Of a spring."
        return rate * travel

    spring = Model(
        name="spring", title="A spring", quantities={"force": force}, effects={},
        conditions={"travel": Condition("travel", "m", "Travel.", "travel", "m")},
        observables={"force": Observable("force", "force", "N", "Force.", column="force", column_unit="N")},
        rig=RigStatement(reading={"force": 0.01}),
    )  # fmt: skip
    travel = np.linspace(0.1, 1, 900)
    read = 2 * travel + 0.36 * travel**3 + 0.01 * np.random.default_rng(3).standard_normal(900)
    np.savetxt(tmp_path / "t.csv", np.c_[travel, read], "%.9g", ",", header="travel,force", comments="")
    data = read_tables(spring, [tmp_path / "t.csv"])
    np.testing.assert_allclose(data.fitted[0].sigma, 0.01, rtol=1e-6)
    assert data.fitted[0].noise_dof == np.inf


def test_rows_that_follow_each_other_by_chance_are_set_anew(tmp_path):
    random, path = np.random.default_rng(8), tmp_path / "t.csv"
    speed = random.choice(np.linspace(1, 12, 12), 240)
    clean = 9.81 - 0.06 * speed**2
    read = clean * (1 + 0.2 * random.standard_normal(240))
    rows = [f"{v:.4f},{a:.4f}" for v, a in zip(speed, read, strict=True)]
    path.write_text("\n".join(["speed,falling", *rows]) + "\n", encoding="utf-8")
    sigma = read_tables(model(), [path]).fitted[0].sigma
    # 20 rows each: a deviation is known to a sixth
    np.testing.assert_allclose(sigma, 0.2 * clean, rtol=0.4)
