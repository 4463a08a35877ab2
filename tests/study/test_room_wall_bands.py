"""A wall's impedance free in every third octave: the engine makes vectors of the effect's parameters."""

from dataclasses import replace

import numpy as np
import pytest

from specan.models.catalogue import load_model
from specan.room.model import EXAMPLE_RIG
from specan.room.wall_impedance.wall_admittance import spline_basis, third_octaves, wall_fit
from specan.schema import parse
from specan.study.build_problem import assemble
from specan.study.estimation.fit import fit
from specan.study.observation.frf import FrfObservation
from specan.study.observation.window_leakage import Folding
from specan.study.selection.candidates import base_problem
from specan.study.study_file import StudyFile
from specan.study.verdict import parameter_table

FREQUENCY = np.arange(90.0, 300.0, 3.0)
BAND = {"f_min_hz": 90.0, "f_max_hz": 300.0}


@pytest.fixture(scope="module")
def model():
    return load_model("room", {**EXAMPLE_RIG, "band": BAND})


def observed(model, beta):
    """What four microphones hear when wall z1 has an admittance, with a little noise."""
    seen = replace(
        model.effects["wall-impedance"],
        function=lambda f, rho, c, bands, **_: beta,
        parameters={},
        neutral={},
    )
    h = (
        model.with_effect(seen)
        .assemble(["wall-impedance@z1"])
        .evaluate({"frequency": FREQUENCY})["indicated_frf"]
    )
    level = 2e-3 * np.sqrt(np.mean(np.abs(h) ** 2, axis=0)) * np.ones(h.shape)
    rng = np.random.default_rng(3)
    noise = level * (rng.standard_normal(h.shape) + 1j * rng.standard_normal(h.shape))
    return FrfObservation(
        "take", "take", ("indicated_frf",), FREQUENCY, 1.0, model.axes["microphone"], h + noise, level, level,
        Folding.none(FREQUENCY), {"frequency": FREQUENCY}, np.empty((*h.shape, 0)), np.ones(h.shape, dtype=bool),
    )  # fmt: skip


def study_with(**parameters):
    effect = {"name": "wall-impedance", "at": "z1", "role": "model", "parameters": parameters}
    return parse(
        StudyFile,
        {
            "schema": 1,
            "model": "room",
            "rig": "rig.toml",
            "measurement": [{"file": "a.tdms", "sha256": "0"}],
            "effect": [effect],
        },
        "a study",
    )


def test_the_axis_of_third_octaves_is_that_of_the_band(model):
    assert model.axes["third_octave"] == (
        "100 Hz",
        "125.9 Hz",
        "158.5 Hz",
        "199.5 Hz",
        "251.2 Hz",
        "316.2 Hz",
    )


def test_one_value_everywhere_is_the_same_as_one_a_band(model):
    wall = model.assemble(["wall-impedance@z1"])
    one = {"wall-impedance@z1.conductance": 0.07, "wall-impedance@z1.mass": 3.0}
    many = {name: np.full(6, value) for name, value in one.items()}
    here = {"frequency": FREQUENCY}
    assert np.allclose(wall.evaluate(here, one)["field"], wall.evaluate(here, many)["field"], rtol=1e-12)


@pytest.mark.long
def test_a_wall_of_no_known_form_is_followed_band_by_band(model):
    mid = 1000 * 10.0 ** (np.arange(-10, -4) / 10)
    true = np.array([0.02, 0.03, 0.08, 0.05, 0.10, 0.06])
    beta = np.interp(np.log(FREQUENCY), np.log(mid), true)
    content = study_with(
        conductance={"per": "third_octave"},
        mass={"fixed": True, "value": 0.0},
        stiffness={"fixed": True, "value": 0.0},
    )
    problem = assemble(model, content, [observed(model, beta)])
    assert "wall-impedance@z1.conductance[158.5 Hz]" in problem.names
    assert sum(name.startswith("wall-impedance@z1") for name in problem.names) == 6
    best = fit(problem)
    assert best.reduced_chi2 == pytest.approx(1.0, abs=0.2)
    found = parameter_table(problem, best)
    for band, value in zip(model.axes["third_octave"], true, strict=True):
        row = found[f"wall-impedance@z1.conductance[{band}]"]
        margin = (row["high"] - row["low"]) / 2
        assert row["value"] == pytest.approx(value, abs=max(2.5 * margin, 1e-3))
        assert margin < 0.02


def test_a_few_smooth_parameters_do_not_follow_it(model):
    mid = 1000 * 10.0 ** (np.arange(-10, -4) / 10)
    beta = np.interp(np.log(FREQUENCY), np.log(mid), [0.02, 0.03, 0.08, 0.05, 0.10, 0.06])
    problem = assemble(model, study_with(), [observed(model, beta)])
    assert fit(problem).reduced_chi2 > 2


# --- all walls free ------------------------------------------------------------------------------------


def lining(f):
    return 0.08 / (1 + 0.5j * (f / 180 - 180 / f))


@pytest.mark.long
def test_other_effects_of_the_study_are_fitted_beside_the_walls(model):
    o = observed(model, lining(FREQUENCY))
    louder = o.response * np.where(np.arange(4)[:, None] == 1, 1.06, 1.0)
    problem = base_problem(model, [replace(o, response=louder)])
    problem = problem.with_uses(["wall-impedance@x1", "microphone-gain@Mic 2"])
    found = wall_fit(problem, {"microphone-gain@Mic 2.gain": 0.02})
    names = found.problem.names[: found.theta.size]
    assert not any("wall" in name for name in names)
    gain = found.theta[names.index("microphone-gain@Mic 2.gain")]
    assert gain == pytest.approx(0.06, abs=0.01)
    inside = (found.mid_hz > 150) & (found.mid_hz < 290)
    size = found.beta.size
    spread = np.sqrt(np.diag(found.covariance)).reshape(2, 6, -1)
    truth = np.full(found.beta.shape, 0.005 + 0j)
    truth[5] += lining(found.mid_hz)
    z = np.stack([(found.beta - truth).real, (found.beta - truth).imag]) / spread
    assert np.sqrt(np.mean(z[..., inside] ** 2)) < 1.6
    assert np.abs(found.beta[5] - truth[5])[inside][1:].max() < 0.03  # of 0.08, by four microphones
    assert found.covariance.shape == (2 * size, 2 * size)


def test_in_a_narrow_band_straight_lines_do():
    narrow = third_octaves(150.0, 190.0)
    assert len(narrow) == 3
    basis = spline_basis(np.array([narrow[0], np.sqrt(narrow[0] * narrow[1]), narrow[2]]), narrow)
    assert basis == pytest.approx(np.array([[1, 0.5, 0], [0, 0.5, 0], [0, 0, 1]]), abs=1e-9)
