"""Order lines as observations: covariance in closed form, gains that do not matter, turns that nobody counts."""

from dataclasses import replace

import numpy as np
import pytest

from specan.models import Condition, Model, Observable
from specan.models.order_lines import OrderLines, Tacho
from specan.models.quantity import constant
from specan.study.data.open_orders import like
from specan.study.observation import Observation
from specan.study.observation.order_lines import (
    OrderLinesObservation,
    joined,
    level_errors,
    model_errors,
    path_errors,
)

ORDER = np.array([7.0, 9.0, 10.0, 11.25, 17.0, 19.5, 20.0, 23.0])
HARMONIC = np.array([1, 1, 1, 1, 2, 2, 2, 2])
OFFSET = ORDER - 10.0 * HARMONIC
TRUTH = np.random.default_rng(5).normal(size=(2, 8, 2)) @ np.array([1, 1j]) + 3.0


def observed(
    amplitude: np.ndarray, sigma: float = 0.1, near: float = 0.1, path: float = 0.3
) -> OrderLinesObservation:
    return OrderLinesObservation(
        name="run.tdms",
        recordings=("run.tdms",),
        quantity="lines",
        channels=("A", "B"),
        order=ORDER,
        harmonic=HARMONIC,
        family=np.array([f"10h+-{abs(o):g}" for o in OFFSET]),
        amplitude=amplitude,
        noise=np.full((2, 8), sigma),
        recording=np.zeros(8, dtype=int),
        shared=model_errors(TRUTH, ORDER, near),
        path=path_errors(TRUTH, OFFSET, path),
        kept=np.ones((2, 8), dtype=bool),
        order_condition="order",
        point={"load": np.array([2.0])},
    )


def test_it_is_an_observation() -> None:
    assert isinstance(observed(TRUTH), Observation)


def test_covariance_in_closed_form() -> None:
    """Variance: noise + (near^2 + path^2 beside the harmonic) |A|^2; common to one offset at all harmonics: path^2."""
    found = observed(TRUTH)
    size = np.abs(TRUTH) ** 2
    beside = OFFSET != 0
    expected = 0.1**2 + (0.1**2 + 0.3**2 * beside) * size
    assert np.diag(found.covariance)[:16] == pytest.approx(expected.ravel(), rel=1e-12)
    # 7 and 17 lie 10 orders apart and both 3 below their harmonic: of a relative error e, Re(e A) and Re(e B)
    a, b = TRUTH[0, 0], TRUTH[0, 4]
    assert found.covariance[0, 4] == pytest.approx(0.3**2 * np.real(a * np.conj(b)), rel=1e-12)
    assert found.covariance[0, 8] == 0  # the other sensor
    # 9 and 10: hats at 8 and 12 hold 3/4 and 1/4 of the one, 1/2 and 1/2 of the other
    both = 0.1**2 * (np.sqrt(0.75 * 0.5) + np.sqrt(0.25 * 0.5))
    assert found.covariance[1, 2] == pytest.approx(
        both * np.real(TRUTH[0, 1] * np.conj(TRUTH[0, 2])), rel=1e-12
    )


def test_chi_square_of_drawn_errors_has_the_stated_degrees_of_freedom() -> None:
    """Monte Carlo: errors drawn as declared, not from the covariance; then gains of their own."""
    rng = np.random.default_rng(1)
    centres = np.arange(1, 7) * 4.0
    hats = np.sqrt(np.clip(1 - np.abs(ORDER - centres[:, None]) / 4.0, 0, None))

    def drawn() -> float:
        def complex_normal(*shape: int) -> np.ndarray:
            return rng.normal(size=(*shape, 2)) @ np.array([1, 1j])

        smooth = 0.1 * complex_normal(2, centres.size) @ hats
        own = {o: 0.3 * complex_normal(2) for o in np.unique(OFFSET) if o}
        beside = np.stack([own.get(o, np.zeros(2)) for o in OFFSET], axis=1)
        seen = observed(TRUTH * (1 + smooth + beside) + 0.1 * complex_normal(2, 8))
        return float(np.sum(seen.whiten(seen.with_gains(TRUTH) - seen.measured) ** 2))

    values = [drawn() for _ in range(400)]
    dof = observed(TRUTH).n_effective
    assert dof == 32 - 2 * 4
    assert np.mean(values) == pytest.approx(dof, abs=4 * np.sqrt(2 * dof / 400))
    assert np.var(values) == pytest.approx(2 * dof, rel=0.3)


def test_gains_of_a_sensor_and_harmonic_do_not_matter() -> None:
    found = observed(TRUTH)
    gain = np.where(HARMONIC == 1, 3.0 - 2.0j, 0.01j) * np.array([[1.0], [-5.0]])
    other = TRUTH * np.linspace(0.8, 1.1, 8)
    assert found.with_gains(gain * other) == pytest.approx(found.with_gains(other), rel=1e-9)
    assert found.with_gains(gain * TRUTH) == pytest.approx(found.measured, rel=1e-9)
    assert found.with_gains(0 * TRUTH) == pytest.approx(0 * found.measured)


def test_part_of_the_lines() -> None:
    found = observed(TRUTH)
    part = found.take(found.labels["channel"] == "B")
    assert part.n == 16
    assert part.n_effective == 12
    rows = np.flatnonzero(found.labels["channel"] == "B")
    assert part.covariance == pytest.approx(found.covariance[np.ix_(rows, rows)])
    gap = np.random.default_rng(0).normal(size=(32, 3))
    inverse = np.linalg.inv(found.covariance)
    assert np.sum(found.whiten(gap) ** 2, axis=0) == pytest.approx(
        np.einsum("ik,ij,jk->k", gap, inverse, gap)
    )


def test_a_model_is_asked_for_complex_lines() -> None:
    lines = np.stack([np.arange(1.0, 9.0) * (1 + 1j), np.arange(8.0, 0.0, -1.0)])
    model = Model(
        name="comb",
        title="A comb",
        conditions={"order": Condition("order", "1", "Order.", "order", "1")},
        quantities={"lines": constant("lines", lines, "m/s^2", "Lines.")},
        effects={},
        observables={"lines": Observable("lines", "lines", "m/s^2", "Lines.", kind="orders")},
    )
    found = replace(observed(lines), point={})
    assert found.predict(model.assemble(), {}) == pytest.approx(found.measured)


STATEMENT = OrderLines(
    axis="sensor", order=ORDER, harmonic=HARMONIC, offset=OFFSET, family=("",) * 8, order_condition="order",
    rate_condition="speed", rate_ratio=1.0, tachos=(Tacho("Tacho", 1.0),), index="Tacho", period=4,
)  # fmt: skip


@pytest.mark.parametrize("begun", [0, 1, 3])
def test_whole_turns_that_nobody_counted(begun: int) -> None:
    """A recording that begins some turns later comes back, its gain and a weak noise notwithstanding."""
    rng = np.random.default_rng(begun)
    later = TRUTH * np.exp(-2j * np.pi * ORDER * begun) * np.where(HARMONIC == 1, 2j, -0.3)
    noisy = later + 0.01 * rng.normal(size=(2, 8))
    turned, said = like(observed(TRUTH, 0.01), observed(noisy, 0.01), STATEMENT)
    back = turned.amplitude * np.exp(-2j * np.pi * ORDER * begun)
    assert back == pytest.approx(noisy)
    assert bool(said) == bool(begun)


def test_noise_is_not_turned() -> None:
    rng = np.random.default_rng(3)
    whole = np.rint(ORDER) == ORDER
    for _ in range(50):
        one, two = (
            np.where(whole, TRUTH, 0) + rng.normal(size=(2, 8, 2)) @ np.array([1, 1j]) for _ in range(2)
        )
        turned, _ = like(observed(one, 1.0), observed(two, 1.0), STATEMENT)
        assert np.array_equal(turned.amplitude, two)


def two_loads(second: float = 1.0) -> OrderLinesObservation:
    """Two recordings of one path; what a mesh does at the second load is multiplied by a factor."""
    gain = np.where(HARMONIC == 1, 3.0 - 2.0j, 0.01j) * np.array([[1.0], [-5.0]])
    one, two = observed(gain * TRUTH), observed(gain * TRUTH * second)
    return joined(
        [one, replace(two, name="other.tdms", recordings=("other.tdms",), point={"load": np.array([4.0])})]
    )


def test_recordings_of_one_path_share_their_gains() -> None:
    whole = two_loads()
    assert isinstance(whole, Observation)
    assert whole.recordings == ("run.tdms", "other.tdms")
    assert whole.n == 64
    assert whole.n_effective == 64 - 2 * 4  # two sensors, two harmonics, whatever the number of recordings
    assert whole.conditions["load"].tolist() == ([2.0] * 8 + [4.0] * 8) * 4
    lines = np.concatenate([TRUTH, TRUTH], axis=1)
    assert whole.with_gains(lines) == pytest.approx(whole.measured, rel=1e-9)
    # A line that doubles with the load is not made up for, as it would be with gains of each recording.
    doubled = two_loads(2.0)
    assert np.sum(doubled.whiten(doubled.with_gains(lines) - doubled.measured) ** 2) > 10
    apart = observed(2.0 * TRUTH)
    assert apart.with_gains(TRUTH) == pytest.approx(apart.measured)


def test_errors_of_the_path_are_common_to_recordings_and_the_models_are_not() -> None:
    whole = two_loads()
    # Real part of the line at order 7, first sensor, in both recordings; 10 % of the model's own are in neither.
    assert whole.covariance[0, 8] == pytest.approx(0.3**2 * abs(TRUTH[0, 0]) ** 2, rel=1e-9)
    assert whole.covariance[0, 0] == pytest.approx(0.1**2 + (0.3**2 + 0.1**2) * abs(TRUTH[0, 0]) ** 2, rel=1e-9)


def test_gains_of_what_is_held_out_come_from_what_is_fitted() -> None:
    """Monte Carlo: chi-square of a held-out load, gains of the fitted one and their uncertainty included."""
    rng = np.random.default_rng(7)
    lines = np.concatenate([TRUTH, TRUTH], axis=1)
    held = np.concatenate([np.zeros((2, 8), bool), np.ones((2, 8), bool)], axis=1)
    values = []
    for _ in range(300):
        one, two = (
            replace(
                observed(TRUTH + 0.1 * rng.normal(size=(2, 8, 2)) @ np.array([1, 1j]), near=0.0, path=0.0),
                name=name,
            )
            for name in "ab"
        )
        unseen = replace(joined([one, two]), kept=held, reference=~held)
        unseen = replace(unseen, added=unseen._of_reference(lines))
        gap = unseen.with_gains(lines) - unseen.measured
        values.append(float(np.sum(unseen.whiten(gap) ** 2)))
        assert unseen.n_effective == unseen.n == 32
    assert np.mean(values) == pytest.approx(32, abs=4 * np.sqrt(2 * 32 / 300))


def test_the_level_of_a_harmonic_is_an_error_that_sensors_share() -> None:
    found = level_errors(TRUTH, HARMONIC, 1.0)
    together = np.einsum("slr,tmr->slmt", found, np.conj(found))
    # one complex factor a harmonic: real and imaginary unit columns give twice the product
    assert together[0, 0, 1, 1] == pytest.approx(2 * TRUTH[0, 0] * np.conj(TRUTH[1, 1]))
    assert together[0, 0, 5, 0] == 0  # another harmonic
