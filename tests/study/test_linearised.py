"""Covariances about a fitted field: places of microphones, subsamples, what held-out data may not show."""

from dataclasses import replace

import numpy as np
import pytest

from specan.models.catalogue import load_model
from specan.room.model.places import ReceiverErrors, receivers_of
from specan.room.study.field_observation import FieldObservation
from specan.study.estimation.continuation import linearised
from specan.study.estimation.fit import fit
from specan.study.observation.window_leakage import Folding
from specan.study.selection.candidates import base_problem
from specan.study.selection.refits import Refit
from specan.study.selection.starting_values import about_itself

RIG = {
    "room": {"dims_m": [0.9, 0.6, 0.7]},
    "piston": {"wall": "x0", "centre_m": [0.0, 0.246, 0.3229], "radius_m": 0.05},
    "band": {"f_max_hz": 500.0},
    "mics": {"position_m": [[0.1548, 0.0931, 0.1376], [0.62, 0.41, 0.29], [0.45, 0.31, 0.36]]},
}
FREQUENCY = np.arange(60.0, 500.0, 2.0)
AWAY = np.array([[0.0, 0.0, 0.0], [0.004, -0.002, 0.001], [-0.003, 0.004, -0.004]])
ADMITTANCE = 0.012


@pytest.fixture(scope="module")
def model():
    return load_model("room", RIG)


def simulated(model, values, uses):
    """Transfer functions of the model without windows, with a little noise."""
    conditions = {"frequency": FREQUENCY, "velocity_psd": np.ones(FREQUENCY.size)}
    true = model.assemble(uses).evaluate(conditions, values, wanted=["indicated_frf"])["indicated_frf"]
    noise = np.full(true.shape, 0.01)
    rng = np.random.default_rng(5)
    return FieldObservation(
        name="a",
        recording="a",
        quantities=("indicated_frf",),
        frequency_hz=FREQUENCY,
        line_hz=0.5,  # every fourth line: no correlation
        channels=model.axes["microphone"],
        response=true + noise * (rng.standard_normal(true.shape) + 1j * rng.standard_normal(true.shape)),
        noise=np.hypot(noise, 0.02 * np.abs(true)),
        random=noise,
        folding=Folding.none(FREQUENCY),
        conditions_at_nodes=conditions,
        shared=np.empty((*true.shape, 0), dtype=complex),
        kept=np.ones(true.shape, dtype=bool),
        declared=replace(receivers_of(model), errors=ReceiverErrors(0.003, 0.0, 0.0, 0.0, 0.0)),
    )


@pytest.fixture(scope="module")
def measured(model):
    """Microphones that stand millimetres off, read without windows, a little noise."""
    uses = [f"microphone-position@Mic {m}" for m in (1, 2, 3)]
    values = {
        f"{use}.{axis}": AWAY[m, a] for m, use in enumerate(uses) for a, axis in enumerate(("dx", "dy", "dz"))
    }
    return simulated(model, values | {"wall_admittance.common": ADMITTANCE}, uses)


def test_microphones_are_found_where_they_stand(model, measured):
    seen = measured.about(model.assemble(), {"wall_admittance.common": ADMITTANCE})
    assert np.abs(seen.moved - AWAY).max() < 3e-4


@pytest.mark.long
def test_a_fit_about_them_leaves_noise(model, measured):
    """Beside temperature and edges, which may take a part of a displacement."""
    assert fit(linearised(base_problem(model, [measured]))).reduced_chi2 == pytest.approx(1.0, abs=0.15)


def test_about_the_drawn_places_the_field_bends_too_much(model, measured):
    assembly, values = model.assemble(), {"wall_admittance.common": ADMITTANCE}
    drawn = measured.about(assembly, values, seen=False)
    there = measured.about(assembly, values)
    chi2 = [float(np.mean(o.whiten(o.measured - o.predict(assembly, values)) ** 2)) for o in (drawn, there)]
    assert chi2[0] > 1.11 > 1.08 > chi2[1]


def test_held_out_microphones_do_not_tell_where_they_stand(model, measured):
    assembly, values = model.assemble(), {"wall_admittance.common": ADMITTANCE}
    other = replace(measured, response=2 * measured.response)
    for name in ("shared", "noise"):
        one, two = (getattr(o.about(assembly, values, seen=False), name) for o in (measured, other))
        assert np.array_equal(one, two)
    assert measured.about(assembly, values, seen=False).moved is None


def test_a_model_that_fails_does_not_move_microphones_far(model, measured):
    """Walls three times as soft leave much; the microphones must not take it all."""
    found = measured.about(model.assemble(), {"wall_admittance.common": 3 * ADMITTANCE})
    assert np.abs(found.moved).max() < 2.5 * 0.003


def test_a_subsample_has_the_residual_of_the_whole(model, measured):
    assembly, values = model.assemble(), {"wall_admittance.common": 0.9 * ADMITTANCE}
    whole = measured.about(assembly, values)
    subsample = whole.subsample(assembly, values, whole.n // 4)
    lines = np.searchsorted(whole.frequency_hz, subsample.frequency_hz)
    gap = (whole.response - whole.responses(assembly, [values])[0])[:, lines]
    assert subsample.n == pytest.approx(whole.n / 4, rel=0.05)
    np.testing.assert_allclose(
        subsample.response - subsample.responses(assembly, [values])[0], gap, atol=1e-9
    )


@pytest.mark.long
def test_a_displaced_microphone_is_told_where_it_stands(model):
    """25 mm off where 3 mm are declared: about the drawn places a part of that would count as declared error."""
    use, away = "microphone-position@Mic 2", np.array([0.02, -0.014, 0.006])
    values = {f"{use}.{axis}": v for axis, v in zip(("dx", "dy", "dz"), away, strict=True)}
    seen = simulated(model, values | {"wall_admittance.common": ADMITTANCE}, [use])
    problem = linearised(base_problem(model, [seen])).with_uses([use])
    near = fit(problem, problem.start(values))
    found = about_itself(Refit(frozenset(problem.assembly.uses), problem, near))
    numbers = [found.problem.names.index(name) for name in values]
    sd = np.sqrt(np.diag(found.fit.covariance))[numbers]
    assert np.all(np.abs(found.fit.theta[numbers] - away) < 4 * sd)
    assert np.all(sd < 1e-3)
    assert np.linalg.norm(near.theta[numbers] - away) > 2 * np.linalg.norm(found.fit.theta[numbers] - away)
