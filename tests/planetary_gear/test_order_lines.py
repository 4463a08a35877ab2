"""Order lines as observations: chi-square in closed form, gains that do not matter, turns that nobody counts."""

import warnings
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.collections import LineCollection

import specan
from specan.errors import RequestError
from specan.models import Condition, Model, Observable
from specan.models.quantity import constant
from specan.planetary_gear.model.kinematics import OrderLines
from specan.planetary_gear.study import figures as figures_study_orders
from specan.planetary_gear.study.open_orders import _marks, _uneven, like
from specan.planetary_gear.study.order_lines import OrderLinesObservation, joined
from specan.study.estimation.fit import fit
from specan.study.estimation.prediction_error import held_out_error, observable_errors
from specan.study.localisation.localise import localise
from specan.study.observation import Observation
from specan.study.selection.candidates import base_problem

ORDER = np.array([7.0, 9.0, 10.0, 11.25, 17.0, 19.5, 20.0, 23.0])
HARMONIC = np.array([1, 1, 1, 1, 2, 2, 2, 2])
OFFSET = ORDER - 10.0 * HARMONIC
PASSAGES = np.array([-3, -1, 0, 1, -3, -1, 0, 3])
MODE = np.array([0, 1, 0, 1, 0, 1, 0, 0])
AWAY = np.minimum(np.abs(PASSAGES), 3) / 3
BEYOND = np.zeros((2, 8), dtype=bool)  # lines that the ideal machine does not have
BEYOND[:, [1, 3, 5]] = True
TRUTH = np.random.default_rng(5).normal(size=(2, 8, 2)) @ np.array([1, 1j]) + 3.0


def observed(
    amplitude: np.ndarray, sigma: float = 0.1, near: float = 0.1, path: float = 0.3, response: float = 0.2
) -> OrderLinesObservation:
    return OrderLinesObservation(
        name="run.tdms",
        of_row=("run.tdms",) * 2,
        quantity="lines",
        channels=("A", "B"),
        known=OrderLines(
            ORDER, HARMONIC, PASSAGES, MODE, np.array([f"10h+-{abs(o):g}" for o in OFFSET]),
            sun_turns=1.0, torque=1.0, period=4, near=near, path=path, response=response,
        ),
        amplitude=amplitude,
        noise=np.full((2, 8), sigma),
        beyond=BEYOND,
        path=np.arange(2),
        kept=np.ones((2, 8), dtype=bool),
        point={"load": np.full(2, 2.0)},
    )  # fmt: skip


def test_it_is_an_observation() -> None:
    assert isinstance(observed(TRUTH), Observation)


def declared_covariance(lines: np.ndarray) -> np.ndarray:
    """Complex V of the lines of both sensors, entry by entry as it is declared."""
    centres = np.arange(1, 7) * 4.0
    basis = np.clip(1 - np.abs(ORDER - centres[:, None]) / 4.0, 0, None)
    v = np.zeros((2, 8, 2, 8), dtype=complex)
    for s, i, t, j in np.ndindex(2, 8, 2, 8):
        shared = 0.0
        if s == t:
            shared += 0.1**2 * np.sum(np.sqrt(basis[:, i] * basis[:, j]))
            same = PASSAGES[i] == PASSAGES[j] and HARMONIC[i] == HARMONIC[j]
            shared += 0.3**2 * AWAY[i] * AWAY[j] * same
        together = BEYOND[s, i] and BEYOND[t, j] and HARMONIC[i] == HARMONIC[j] and MODE[i] == MODE[j]
        apart = np.log(ORDER[i] / ORDER[j]) / 0.06  # of a resonance that is 6 % wide
        of_harmonic = 0.2 * (1.0, 2.0)[HARMONIC[i] - 1]
        shared += of_harmonic**2 * together * np.exp(-(apart**2) / 2)
        v[s, i, t, j] = shared * lines[s, i] * np.conj(lines[t, j]) + 0.1**2 * ((s, i) == (t, j))
    return v.reshape(16, 16)


def test_chi_square_in_closed_form() -> None:
    """(y - p)' V^-1 (y - p), where V is that of the prediction p with the gains found."""
    rng = np.random.default_rng(2)
    found = observed(TRUTH * (1 + 0.2 * (rng.normal(size=(2, 8, 2)) @ np.array([1, 1j]))))
    predicted = np.zeros((2, 8), dtype=complex)
    predicted[found.kept] = found._with_gains(TRUTH[found.kept])[0]
    gap = (found.amplitude - predicted).ravel()
    apart = np.log(found.amplitude / predicted)
    middle = np.minimum(np.abs((found.amplitude - predicted) / apart), 2 * np.abs(predicted))
    middle = middle * predicted / np.abs(predicted)
    expected = np.real(gap.conj() @ np.linalg.solve(declared_covariance(middle), gap))
    moved = found.whiten(found.as_known(TRUTH) - found.measured)
    assert np.sum(moved**2) == pytest.approx(expected, rel=1e-9)


def test_gains_are_those_of_generalised_least_squares() -> None:
    """At their own covariance, and where the declared errors are small beside the noise."""
    rng = np.random.default_rng(4)
    noisy = TRUTH * 2j + rng.normal(size=(2, 8, 2)) @ np.array([1, 1j])
    found = observed(noisy, 1.0, near=1e-6, path=1e-6, response=1e-6)
    predicted = np.zeros((2, 8), dtype=complex)
    predicted[found.kept] = found._with_gains(TRUTH[found.kept])[0]
    for sensor in range(2):
        for h in (1, 2):
            mine = h == HARMONIC
            gain = np.vdot(TRUTH[sensor, mine], noisy[sensor, mine]) / np.vdot(
                TRUTH[sensor, mine], TRUTH[sensor, mine]
            )
            assert predicted[sensor, mine] == pytest.approx(gain * TRUTH[sensor, mine], rel=1e-6)


@pytest.mark.parametrize("factor", [0.2, 5.0])
def test_lines_too_high_cost_as_much_as_lines_too_low(factor: float) -> None:
    """A part of the lines predicted five times too high or too low is refused, far beyond the declared errors."""
    found = observed(TRUTH, 0.001)
    wrong = TRUTH * np.where(BEYOND, factor, 1.0)
    chi2 = np.sum(found.whiten(found.as_known(wrong) - found.measured) ** 2)
    assert chi2 > 60  # of 24 degrees of freedom


def test_lines_that_are_not_predicted_are_evidence_in_full() -> None:
    """A model without a line is given nothing for it, however large the declared errors."""
    found = observed(TRUTH)
    without = np.where(BEYOND, 0.0, TRUTH)
    moved = found.as_known(without)
    rows = found.stack(BEYOND.astype(complex) * (1 + 1j)) > 0
    assert moved[rows] == pytest.approx(np.zeros(rows.sum()), abs=1e-12)


def test_chi_square_of_drawn_errors_has_the_stated_degrees_of_freedom() -> None:
    """Monte Carlo: errors drawn as declared, not from the covariance; then gains of their own."""
    rng = np.random.default_rng(1)
    centres = np.arange(1, 7) * 4.0
    basis = np.sqrt(np.clip(1 - np.abs(ORDER - centres[:, None]) / 4.0, 0, None))

    def drawn() -> float:
        def complex_normal(*shape: int) -> np.ndarray:
            return rng.normal(size=(*shape, 2)) @ np.array([1, 1j])

        smooth = 0.1 * complex_normal(2, centres.size) @ basis
        own = {
            place: 0.3 * complex_normal(2) for place in zip(HARMONIC.tolist(), PASSAGES.tolist(), strict=True)
        }
        beside = AWAY * np.stack(
            [own[h, n] for h, n in zip(HARMONIC.tolist(), PASSAGES.tolist(), strict=True)], axis=1
        )
        answer = 0.2 * complex_normal(2)[HARMONIC - 1] * BEYOND
        seen = observed(TRUTH * np.exp(smooth + beside + answer) + 0.1 * complex_normal(2, 8))
        return float(np.sum(seen.whiten(seen.as_known(TRUTH) - seen.measured) ** 2))

    values = [drawn() for _ in range(400)]
    dof = observed(TRUTH).n_effective
    assert dof == 32 - 2 * 4
    # gains are found by V about the prediction: products of errors make a tenth
    assert np.mean(values) == pytest.approx(dof, rel=0.1)
    assert np.var(values) == pytest.approx(2 * dof, rel=0.4)


@pytest.mark.parametrize(("one_path", "price"), [(True, 1.0), (False, 2.0)])
def test_a_path_that_two_recordings_share_is_paid_for_once(one_path: bool, price: float) -> None:
    """A path a third weaker for one passage: as likely in two recordings at one speed as in one."""
    beside = TRUTH * np.where((HARMONIC == 1) & (PASSAGES == 1), 0.7, 1.0)
    first = observed(beside, 1e-6, near=1e-4, path=0.3, response=1e-4)
    second = replace(first, path=first.path if one_path else first.path + 2, of_row=("b",) * 2)
    both = joined([first, second])

    def chi2(found: OrderLinesObservation, lines: np.ndarray) -> float:
        return float(np.sum(found.whiten(found.as_known(lines) - found.measured) ** 2))

    assert both.recordings == ("run.tdms", "b")
    assert both.n_effective == 2 * first.n_effective
    assert chi2(both, np.tile(TRUTH, (2, 1))) == pytest.approx(price * chi2(first, TRUTH), rel=0.02)
    # a path that one recording has and the other has not, at one speed, is refused
    unlike = joined([first, replace(second, amplitude=TRUTH)])
    assert (chi2(unlike, np.tile(TRUTH, (2, 1))) > 100 * chi2(first, TRUTH)) == one_path


def test_gains_of_a_sensor_and_harmonic_do_not_matter() -> None:
    found = observed(TRUTH)
    gain = np.where(HARMONIC == 1, 3.0 - 2.0j, 0.01j) * np.array([[1.0], [-5.0]])
    other = TRUTH * np.linspace(0.8, 1.1, 8)
    assert found.as_known(gain * other) == pytest.approx(found.as_known(other), rel=1e-9)
    assert found.as_known(gain * TRUTH) == pytest.approx(found.measured, rel=1e-9)
    assert found.as_known(0 * TRUTH) == pytest.approx(0 * found.measured)


def test_part_of_the_lines() -> None:
    found = observed(TRUTH)
    part = found.take(found.labels["channel"] == "B")
    assert part.n == 16
    assert part.n_effective == 12
    assert part.sigma == pytest.approx(found.sigma[found.labels["channel"] == "B"])
    assert part.as_known(TRUTH) == pytest.approx(part.measured)


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
    assert found.plain(model.assemble(), {}) == pytest.approx(found.measured)


@pytest.mark.parametrize("begun", [0, 1, 3])
def test_whole_turns_that_nobody_counted(begun: int) -> None:
    """A recording that begins some turns later comes back, its gain and a weak noise notwithstanding."""
    rng = np.random.default_rng(begun)
    later = TRUTH * np.exp(-2j * np.pi * ORDER * begun) * np.where(HARMONIC == 1, 2j, -0.3)
    noisy = later + 0.01 * rng.normal(size=(2, 8))
    turned, said = like(observed(TRUTH, 0.01), observed(noisy, 0.01))
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
        turned, _ = like(observed(one, 1.0), observed(two, 1.0))
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


def comb(lines: np.ndarray) -> Model:
    return Model(
        "comb", "", {"order": Condition("order", "1", ""), "load": Condition("load", "1", "")},
        {"lines": replace(constant("lines", lines, "1", ""), axes=())}, {},
        {"lines": Observable("lines", "lines", "1", "", kind="orders")},
    )  # fmt: skip


def test_errors_are_the_measurement_less_the_model_with_its_gains() -> None:
    """A path that differs from line to line, as declared, is left in the error, of fitted and of unseen recordings."""
    rng = np.random.default_rng(7)
    apart = np.exp(0.2 * rng.normal(size=(2, 8, 2)) @ np.array([1, 1j]))
    made = [
        replace(observed(gain * TRUTH * apart, 0.01), name=name, of_row=(name,) * 2)
        for gain, name in ((1, "a"), (2j, "b"))
    ]
    problem = base_problem(comb(TRUTH), made[:1])
    (shown,) = problem.plain(problem.start())
    (error,) = observable_errors(problem, made[:1], [shown])
    groups = [(s, h == HARMONIC) for s in range(2) for h in (1, 2)]
    # gains by least squares over lines that the ideal machine has; all others follow
    gains = [
        np.vdot(TRUTH[s, m & ~BEYOND[s]], made[0].amplitude[s, m & ~BEYOND[s]])
        / np.vdot(TRUTH[s, m & ~BEYOND[s]], TRUTH[s, m & ~BEYOND[s]])
        for s, m in groups
    ]
    left = sum(
        np.sum(np.abs(made[0].amplitude[s, m] - gain * TRUTH[s, m]) ** 2)
        for (s, m), gain in zip(groups, gains, strict=True)
    )
    assert error.rms == pytest.approx(np.sqrt(left / 32))
    # They are told, with the error that is there without them.
    (told,) = made[1].path_gains(problem.assembly, {})
    assert told["harmonic"] == [1, 2, 1, 2]
    assert told["rms_without"] == pytest.approx(np.sqrt(np.mean(np.abs(made[1].amplitude - TRUTH) ** 2) / 2))
    assert told["gain_dB"] == pytest.approx(20 * np.log10(2 * np.abs(gains)))
    assert told["phase_deg"] == pytest.approx(90 + np.degrees(np.angle(gains)))
    best = fit(problem, starts=1)
    assert held_out_error(problem, best, made[1:]).errors[0].rms == pytest.approx(2 * error.rms, rel=0.01)


def test_lines_that_a_model_has_by_rounding_only_are_none() -> None:
    """Recordings teach how strongly a machine answers: of nothing but rounding, nothing is made."""
    rounding = 1e-16 * np.exp(1j * np.arange(8))
    model = np.where(BEYOND, rounding, TRUTH)
    both = joined([replace(observed(TRUTH, 0.01), name=n, of_row=(n,) * 2) for n in ("a", "b")])
    problem = base_problem(comb(np.tile(model, 2)), [both])
    (shown,) = problem.plain(problem.start())
    assert np.all(both.lines_of(shown)[both.beyond] == 0)
    assert both.lines_of(shown)[~both.beyond] == pytest.approx(np.tile(TRUTH, (2, 1))[~both.beyond], rel=1e-9)


def test_unseen_lines_teach_nothing_where_their_path_was_heard_before() -> None:
    """Gains come from fitted recordings at the same speed; a level that changes with the load stays in the error."""
    fitted, louder = observed(2j * TRUTH, 0.01), observed(3j * TRUTH, 0.01)
    problem = base_problem(comb(TRUTH), [fitted])
    best = fit(problem, starts=1)
    size = np.sqrt(np.mean(np.abs(TRUTH) ** 2) / 2)
    for path, rms in ((fitted.path, size), (fitted.path + 2, 0.0)):
        unseen = replace(louder, path=path, learned=fitted)
        assert held_out_error(problem, best, [unseen]).errors[0].rms == pytest.approx(rms, abs=1e-9)


@pytest.fixture
def sidebands_low():
    """A problem whose model has sidebands of a harmonic 20 times too low: 26 dB; and its fit."""
    beside = np.abs(OFFSET) == 1
    lines = np.where(beside, 0.05, np.where(OFFSET == 0, 1.0, 0.3)) * np.ones((2, 1), dtype=complex)
    family = np.where(OFFSET == 0, "10h", np.where(beside, "10h+-1", "10h+-n"))
    data = observed(lines, 1e-5)
    data = replace(data, known=replace(data.known, family=family))
    problem = base_problem(comb(lines * np.where(beside, 0.05, 1.0)), [data])
    return problem, fit(problem, starts=1)


def test_a_failure_names_its_family_and_line(sidebands_low) -> None:
    """The level is that of the sidebands, not of the strong lines beside them."""
    said = localise(*sidebands_low).sentences()[0]
    assert said.startswith("fails at orders 10h+-1: model 26 dB low (z = -")
    assert said.endswith("; most at order 9 of A, off by 95 %")


def test_the_figure_shows_the_lines_and_what_is_between_their_levels(sidebands_low, monkeypatch) -> None:
    problem, found = sidebands_low
    monkeypatch.setattr(figures_study_orders, "state_of", lambda study: [])
    study = SimpleNamespace(
        problem=problem, shown=found, model=problem.assembly.model, directory=Path("gear")
    )
    figure = figures_study_orders.figure_compare_orders(study, "B")
    tops, bottoms = figure.axes[:2], figure.axes[2:]
    assert [axes.get_title(loc="left") for axes in tops] == ["h = 1", "h = 2"]
    assert {text.get_text() for text in figure.legends[0].get_texts()} == {"mesh", "passing planets"}

    def heights(rows: list) -> dict[float, float]:
        return {
            line[1, 0]: line[1, 1]
            for axes in rows
            for lines in axes.collections
            if isinstance(lines, LineCollection)
            for line in map(np.asarray, lines.get_segments())
        }

    assert heights(tops)[9.0] == pytest.approx(0.05)
    assert heights(bottoms)[9.0] == pytest.approx(0.95 * 0.05, rel=0.01)
    dashes = {x: y for axes in tops for line in axes.lines for x, y in zip(*line.get_data(), strict=True)}
    assert [dashes[order] for order in (9.0, 10.0)] == pytest.approx([0.0025, 1.0], rel=0.02)
    with pytest.raises(RequestError, match="'C' is not a channel"):
        figures_study_orders.figure_compare_orders(study, "C")


def test_a_contact_that_stiffens_mixes_the_lines_of_a_fault():
    """F = K x^1.3 at a swing of three tenths: the line at twice the frequency over that of the swing."""
    from specan.planetary_gear.study.open_orders import PRODUCTS, _products

    turn = np.arange(4096) / 4096
    place = 1.0 + 0.3 / 1.3 * np.cos(2 * np.pi * turn)
    line = np.abs(np.fft.rfft(place**1.3))
    assert line[2] / line[1] == pytest.approx(PRODUCTS * line[1] / line[0] * 2, rel=0.1)
    amplitude = np.array([[10.0, 3.0, 0.1, 4.0, 0.2]], dtype=complex)
    beyond = np.array([[False, True, True, False, True]])
    found = _products(amplitude, beyond, np.array([1, 1, 1, 2, 2]))
    assert found == pytest.approx(PRODUCTS * np.array([[0.9, 0.9, 0.9, 0.01, 0.01]]))


def test_marks_that_are_even_but_for_rounding_are_even() -> None:
    turns = 8 * np.arange(4 * 12800) / 12800 + 0.1
    plain = specan.Recording.from_arrays(
        {"Tacho sun": np.sin(2 * np.pi * 32 * turns)}, 12800, roles={"Tacho sun": "tacho"}
    )
    tacho = replace(plain.channels[0], properties={"PulsesPerRevolution": 32})
    assert not _uneven(replace(plain, channels=(tacho,)), "Tacho sun").any()


def test_marks_of_the_tacho_that_are_uneven_are_found_and_what_they_make_of_lines() -> None:
    """One line of a steady machine: its false companions in an order analysis are as large as is allowed for."""
    rate, ratio, peak, order = 12800, 3.75, np.radians(0.2), 66.0
    turns = 8 * np.arange(8 * rate) / rate + 0.1
    marks = np.arange(32) / 32
    marks = marks + peak / (2 * np.pi) * np.cos(2 * np.pi * marks + 0.4)
    phase = np.interp(
        ratio * turns % 1, np.concatenate([marks[-1:] - 1, marks, marks[:1] + 1]), np.arange(-1, 33.0)
    )
    plain = specan.Recording.from_arrays(
        {"Acc 1": 5 * np.cos(2 * np.pi * order * turns), "Tacho sun": np.sin(2 * np.pi * phase)}, rate,
        units={"Acc 1": "m/s^2"}, roles={"Tacho sun": "tacho"},
    )  # fmt: skip
    acc, tacho = plain.channels
    recording = replace(plain, channels=(acc, replace(tacho, properties={"PulsesPerRevolution": 32})))
    uneven = _uneven(recording, "Tacho sun")
    assert uneven[0] == pytest.approx(peak, rel=0.02)
    assert uneven[1:] == pytest.approx(np.zeros(7), abs=0.03 * peak)
    wanted = np.array([order - ratio, order, order + 1, order + ratio])
    found = specan.orders(
        recording, tacho="Tacho sun", ratio=ratio, orders=tuple(wanted.tolist()), channels=("Acc 1",)
    )
    allowed = _marks(found.lines.amplitude, wanted, ratio, uneven)[0]
    assert np.abs(found.lines.amplitude[0, [0, 3]]) == pytest.approx(allowed[[0, 3]], rel=0.05)
    assert allowed[2] == 0.0


def test_lines_below_their_noise_have_an_error_and_no_level() -> None:
    """A level of noise says nothing; the error is there, and no warning of an empty mean."""
    one = observed(np.full(BEYOND.shape, 0.001 + 0j), 1.0, near=0.1, path=0.1, response=0.1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        (found,) = observable_errors(base_problem(comb(TRUTH), [one]), [one], [np.zeros(one.n)])
    assert found.level_dB is None
    assert found.rms == pytest.approx(0.001 / np.sqrt(2))
