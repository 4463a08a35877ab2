"""Fits that set out from far off: down-weighted views, stages, shapes of what is new."""

from dataclasses import replace

import numpy as np
import pytest

from specan.models import Use
from specan.models.catalogue import load_model
from specan.room.model.places import ReceiverErrors, receivers_of
from specan.room.study.field_observation import FieldObservation
from specan.room.study.of_field import displaced, promised, scan_promising
from specan.study.diagnose import diagnose
from specan.study.estimation.continuation import continuation_fit, down_weighted, linearised
from specan.study.estimation.fit import describe, fit
from specan.study.estimation.prediction_error import observable_errors
from specan.study.observation.window_leakage import Folding
from specan.study.selection.candidates import base_problem, candidates, confounded_with
from specan.study.selection.refits import Refit
from specan.study.selection.signatures import Signatures, score
from specan.study.selection.starting_values import (
    kept_values,
    scan_shapes,
    starting_values,
)
from tests.study.few import beside

RIG = {
    "room": {"dims_m": [0.9, 0.6, 0.7]},
    "piston": {"wall": "x0", "centre_m": [0.0, 0.246, 0.3229], "radius_m": 0.05},
    "band": {"f_max_hz": 400.0},
    "mics": {
        "position_m": [[0.1548, 0.0931, 0.1376], [0.62, 0.41, 0.29], [0.45, 0.31, 0.36], [0.8, 0.5, 0.6]]
    },
}
FREQUENCY = np.arange(60.0, 400.0, 1.0)


@pytest.fixture(scope="module")
def model():
    return load_model("room", RIG)


def recorded(model, uses, values):
    """A recording with 0.2 % of noise, without windows."""
    conditions = {"frequency": FREQUENCY, "velocity_psd": np.ones(FREQUENCY.size)}
    true = model.assemble(uses).evaluate(conditions, values, wanted=["indicated_frf"])["indicated_frf"]
    rng = np.random.default_rng(8)
    noise = np.full(true.shape, 0.002 * np.sqrt(np.mean(np.abs(true) ** 2)))
    return FieldObservation(
        name="a",
        recording="a",
        quantities=("indicated_frf",),
        frequency_hz=FREQUENCY,
        line_hz=0.25,
        channels=model.axes["microphone"],
        response=true + noise * (rng.standard_normal(true.shape) + 1j * rng.standard_normal(true.shape)),
        noise=noise,
        random=noise,
        folding=Folding.none(FREQUENCY),
        conditions_at_nodes=conditions,
        shared=np.empty((*true.shape, 0), dtype=complex),
        kept=np.ones(true.shape, dtype=bool),
        declared=replace(receivers_of(model), errors=ReceiverErrors(0.0, 0.1, 0.3, 0.005, 5e-5)),
    )


LINING = {
    "wall-impedance@y1.conductance": 0.06,
    "wall-impedance@y1.mass": 1.2,
    "wall-impedance@y1.stiffness": 9e6,
}


def test_a_down_weighted_view_has_few_lines_and_the_level_around_them_as_its_measure(model):
    o = recorded(model, [], {})
    view = o.down_weighted(10.0)
    assert view.frequency_hz.tolist() == FREQUENCY[::3].tolist()
    assert view.down_weighted(10.0).n == view.n  # it is not thinned again
    assert not view.strategy.linearised_covariance
    peak = np.argmax(np.abs(view.response).mean(axis=0))
    assert 0.03 < view.noise[0, peak] / np.abs(view.response[:, peak]).mean() < 0.1
    assert np.all(view.noise > o.noise[0, 0])


def test_what_is_held_out_does_not_weigh(model):
    o = recorded(model, [], {})
    part = o.take(o.labels["channel"] != "Mic 2")
    louder = np.where(np.arange(4)[:, None] == 1, 50.0, 1.0)
    other = replace(part, response=part.response * louder)
    np.testing.assert_array_equal(part.down_weighted(5.0).noise[0], other.down_weighted(5.0).noise[0])


def test_stages_find_a_lining_and_leave_the_instruments_alone(model):
    problem = base_problem(model, [recorded(model, ["wall-impedance@y1"], LINING)]).with_uses(
        ["wall-impedance@y1"]
    )
    found = continuation_fit(problem)
    for name, value in LINING.items():
        assert found[name] == pytest.approx(value, rel=0.1), name
    instruments = [n for n in problem.free if n in problem.priors]
    assert all(abs(found[n] - problem.priors[n][0]) < 1.5 * problem.priors[n][1] for n in instruments)


@pytest.mark.long
def test_a_new_resonance_is_looked_for_over_its_range(model):
    """Declared at 150 Hz, it lies at 255 Hz."""
    use = "helmholtz-resonator@z1"
    true = {f"{use}.neck_area": 1.5e-3, f"{use}.resonance": 255.0, f"{use}.quality": 12.0}
    problem = base_problem(model, [recorded(model, [use], true)]).with_uses([use])
    starts = starting_values(problem, [Use.parse(use)], {})
    assert min(abs(s.get(f"{use}.resonance", 150.0) - 255.0) for s in starts) < 30.0
    found = continuation_fit(problem, starts)
    assert found[f"{use}.resonance"] == pytest.approx(255.0, abs=3.0)


@pytest.mark.long
def test_an_opening_is_looked_for_all_over_its_wall(model):
    use = "helmholtz-resonator@z1"
    true = {f"{use}.neck_area": 1.5e-3, f"{use}.resonance": 255.0, f"{use}.quality": 12.0}
    place = {f"{use}.across": 0.75, f"{use}.along": 0.15}
    problem = base_problem(model, [recorded(model, [use], true | place)]).with_uses([use])
    found = continuation_fit(problem, starting_values(problem, [Use.parse(use)], {}))
    for name, value in place.items():
        assert found[name] == pytest.approx(value, abs=0.03), name


@pytest.mark.long
def test_a_small_effect_is_looked_for_on_all_its_lines(model):
    """A down-weighted view of the base is met already, to 5 %; its gain would be found anywhere."""
    use = "flanking-source@y0"
    true = {
        f"{use}.ratio": 0.02,
        f"{use}.delay": 1.2e-3,
        f"{use}.across": 0.8,
        f"{use}.along": 0.6,
    }
    problem = base_problem(model, [recorded(model, [use], true)]).with_uses([use])
    found = fit(linearised(problem, starting_values(problem, [Use.parse(use)], {})))
    assert found.reduced_chi2 < 1.1
    for name, width in (("ratio", 5e-4), ("across", 0.02), ("along", 0.02), ("delay", 2e-5)):
        assert found.values[f"{use}.{name}"] == pytest.approx(true[f"{use}.{name}"], abs=width), name


LEAK = {"area": 5e-5, "length": 0.02, "across": 0.15, "along": 0.8}


def leaking(model, wall="z1"):
    """A room with an opening that a down-weighted view, which knows each line to 5 %, does not see."""
    true = {f"leak@{wall}.{name}": value for name, value in LEAK.items()}
    return base_problem(model, [recorded(model, [f"leak@{wall}"], true)]), true


@pytest.mark.long
def test_of_starts_that_a_down_weighted_view_takes_for_the_same_a_subsample_chooses(model):
    problem, true = leaking(model)
    there = true | {"leak@z1.across": 0.2, "leak@z1.along": 0.75}
    opposite = true | {"leak@z1.across": 0.8, "leak@z1.along": 0.2}
    found = continuation_fit(problem.with_uses(["leak@z1"]), [opposite, there])
    assert found["leak@z1.across"] == pytest.approx(0.15, abs=0.1)
    assert found["leak@z1.along"] == pytest.approx(0.8, abs=0.1)


@pytest.mark.long
def test_what_does_best_at_one_wall_is_looked_for_at_all(model):
    problem, _ = leaking(model)
    problem = linearised(problem)
    base = Refit(frozenset(), problem, fit(problem))
    found = scan_promising(base)
    leaks = [use for use in found if use.name == "leak"]
    assert {use.at for use in leaks} == {c.use.at for c in candidates(problem)[0] if c.use.name == "leak"}
    best = min(leaks, key=lambda use: promised(base, found[use][0]))
    assert str(best) == "leak@z1"


@pytest.mark.long
def test_an_object_is_looked_for_all_over_a_room():
    rig = {
        "room": {"dims_m": [0.8, 0.97, 1.15]},
        "piston": {"wall": "z0", "centre_m": [0.1257, 0.2595, 0.0], "radius_m": 0.05},
        "band": {"f_max_hz": 400.0},
        "mics": {
            "position_m": [
                [0.223, 0.7465, 0.3492],
                [0.3602, 0.2364, 0.3324],
                [0.2233, 0.5953, 1.0165],
                [0.3262, 0.3743, 0.1175],
                [0.5965, 0.1927, 0.9105],
                [0.6964, 0.569, 0.6295],
            ]
        },
    }
    true = {"volume": 2.3e-3, "x": 0.22, "y": 0.89, "z": 0.086}
    there = load_model("room", rig)
    named = {f"scatterer.{name}": value for name, value in true.items()}
    problem = base_problem(there, [recorded(there, ["scatterer"], named)])
    values = continuation_fit(problem)
    view = down_weighted(problem, values=values)
    base = Refit(frozenset(), view, fit(view, start=values))
    use = Use.parse("scatterer")
    best = scan_shapes(base, [use])[use][0]
    places = [best.signature.shapes[f"scatterer.{name}"] for name in "xyz"]
    assert places == pytest.approx([true[name] for name in "xyz"], abs=0.05)
    assert (
        best.chi2_reduction > 0.8 * base.fit.chi2
    )  # a search along one edge after the other explains a quarter


@pytest.mark.long
def test_a_small_resonator_is_found_behind_what_does_something_everywhere(model):
    """A fortieth of the usual size, at a place and a resonance that are not tried at first."""
    use = "helmholtz-resonator@y0"
    true = {"neck_area": 2.5e-5, "resonance": 215.0, "quality": 14.0, "across": 0.68, "along": 0.31}
    named = {f"{use}.{name}": value for name, value in true.items()}
    problem = base_problem(model, [recorded(model, [use], named)])
    problem = linearised(problem)
    base = Refit(frozenset(), problem, fit(problem))
    best = scan_shapes(base, [Use.parse(use)])[Use.parse(use)][0]
    there = [c for c in candidates(problem)[0] if str(c.use) == use]
    known = score(base.linear, Signatures(problem, base.fit).at(there[0], [named]))[0]
    assert best.chi2_reduction > 0.9 * known.chi2_reduction
    assert best.signature.shapes[f"{use}.resonance"] == pytest.approx(215.0, rel=0.02)
    for name in ("across", "along"):
        assert best.signature.shapes[f"{use}.{name}"] == pytest.approx(true[name], abs=0.1), name


def test_an_effect_smaller_than_its_usual_range_is_plausible(model):
    problem, _ = leaking(model)
    changed = problem.with_uses(["leak@z1"])
    low, high = changed.plausible("leak@z1.area")
    assert low == 0.0
    assert high == pytest.approx(1e-2)
    assert changed.plausible("leak@z1.length")[0] == pytest.approx(0.003)
    declared = changed.assembly.parameters["wall_admittance.common"].si
    assert changed.plausible("wall_admittance.common") == (declared.min, declared.max)


def test_what_is_easily_taken_for_an_effect_acts_at_its_place(model):
    found = {str(use) for use in confounded_with(model, Use.parse("wall-impedance@y1"))}
    assert found == {"porous-absorber@y1", "panel-resonance@y1"}


def test_a_panel_is_a_wall_of_resistance_mass_and_stiffness(model):
    """So that data cannot distinguish them, and of coverage and mass they show the ratio only."""
    omega0, conditions = 2 * np.pi * 140.0, {"frequency": FREQUENCY, "velocity_psd": np.ones(FREQUENCY.size)}
    panel = {"coverage": 0.4, "mass": 8.0, "resonance": 140.0, "loss_factor": 0.2}
    base = model.assemble().evaluate(conditions)
    unit = base["density"] * base["sound_speed"]
    wall = {
        "conductance": unit * 0.4 / (8.0 * 0.2 * omega0),
        "mass": 8.0 / 0.4,
        "stiffness": 8.0 / 0.4 * omega0**2,
    }
    uses = {"panel-resonance@x1": panel, "wall-impedance@x1": wall}
    one, two = (
        model.assemble([use]).evaluate(conditions, {f"{use}.{n}": v for n, v in values.items()})[
            "wall_admittance"
        ]
        for use, values in uses.items()
    )
    np.testing.assert_allclose(one, two, rtol=1e-12)
    assert model.effects["panel-resonance"].parameters["mass"].fixed


def test_nothing_is_looked_for_where_nothing_is_new(model):
    problem = base_problem(model, [recorded(model, [], {})])
    assert starting_values(problem, [], {"wall_admittance.common": 0.01}) == [
        {},
        {"wall_admittance.common": 0.01},
    ]


def test_values_of_a_step_come_back_in_si_without_what_is_gone(model):
    problem = base_problem(model, [recorded(model, [], {})])
    table = {
        "wall_admittance.common": {"value": 0.012},
        "temperature.offset": {"value": 1.5},
        "leak@y0.area": {"value": 1e-3},
    }
    assert kept_values(problem, table) == {"wall_admittance.common": 0.012, "temperature.offset": 1.5}


def test_the_view_of_a_problem_is_of_all_its_recordings(model):
    o = recorded(model, [], {})
    assert down_weighted(base_problem(model, [o, o])).n_data == 2 * o.down_weighted(5.0).n


def test_a_receiver_that_stands_elsewhere_is_found_by_its_own_rows(model):
    """Three centimetres off, where the field has bent; the others stand where they are drawn."""
    away = {"dx": 0.024, "dy": -0.011, "dz": 0.016}
    true = {f"microphone-position@Mic 2.{name}": value for name, value in away.items()}
    problem = base_problem(model, [recorded(model, ["microphone-position@Mic 2"], true)])
    base = Refit(frozenset(), problem, describe(problem, problem.start({})))
    assert base.fit.reduced_chi2 > 1.5
    uses = [c.use for c in candidates(problem)[0]]
    found = displaced(base, uses)
    assert [str(use) for use in found] == ["microphone-position@Mic 2"]
    ((values, _),) = found.values()
    assert values == pytest.approx(true, abs=2e-4)


@pytest.mark.parametrize("gain", [-0.06, 0.07])
def test_a_gain_beyond_its_calibration_is_found_by_the_rows_of_its_microphone(model, gain):
    use = "microphone-gain@Mic 2"
    true = {f"{use}.gain": gain}
    problem = linearised(base_problem(model, [recorded(model, [use], true)]), [{}])
    base = Refit(frozenset(), problem, describe(problem, problem.start({})))
    assert not base.poor_fit  # a calibration of 0.1 dB covers it, at a price
    found = displaced(base, [c.use for c in candidates(problem)[0]])
    first = next(iter(found))
    assert str(first) == use
    assert found[first][0] == pytest.approx(true, rel=0.3)


@pytest.mark.long
def test_a_certificate_that_a_lining_contradicts_is_part_of_the_verdict(model):
    """With the wall alone the air is taken far off what its thermometer says: both are missing, not one."""
    lining = {
        "wall-impedance@y1.conductance": 0.4,
        "wall-impedance@y1.mass": 0.2,
        "wall-impedance@y1.stiffness": 4e5,
    }
    warmer = -3.0
    true = {**lining, "temperature.offset": warmer}
    measured = recorded(model, ["wall-impedance@y1", "temperature"], true)
    found = diagnose(base_problem(beside(model, "wall-impedance", "microphone-position"), [measured]))
    assert found.alternatives[0] == ("temperature", "wall-impedance")
    assert found.at == {"wall-impedance": ("y1",)}
    offset = found.ranking[0].parameters["temperature.offset"]
    assert offset["low"] - 0.1 < warmer < offset["high"] + 0.1
    # what certificates of 0.1 % and 10 us leave open is no effect, wherever the fit is
    assert found.smallest_visible["dimension-error"]["value"] > 1e-3
    assert found.smallest_visible["vibrometer-delay"]["value"] > 1e-5


@pytest.mark.long
def test_an_edge_far_off_its_drawing_is_named(model):
    """The base fits with it, but only against its tolerance: what is wrong is the drawing."""
    true = {"dimension-error@z.error": -0.0076}
    measured = recorded(model, ["dimension-error@z"], true)
    found = diagnose(base_problem(beside(model, "wall-impedance", "microphone-position"), [measured]))
    assert found.verdict == "effect"
    assert found.alternatives == (("dimension-error",),)
    assert found.ranking[0].parameters["dimension-error@z.error"]["value"] == pytest.approx(-0.0076, abs=2e-4)


@pytest.mark.long
def test_an_edge_that_its_certificate_hardly_admits_is_said(model):
    """Between what is known and what is named: the sentence says that it is likelier, and the value in percent."""
    measured = recorded(model, ["dimension-error@z"], {"dimension-error@z.error": 0.0036})
    found = diagnose(base_problem(beside(model, "wall-impedance", "microphone-position"), [measured]))
    assert found.verdict == "nothing-missing"
    assert "dimension-error@z is likelier" in found.reason
    assert found.pulls[0].text.startswith("dimension-error@z.error = 0.36 %, known -0.2 to 0.2 %")


def test_levels_do_not_count_lines_of_hum(model):
    o = recorded(model, [], {})
    clear = np.abs(o.response).min() / 20
    heard, random = o.response.copy(), np.full(o.response.shape, clear)
    heard[:, 7], random[:, 7] = 50 * heard[:, 7], 49 * np.abs(heard[:, 7])
    o = replace(o, response=heard, random=random)
    predicted = o.measured * 1.1
    of_hum = np.tile(np.isin(o.frequency_hz, o.frequency_hz[7]), 2 * len(o.channels))
    predicted[of_hum] /= 55
    (error,) = observable_errors(base_problem(model, [o]), [o], [predicted])
    assert error.level_dB == pytest.approx(20 * np.log10(1.1), rel=1e-9)
