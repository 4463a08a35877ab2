"""Walls of measured impedance in a study, on a room of the independent simulator."""

import sys
import tomllib
from copy import deepcopy
from pathlib import Path

import numpy as np
import pytest

from specan.models.catalogue import load_model
from specan.room.study.open_recordings import open_data
from specan.room.wall_impedance.wall_admittance import wall_fit
from specan.study.estimation.continuation import linearised
from specan.study.estimation.fit import fit
from specan.study.observation import DataFile, MeasuredFiles
from specan.study.selection.candidates import base_problem
from truth.room import simulate, write

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

from impedance_coverage import true_admittance

pytestmark = pytest.mark.long

BAND = {"f_min_hz": 60.0, "f_max_hz": 280.0}


@pytest.fixture(scope="module")
def soft(tmp_path_factory):
    """A room whose wall y1 is soft; and what a tube would say of it, one standard uncertainty off in Im Z."""
    folder = tmp_path_factory.mktemp("soft")
    case = simulate(11, {"wall-impedance@y1": 0.1}, n_mics=6, cache=folder)
    path, rig = write(case, folder)
    content = tomllib.loads(rig.read_text(encoding="utf-8"))
    content["band"] |= BAND
    frequency = np.geomspace(55.0, 300.0, 30)
    return path, content, frequency, 1 / true_admittance(case.truth, frequency)[3]


def problem(soft, wall=None):
    path, content, frequency, _ = soft
    content = deepcopy(content)
    if wall is not None:
        z, u = wall
        content["walls"] = {"y1": {"frequency_hz": frequency, "z_re": z.real, "z_im": z.imag, "u_z": u}}
    model = load_model("room", content)
    data = open_data(model, MeasuredFiles([DataFile("take", path)]))
    return base_problem(model, data.fitted)


def fitted(problem):
    problem = linearised(problem)
    return problem, fit(problem)


def test_with_the_tube_s_table_nothing_is_missing_and_its_error_is_found(soft):
    z = soft[3]
    u = 0.05 * np.abs(z)
    off = 1 / (1 / z + u / np.abs(z) ** 2)  # one standard uncertainty too soft, in its conductance
    _, without = fitted(problem(soft))
    whole, known = fitted(problem(soft, (off, u)))
    assert without.chi2 / whole.n_data > 10
    assert known.chi2 / whole.n_data < 1.1
    values = whole.values_at(known.theta)
    octaves = whole.assembly.model.axes["octave"]
    seen = [octaves.index(name) for name in ("125.9 Hz", "251.2 Hz")]
    assert np.array(values["wall-data@y1.conductance"])[seen] == pytest.approx([-1, -1], abs=0.3)


def test_an_estimate_of_the_walls_does_not_look_at_what_is_stated(soft):
    z = soft[3]
    wrong = 3 * z, np.abs(z)
    assert np.allclose(wall_fit(problem(soft, wrong)).beta, wall_fit(problem(soft)).beta, atol=1e-6)
