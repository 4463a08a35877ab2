"""A false noise model turns every null into a discovery: what repeats, rounding and the rig are taken for."""

from dataclasses import replace

import numpy as np
import pytest
from open_tables import read_tables

from specan.errors import InputError
from specan.study.data.replicate_variance import SETTING, pooled
from specan.study.estimation.fit import fit
from specan.study.selection.candidates import base_problem


def opened(tables, tmp_path, columns, **uncertainty):
    gear = tables.model(**uncertainty)
    return gear, read_tables(gear, [tables.write_table(tmp_path / "table.csv", columns)])


def reduced(gear, data):
    return fit(base_problem(gear, data.fitted))


class TestPooled:
    groups = np.repeat(np.arange(200), 3)

    def test_a_constant_scatter_is_found_with_its_degrees_of_freedom(self):
        values = 0.3 * np.random.default_rng(0).standard_normal(600) + np.repeat(np.arange(200.0), 3)
        found = pooled(values, self.groups, np.empty((600, 0)), {})
        assert found.dof == 400
        assert np.sqrt(found.level) == pytest.approx(0.3, rel=0.1)

    def test_what_readings_differ_by_knowingly_is_no_scatter(self):
        rng = np.random.default_rng(1)
        known = rng.standard_normal(600)
        values = 0.3 * rng.standard_normal(600) + 5.0 * known
        found = pooled(values, self.groups, known[:, None], {})
        assert found.dof == 399
        assert np.sqrt(found.level) == pytest.approx(0.3, rel=0.1)

    def test_a_scatter_that_grows_is_followed_and_one_that_does_not_is_left_alone(self):
        size = np.repeat(np.linspace(1, 10, 200), 3)
        noise = np.random.default_rng(2).standard_normal(600)
        growing = pooled(noise * 0.1 * size, self.groups, np.empty((600, 0)), {"size": size**2})
        assert growing.component == "size"
        np.testing.assert_allclose(np.sqrt(growing.at({"size": size**2}, 600)), 0.1 * size, rtol=0.25)
        assert pooled(noise, self.groups, np.empty((600, 0)), {"size": size**2}).component == ""

    def test_what_is_declared_is_believed_in_shape_and_fitted_in_size(self):
        declared = np.repeat(np.linspace(0.1, 10, 200), 3)
        values = 2.0 * np.sqrt(0.01 + declared) * np.random.default_rng(3).standard_normal(600)
        found = pooled(values, self.groups, np.empty((600, 0)), {SETTING: declared}, np.full(600, 0.01))
        assert found.component == SETTING
        large = declared > 1
        np.testing.assert_allclose(found.at({SETTING: declared}, 600)[large], 4 * declared[large], rtol=0.3)

    def test_a_declared_scatter_that_is_not_there_is_not_believed(self):
        declared = np.repeat(np.linspace(0.1, 10, 200), 3)
        values = 0.3 * np.random.default_rng(4).standard_normal(600)
        found = pooled(values, self.groups, np.empty((600, 0)), {SETTING: declared}, np.full(600, 0.01))
        np.testing.assert_allclose(found.at({SETTING: declared}, 600), 0.09, rtol=0.25)

    def test_corrections_do_not_carry_the_scatter_of_large_readings_into_small_ones(self):
        """Linear corrections on pairs whose scatter grows with the reading: variances come out as they were drawn.

        What is left within pairs has as much chi-square as degrees of freedom, and the corrections theirs: with the
        drawn variances (sum 90), so that with the estimated ones 78 + 12 * 78 / 76 is expected. Corrections fitted
        without weights gave 70 and variances 40 % too large.
        """
        size, groups = np.repeat(np.geomspace(0.4, 14, 90), 2), np.repeat(np.arange(90), 2)
        within, ratio = [], []
        for seed in range(60):
            rng = np.random.default_rng(seed)
            values = 0.01 * size * rng.standard_normal(180)
            slopes = size[:, None] * rng.standard_normal((180, 12))
            found = pooled(values, groups, slopes, {"size": size**2})
            variance = found.at({"size": size**2}, 180)
            pairs = np.diff(values.reshape(-1, 2), axis=1)[:, 0]
            within.append(np.sum(pairs**2 / 2 / variance[::2]))
            ratio.append(np.mean(variance / (0.01 * size) ** 2))
        assert found.dof == 78
        assert np.mean(within) == pytest.approx(78 + 12 * 78 / 76, abs=3 * np.sqrt(24 / 60) + 0.5)
        assert np.mean(ratio) == pytest.approx(1.0, abs=0.06)

    def test_what_readings_put_into_the_means_is_left_out_where_it_grows(self):
        """Two readings a set-up, whose scatter grows; set-ups scatter alike: the means hold both."""
        size, groups = np.repeat(np.geomspace(1, 30, 100), 2), np.repeat(np.arange(100), 2)
        readings = (0.02 * size) ** 2 / 2
        found = []
        for seed in range(40):
            rng = np.random.default_rng(seed)
            values = (0.05 * rng.standard_normal(200)) + np.sqrt(readings) * rng.standard_normal(200)
            scatter = pooled(values, groups, np.empty((200, 0)), {"size": size**2}, known=readings)
            found.append(np.mean(scatter.at({"size": size**2}, 200)[:60]))
        assert np.mean(found) == pytest.approx(0.05**2, rel=0.1)

    def test_without_repeats_there_is_nothing(self):
        assert pooled(np.arange(5.0), np.arange(5), np.empty((5, 0)), {}) is None


def test_repeats_set_anew_give_the_noise_that_there_is(tables, tmp_path):
    _, data = opened(tables, tmp_path, tables.bench(repeats=4))
    observed = data.fitted[0]
    np.testing.assert_allclose(observed.sigma, tables.NOISE, rtol=0.2)
    assert observed.noise_dof == observed.pure_error_dof == pytest.approx(72, abs=6)
    assert "values as read" in " ".join(data.statements)


def test_a_torque_that_was_read_is_no_noise_however_the_brake_scatters(tables, tmp_path):
    """The same table with its torques written as they were set has the brake's scatter in its noise."""
    _, read = opened(tables, tmp_path, tables.bench(repeats=4))
    _, was_set = opened(tables, tmp_path, tables.bench(repeats=4, setting="set"))
    assert np.median(was_set.fitted[0].sigma) > 3 * np.median(read.fitted[0].sigma)


@pytest.mark.long
def test_a_true_model_fits_whatever_tells_the_noise(tables, tmp_path):
    p_values = []
    for seed in range(12):
        for columns, given in (
            (tables.bench(seed, repeats=3), {}),
            (tables.bench(seed, repeats=1, marks=False), {"input_torque_Nm": tables.NOISE}),
            (
                tables.bench(seed, repeats=3, setting="set"),
                {"input_torque_Nm": tables.NOISE, "torque_setting_percent": 4.0},
            ),
        ):
            gear, data = opened(tables, tmp_path, columns, **given)
            p_values.append(reduced(gear, data).p_value)
    assert min(p_values) > 1e-3
    assert 0.3 < np.mean(p_values) < 0.7


@pytest.mark.long
def test_p_of_a_true_model_is_uniform_where_the_noise_grows_with_the_reading(tables, tmp_path):
    """The model itself with noise in percent, known from repeats only: Kolmogorov and Smirnov's test of p."""
    from scipy.stats import kstest

    p_values = []
    for seed in range(24):
        percent = (0.2, 1.0)[seed % 2]
        plan = tables.grid(speeds=(600, 1000, 1500, 2000, 2800), torques=(2, 5, 15, 30, 50, 90))
        columns = tables.bench(seed, repeats=2, noise=0.0, points=plan)
        scatter = percent / 100 * np.random.default_rng([seed, 1]).standard_normal(columns["repeat"].size)
        columns["input_torque_Nm"] = columns["input_torque_Nm"] * (1 + scatter)
        gear, data = opened(tables, tmp_path, columns)
        p_values.append(reduced(gear, data).p_value)
    assert kstest(p_values, "uniform").pvalue > 0.01


def test_back_to_back_repeats_alone_would_condemn_a_true_model(tables, tmp_path):
    """DIAGNOSIS B3: the setting's scatter is invisible to them and must come from the rig."""
    columns = tables.bench(repeats=1, readings=4, setting="set")
    del columns["repeat"]
    gear, data = opened(tables, tmp_path, columns)
    assert any(
        "back to back" in s and "no scatter of setting is declared" in s for s in data.statements
    ) or any("no scatter of setting is declared" in s for s in data.statements)
    assert reduced(gear, data).p_value < 1e-6
    gear, data = opened(tables, tmp_path, columns, torque_setting_percent=100 * tables.SETTING)
    assert reduced(gear, data).p_value > 1e-3


def test_readings_of_one_setup_share_its_deviation(tables, tmp_path):
    columns = tables.bench(repeats=3, readings=3, setting="set")
    gear, data = opened(tables, tmp_path, columns)
    observed = data.fitted[0]
    same = columns["setup"][:, None] == columns["setup"]
    off = ~np.eye(observed.n, dtype=bool)
    assert np.all(observed.covariance[same & off] > 0)
    assert np.all(observed.covariance[~same] == 0)
    assert np.sqrt(np.median(np.diag(observed.covariance) - observed.parts["setting"] ** 2)) == pytest.approx(
        tables.NOISE, rel=0.2
    )
    assert reduced(gear, data).p_value > 1e-3


def test_the_readings_share_in_the_scatter_of_setups_is_counted_once(tables, tmp_path):
    """Torques that were read leave no scatter of setting; only what the readings put into the means."""
    _, data = opened(tables, tmp_path, tables.bench(repeats=3, readings=3, noise=0.03))
    parts = data.fitted[0].parts
    assert np.median(parts["reading"]) == pytest.approx(0.03, rel=0.15)
    assert np.median(parts["setting"]) < 0.012


def test_neighbouring_set_values_of_one_round_are_no_second_readings(tables, tmp_path):
    """Set values 8 N*m apart, a brake that scatters by 5 %: some rows of one round lie near a neighbour's level."""
    plan = tables.grid(torques=(5, 20, 63, 71, 79, 87))
    for seed in range(6):
        gear, data = opened(tables, tmp_path, tables.bench(seed, repeats=2, points=plan))
        observed = data.fitted[0]
        off = ~np.eye(observed.n, dtype=bool)
        assert np.mean(observed.covariance[off] != 0) < 1e-3  # rows that share the deviation of a set-up
        assert reduced(gear, data).p_value > 1e-3


def test_rows_without_marks_are_told_apart_by_their_order(tables, tmp_path):
    anew = tables.bench(repeats=2, setting="set", marks=False)
    _, data = opened(tables, tmp_path, anew)
    assert any("set anew" in s and "order of the rows" in s for s in data.statements)
    order = np.argsort(np.tile(np.arange(24), 2), kind="stable")
    together = {n: v[order] for n, v in anew.items()}
    _, data = opened(tables, tmp_path, together)
    assert any("back to back" in s for s in data.statements)


def test_what_differs_between_files_is_no_scatter_unless_the_files_are_the_repeats(tables, tmp_path):
    gear = tables.model()
    columns = tables.bench(repeats=2)
    shifted = {**tables.bench(seed=1, repeats=2)}
    shifted["input_torque_Nm"] = shifted["input_torque_Nm"] + 0.2
    pair = [tables.write_table(tmp_path / n, c) for n, c in (("a.csv", columns), ("b.csv", shifted))]
    np.testing.assert_allclose(read_tables(gear, pair).fitted[0].sigma, tables.NOISE, rtol=0.3)
    rounds = []
    for k in (1, 2, 3):
        one = {n: v[columns["repeat"] == 1] for n, v in tables.bench(seed=k).items()}
        rounds.append(tables.write_table(tmp_path / f"round_{k}.csv", one))
    observed = read_tables(gear, rounds).fitted[0]
    assert observed.noise_dof > 30
    np.testing.assert_allclose(observed.sigma, tables.NOISE, rtol=0.3)


def test_coarse_rounding_is_an_uncertainty_and_fine_rounding_is_none(tables, tmp_path):
    columns = tables.grid()
    columns["input_torque_Nm"] = np.round(tables.input_torque(columns), 2)
    columns["efficiency"] = np.round(columns["output_torque_Nm"] / (7.5 * columns["input_torque_Nm"]), 2)
    del columns["input_torque_Nm"]
    _, data = opened(tables, tmp_path, columns)
    assert data.known
    np.testing.assert_allclose(data.fitted[0].sigma, 0.01 / np.sqrt(12))
    columns["efficiency"] = np.round(columns["efficiency"] + 0.00012, 5)
    _, data = opened(tables, tmp_path, columns)
    assert not data.known
    assert "its uncertainty is not stated" in " ".join(data.statements)


def test_the_scatter_of_a_set_torque_goes_over_into_the_reading(tables, tmp_path):
    columns = tables.bench(repeats=1, marks=False, setting="set")
    given = {"input_torque_Nm": 0.01, "torque_setting_percent": 5.0}
    _, data = opened(tables, tmp_path, columns, **given)
    parts = data.fitted[0].parts
    ideal = 0.05 * columns["output_torque_Nm"] / 7.5
    assert np.all(parts["setting"] > ideal)
    assert np.all(parts["setting"] < 1.4 * ideal)


def test_a_declared_discrepancy_is_a_share_of_the_losses_and_smooth(tables, tmp_path):
    columns = tables.bench(repeats=1, marks=False)
    given = {"input_torque_Nm": 0.01, "model_discrepancy_percent": 2.0}
    _, data = opened(tables, tmp_path, columns, **given)
    observed = data.fitted[0]
    losses = columns["input_torque_Nm"] - columns["output_torque_Nm"] / 7.5
    np.testing.assert_allclose(observed.parts["discrepancy"], 0.02 * losses, rtol=0.05)
    correlation = observed.covariance / np.outer(losses, losses) / 0.02**2
    # Rows that differ in one of three variables: four of the seven choices of variables hold that one.
    levels = np.unique(columns["speed_rpm"])
    (first, *_), (last, *_) = (np.flatnonzero(columns["speed_rpm"] == x) for x in levels[[0, -1]])
    alone = np.exp(-0.5 * (1 / 0.5) ** 2)
    assert correlation[first, last] == pytest.approx((3 + 4 * alone) / 7, rel=0.05)


def test_the_model_under_test_does_not_change_the_covariance(tables, tmp_path):
    path = tables.write_table(tmp_path / "table.csv", tables.bench(setting="set"))
    gear = tables.model(input_torque_Nm=0.01, torque_setting_percent=5.0, model_discrepancy_percent=1.0)
    one = read_tables(gear, [path]).fitted[0]
    assert np.array_equal(one.covariance, read_tables(gear, [path]).fitted[0].covariance)


def test_repeats_that_contradict_each_other_are_named(tables, tmp_path):
    columns = tables.bench(repeats=2)
    columns["input_torque_Nm"][30] *= 1.5
    with pytest.raises(InputError, match=r"contradict each other: table.csv, line (32|8) .*line (32|8)"):
        opened(tables, tmp_path, columns)


def test_rounded_repeats_that_agree_keep_the_rounding(tables, tmp_path):
    columns = {n: np.tile(v, 2) for n, v in tables.grid().items()}
    columns["input_torque_Nm"] = np.round(tables.input_torque(columns), 1)
    columns["repeat"] = np.repeat([1.0, 2.0], 24)
    _, data = opened(tables, tmp_path, columns, input_torque_Nm=0.001)
    assert np.all(data.fitted[0].sigma >= 0.1 / np.sqrt(12) * 0.999)


def test_few_repeats_yield_to_the_rig(tables, tmp_path):
    columns = tables.bench(repeats=1)
    doubled = {n: np.concatenate([v, v[:3]]) for n, v in columns.items()}
    doubled["repeat"] = np.concatenate([columns["repeat"], [2, 2, 2]])
    _, data = opened(tables, tmp_path, doubled, input_torque_Nm=0.02)
    assert np.isinf(data.fitted[0].noise_dof)
    np.testing.assert_allclose(data.fitted[0].parts["reading"], 0.02, rtol=0.1)


def test_pure_error_is_not_counted_as_fit(tables, tmp_path):
    gear, data = opened(tables, tmp_path, tables.bench(repeats=4))
    problem = base_problem(gear, data.fitted)
    found = fit(problem)
    assert found.reduced_chi2 == pytest.approx(
        (found.chi2 - problem.pure_error_dof) / (found.dof - problem.pure_error_dof)
    )
    blind = problem.over([replace(problem.observations[0], pure_error_dof=0.0)])
    bad = problem.over(
        [replace(problem.observations[0], measured=_far_from_calibration(problem.observations[0]))]
    )
    assert fit(bad).p_value < fit(bad.over([replace(bad.observations[0], pure_error_dof=0.0)])).p_value
    assert fit(blind).chi2 == found.chi2


def _far_from_calibration(observed):
    speed = observed.conditions["worm_speed"]
    return observed.measured + 0.05 * np.sin(speed / 40)
