"""A study of a room that is no box, recorded by finite elements of another program on a finer mesh, nothing reduced."""

import sys
from pathlib import Path

import numpy as np
import pytest
import tomlkit
from scipy import interpolate

from specan.io.write_tdms import write_tdms
from specan.models.catalogue import load_model, read_rig_file
from specan.room.study.open_recordings import open_data
from specan.room.wall_impedance.advice import advise
from specan.room.wall_impedance.surface_impedance import impedance
from specan.room.wall_impedance.wall_admittance import wall_fit
from specan.study.observation import DataFile, MeasuredFiles
from specan.study.selection.candidates import base_problem

sys.path.insert(0, str(Path(__file__).parents[1] / "room"))

from test_mesh_field import BETA, CENTRE, RADIUS, SOFT, direct_solution, slanted

pytestmark = pytest.mark.long

if not hasattr(interpolate, "AAA"):
    pytest.skip("scipy before 1.15 has no rational interpolation", allow_module_level=True)

BAND = (70.0, 200.0)
RATE, DURATION_S = 1024.0, 8.0
PLACES = np.array(
    [
        [0.2, 0.1, 0.14],
        [0.17, 0.35, 0.57],
        [0.62, 0.31, 0.29],
        [0.8, 0.12, 0.6],
        [0.5, 0.2, 0.45],
        [0.75, 0.35, 0.1],
    ]
)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A slanted room whose ceiling is soft, and the recording of six microphones in it."""
    from conftest import Bricks

    folder = tmp_path_factory.mktemp("slanted")
    room, _ = slanted(Bricks)
    room.write(folder / "room.msh")
    rig = {
        "room": {"mesh": "room.msh"},
        "piston": {"wall": "x0", "centre_m": CENTRE.tolist(), "radius_m": RADIUS},
        "band": {"f_min_hz": BAND[0], "f_max_hz": BAND[1]},
        "mics": {"position_m": PLACES.tolist()},
        "uncertainty": {"model_discrepancy_percent": 0.7, "position_m": 5e-4, "dimension_percent": 0.02},
    }
    (folder / "rig.toml").write_text(tomlkit.dumps(rig), encoding="utf-8")
    coarse = np.arange(BAND[0] - 25.0, BAND[1] + 31.0, 18.0)  # a rational function lies between, to 1e-4
    model = load_model("room", read_rig_file(folder / "rig.toml"))
    air = model.assemble().evaluate(
        {"frequency": coarse}, wanted=["air_attenuation", "air_dispersion", "density"]
    )
    k = 2 * np.pi * coarse / (air["sound_speed"] * (1 + air["air_dispersion"])) - 1j * air["air_attenuation"]
    factor = 2j * np.pi * coarse * air["density"]
    response = direct_solution(room, PLACES, k, factor, {"hard": BETA, "soft": SOFT})
    n = round(RATE * DURATION_S)
    frequency = np.fft.rfftfreq(n, 1 / RATE)
    rng = np.random.default_rng(5)
    driven = (frequency >= coarse[0]) & (frequency <= coarse[-1])
    velocity = np.where(
        driven, rng.standard_normal(frequency.size) * np.exp(2j * np.pi * rng.random(frequency.size)), 0
    )
    velocity *= 5e-3 * n / np.sqrt(2 * np.sum(np.abs(velocity) ** 2))
    found = np.where(driven, [interpolate.AAA(coarse, one)(frequency) for one in response], 0)
    pressure = np.fft.irfft(found * velocity, n) + 1e-3 * rng.standard_normal((len(PLACES), n))
    moving = np.fft.irfft(velocity, n)
    volts = np.vstack([0.05 * pressure, moving / 0.05])
    names = (*(f"Mic {i}" for i in range(1, len(PLACES) + 1)), "Vibrometer")
    sensors = [{"QuantityUnit": "Pa", "Sensitivity": 50.0, "SensitivityUnit": "mV/Pa"}] * len(PLACES)
    sensors.append({"QuantityUnit": "m/s", "Sensitivity": 0.05, "SensitivityUnit": "(m/s)/V"})
    write_tdms(folder / "recording.tdms", names, volts, RATE, channels=sensors, group={}, samples="int32")
    path = folder / "recording.tdms"
    return base_problem(model, open_data(model, MeasuredFiles([DataFile(path.name, path)])).fitted)


def test_the_soft_wall_is_found_by_its_impedance(recorded):
    settings = recorded.assembly.model.settings
    fit = wall_fit(recorded)
    areas = dict(zip(fit.walls, settings["face_areas_m2"], strict=True))  # each wall is one face
    found = impedance(fit, areas, BAND)
    assert set(found.walls) == {"x0", "x1", "slope", "y0", "z0", "z1"}
    assert found.fit.reduced_chi2 < 1.1
    inside = (found.fit.mid_hz > BAND[0]) & (found.fit.mid_hz < BAND[1])
    size = found.fit.beta.size
    spread = np.sqrt(np.diag(found.fit.covariance)).reshape(2, -1)
    truth = np.array([SOFT if wall == "z1" else BETA for wall in found.fit.walls])[:, None]
    off = (found.fit.beta - truth).reshape(size)
    z = np.stack([off.real, off.imag]) / spread
    z = z.reshape(2, *found.fit.beta.shape)[..., inside]
    assert np.sqrt(np.mean(z**2)) < 1.3
    soft = [row for row in found.of("z1").itertuples() if row.standard_error < 0.05]
    assert len(soft) >= 2
    assert all(row.admittance.real > BETA + 2 * row.standard_error for row in soft)
    assert advise(found) == []  # places for further microphones are not looked for in a mesh
    whole = found.of("all").itertuples()
    sizes = np.array([areas[wall] for wall in found.fit.walls])
    mean = sizes @ truth[:, 0] / sizes.sum()
    assert all(abs(row.admittance.real - mean) < 3 * row.standard_error for row in whole)
