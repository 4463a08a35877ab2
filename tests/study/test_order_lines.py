"""Order lines as observations: covariance in closed form, gains that do not matter, turns that nobody counts."""

from dataclasses import replace

import numpy as np
import pytest

from specan.models import Condition, Model, Observable
from specan.models.measurement_kinds import OrderLines, Tacho
from specan.models.quantity import constant
from specan.study.data.open_orders import like
from specan.study.estimation.base_problem import base_problem
from specan.study.observation import Observation
from specan.study.observation.order_lines import OrderLinesObservation, declared_errors

ORDER = np.array([7.0, 9.0, 10.0, 11.25, 17.0, 19.5, 20.0, 23.0])
HARMONIC = np.array([1, 1, 1, 1, 2, 2, 2, 2])
OFFSET = ORDER - 10.0 * HARMONIC
TRUTH = np.random.default_rng(5).normal(size=(2, 8, 2)) @ np.array([1, 1j]) + 3.0


def observed(
    amplitude: np.ndarray, sigma: float = 0.1, near: float = 0.1, path: float = 0.3
) -> OrderLinesObservation:
    return OrderLinesObservation(
        name="run.tdms",
        recording="run.tdms",
        quantity="lines",
        channels=("A", "B"),
        order=ORDER,
        harmonic=HARMONIC,
        family=np.array([f"10h+-{abs(o):g}" for o in OFFSET]),
        amplitude=amplitude,
        noise=np.full((2, 8), sigma),
        shared=declared_errors(TRUTH, ORDER, OFFSET, near, path),
        kept=np.ones((2, 8), dtype=bool),
        order_condition="order",
        point={"load": 2.0},
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
    # 9 and 10: basis at 8 and 12 hold 3/4 and 1/4 of the one, 1/2 and 1/2 of the other
    both = 0.1**2 * (np.sqrt(0.75 * 0.5) + np.sqrt(0.25 * 0.5))
    assert found.covariance[1, 2] == pytest.approx(
        both * np.real(TRUTH[0, 1] * np.conj(TRUTH[0, 2])), rel=1e-12
    )


def test_chi_square_of_drawn_errors_has_the_stated_degrees_of_freedom() -> None:
    """Monte Carlo: errors drawn as declared, not from the covariance; then gains of their own."""
    rng = np.random.default_rng(1)
    centres = np.arange(1, 7) * 4.0
    basis = np.sqrt(np.clip(1 - np.abs(ORDER - centres[:, None]) / 4.0, 0, None))

    def drawn() -> float:
        def complex_normal(*shape: int) -> np.ndarray:
            return rng.normal(size=(*shape, 2)) @ np.array([1, 1j])

        smooth = 0.1 * complex_normal(2, centres.size) @ basis
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


def test_a_problem_is_made_of_order_lines() -> None:
    """Gains are no groups of a model, such as lots of oil, of which observations may hold the names."""
    model = Model(
        name="comb",
        title="A comb",
        conditions={
            "order": Condition("order", "1", "Order.", "order", "1"),
            "load": Condition("load", "1", "Load.", "load", "1"),
        },
        quantities={"lines": constant("lines", TRUTH, "m/s^2", "Lines.")},
        effects={},
        observables={"lines": Observable("lines", "lines", "m/s^2", "Lines.", kind="orders")},
    )
    problem = base_problem(model, [observed(TRUTH)])
    assert problem.n_effective == 32 - 2 * 4
    assert problem.residual(problem.start()) == pytest.approx(np.zeros(32), abs=1e-9)
