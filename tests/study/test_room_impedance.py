"""Impedance of a room's walls: intervals, what is not determined, what would determine it, what the user sees."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.integrate import quad

import specan
import specan.room
from specan.errors import RequestError
from specan.room.model.known_walls import diffuse_absorption, normal_absorption
from specan.room.model.places import free_places, receivers_of, wall_areas, with_microphones
from specan.room.study_impedance import _print
from specan.room.wall_impedance.surface_impedance import impedance
from specan.room.wall_impedance.wall_admittance import WallFit, spline_basis, third_octaves
from specan_cli.main import main
from truth.room import simulate, write
from truth.worm_gear import simulate as simulate_gear
from truth.worm_gear import write as write_gear

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

import impedance_coverage

WALLS = ("x0", "x1", "y0", "y1", "z0", "z1")


@pytest.mark.parametrize("beta", [0.01, 0.1 + 0.05j, 0.02 - 0.3j, 0.64, 1.5 + 0.7j, 0.3 + 1e-7j])
def test_diffuse_absorption_is_the_mean_over_all_angles(beta):
    def by_angle(mu):
        return 2 * mu * 4 * mu * np.real(beta) / abs(mu + beta) ** 2

    assert diffuse_absorption(beta) == pytest.approx(quad(by_angle, 0, 1, limit=200)[0], rel=1e-7)


def test_absorption_at_normal_incidence_is_what_is_not_reflected():
    beta = 0.3 + 0.2j
    assert normal_absorption(beta) == pytest.approx(1 - abs((1 - beta) / (1 + beta)) ** 2)


def test_splines_follow_a_damped_lining_between_the_bands():
    mid, lines = third_octaves(20, 630), np.arange(25.0, 600.0)

    def lining(f):
        return 0.1 / (1 + 0.6j * (f / 250 - 250 / f))

    error = np.abs(lining(mid) @ spline_basis(lines, mid) - lining(lines))
    assert error.max() < 5e-4


def made_up(beta, sd, correlation=0.0):
    """A fit that knows every admittance to `sd`."""
    mid = third_octaves(100, 400)
    size = 6 * len(mid)
    covariance = sd**2 * np.kron([[1, correlation], [correlation, 1]], np.eye(size))
    return WallFit(WALLS, mid, np.full((6, len(mid)), beta, complex), covariance, np.empty(0), 1.0, None)


def first_row(beta, sd, **more):
    fit = made_up(beta, sd, **more)
    return impedance(fit, wall_areas((1.0, 1.0, 1.0)), (90, 410)).table.iloc[0]


def test_where_a_function_is_straight_its_interval_is_that_of_the_delta_rule():
    row = first_row(0.1 + 0.05j, 1e-4)
    for name, slope in (("absorption_normal", 1e-6), ("resistance", 1e-6), ("reactance", 1e-6)):
        function = impedance_coverage.FUNCTIONS[name]
        centre = np.array([row.admittance])
        along = [(function(centre + d) - function(centre - d))[0] / (2 * slope) for d in (slope, 1j * slope)]
        expected = 1.96 * 1e-4 * np.hypot(*along)
        assert (row[f"{name}_high"] - row[f"{name}_low"]) / 2 == pytest.approx(expected, rel=0.01)
    assert row.determined


def test_a_wall_that_may_be_hard_has_no_highest_impedance():
    row = first_row(0.004 + 0.001j, 0.003)
    assert row.resistance_high == np.inf
    assert row.magnitude_high == np.inf
    assert row.reactance_low == -np.inf
    assert row.reactance_high == np.inf
    assert 0 < row.magnitude_low < 250
    assert row.absorption_normal_low == 0
    assert row.determined  # the absorption is known all the same


def test_a_wall_never_gives_energy():
    row = first_row(-0.02 + 0.0j, 0.01, correlation=0.5)
    assert row.admittance.real == 0
    assert row.absorption_normal == 0
    assert 0 < row.absorption_normal_high < 0.08
    assert np.all(np.array([row.absorption_diffuse_low, row.resistance_low]) >= 0)


def test_determined_is_a_matter_of_the_accuracy_that_is_asked_for():
    fit, areas = made_up(0.1, 0.02), wall_areas((1.0, 1.0, 1.0))
    found = impedance(fit, areas, (90, 410)).table
    assert not found[found["wall"] != "all"]["determined"].any()
    assert impedance(fit, areas, (90, 410), accuracy=0.2).table["determined"].all()
    # six walls of equal size together are known better by the root of six
    mean = impedance(fit, areas, (90, 410)).of("all").iloc[0]
    assert mean.standard_error == pytest.approx(0.02 / np.sqrt(6))
    with pytest.raises(RequestError, match="accuracy"):
        impedance(fit, areas, (90, 410), accuracy=0.0)
    told = impedance(fit, areas, (90, 410)).sentences()
    assert told == ["not determined by these positions: walls x0, x1, y0, y1, z0, z1 at 100-400 Hz"]


# --- a whole room, small ---------------------------------------------------------------------------

F_MAX_HZ = 280.0


@pytest.fixture(scope="module")
def soft(tmp_path_factory):
    """A recording of a small room whose wall y1 is soft, found through the command line."""
    case = simulate(11, {"wall-impedance@y1": 0.06}, n_mics=8)
    case.rig["band"]["f_max_hz"] = F_MAX_HZ
    folder = tmp_path_factory.mktemp("soft")
    recording, rig = write(case, folder)
    study = folder / "study"
    new = ["study", "new", study, "--model", "room", "--rig", rig, "--measurement", recording]
    done = CliRunner().invoke(main, [str(a) for a in new])
    assert done.exit_code == 0, done.output
    plot = folder / "walls.png"
    found = CliRunner().invoke(main, ["study", "impedance", str(study), "--json", "--plot", str(plot)])
    assert found.exit_code == 0, found.output
    return case, plot, json.loads(found.stdout)


@pytest.mark.long
def test_the_soft_wall_is_found_blind_and_its_intervals_hold_the_truth(soft):
    case, _, said = soft
    assert said["sentences"][0].startswith("softest: wall y1")
    assert 0.8 < said["reduced_chi2"] < 1.2
    truth = impedance_coverage.true_admittance
    held, tried = 0, 0
    for row in said["rows"]:
        if row["wall"] == "all" or not row["determined"]:
            continue
        mid = 1000 * 10 ** (round(10 * np.log10(row["third_octave_hz"] / 1000)) / 10)
        beta = truth(case.truth, np.array([mid]))[WALLS.index(row["wall"]), 0]
        alpha = row["absorption_normal"]
        held += alpha["low"] <= normal_absorption(beta) <= alpha["high"]
        tried += 1
        assert alpha["value"] == pytest.approx(float(normal_absorption(beta)), abs=0.1)
    assert tried >= 12
    assert held >= 0.8 * tried  # one room: the bench counts many


@pytest.mark.long
def test_what_is_not_determined_is_said_with_what_would(soft):
    said = soft[2]
    open_ = [r for r in said["rows"] if not r["determined"]]
    assert open_
    assert all(r["text"] == "not determined by these positions" for r in open_)
    assert any(r["third_octave_hz"] < 100 for r in open_)
    (positions,) = said["advice"]
    assert len(positions["places_m"]) == 4
    assert positions["open"] == sum(r["wall"] != "all" for r in open_)
    assert all(one["wall"] in WALLS for one in positions["determines"])


@pytest.mark.long
def test_a_figure_is_drawn_beside(soft):
    assert soft[1].read_bytes().startswith(b"\x89PNG")


@pytest.mark.long
def test_python_gives_the_rows_of_the_verb(soft):
    _, plot, said = soft
    frame = specan.room.impedance(specan.Study(plot.parent / "study"), "y1").to_dataframe()
    expected = [row for row in said["rows"] if row["wall"] == "y1"]
    assert frame["third_octave_hz"].tolist() == [row["third_octave_hz"] for row in expected]
    assert frame["determined"].tolist() == [row["determined"] for row in expected]
    np.testing.assert_allclose(
        frame["absorption_normal_high"], [row["absorption_normal"]["high"] for row in expected]
    )


def test_the_table_shows_one_wall_when_asked(capsys):
    whole = impedance(made_up(0.1 + 0.05j, 0.004), wall_areas((1.0, 1.0, 1.0)), (90, 210))
    _print(whole.only("y1"), ())
    said = capsys.readouterr().out
    assert "Wall y1" in said
    assert "Wall y0" not in said
    row = next(line for line in said.splitlines() if line.startswith("125"))
    assert row.split()[1:3] == ["8", "7.41..8.67"]  # 1.96 x 0.004 / |beta|^2 to either side
    assert "not determined" not in said
    with pytest.raises(RequestError, match="no wall 'ceiling'"):
        whole.only("ceiling")


def test_the_table_says_where_these_positions_do_not_tell(capsys):
    _print(impedance(made_up(0.02, 0.05), wall_areas((1.0, 1.0, 1.0)), (90, 210)).only("z0"), ())
    assert "not determined  by these positions  at most 0.38" in capsys.readouterr().out


def test_a_study_of_a_gear_has_no_walls(tmp_path):
    table, rig = write_gear(simulate_gear(5, {}, "small"), tmp_path)
    study = tmp_path / "gear"
    new = ["study", "new", study, "--model", "worm-gear", "--rig", rig, "--measurement", table]
    assert CliRunner().invoke(main, [str(a) for a in new]).exit_code == 0
    done = CliRunner().invoke(main, ["study", "impedance", str(study)])
    assert isinstance(done.exception, RequestError)
    assert "has no walls" in str(done.exception)
    assert "--model room" in str(done.exception)


# --- further microphones ---------------------------------------------------------------------------


def test_further_places_are_free_and_leave_the_microphones_as_they_are():
    from specan.models.catalogue import example_model

    model = example_model("room")
    places = free_places(receivers_of(model).rig)
    dims = np.array(model.settings["rig"]["room"]["dims_m"])
    assert len(places) > 20
    assert np.all(places > 0.05)
    assert np.all(places < dims - 0.05)
    wider, names = with_microphones(model, places[:3])
    f = {"frequency": np.array([150.0, 310.0])}
    both = wider.assemble().evaluate(f)["indicated_frf"]
    assert np.allclose(both[:4], model.assemble().evaluate(f)["indicated_frf"], rtol=1e-9)
    assert both.shape == (7, 2)
    assert wider.axes["microphone"][4:] == names


def test_the_bench_counts_what_stands_in_its_file(tmp_path):
    held = dict.fromkeys(impedance_coverage.FUNCTIONS, True)
    row = {"seed": 1, "wall": "x0", "soft": "x0", "determined": True, "held": held}
    rows = [
        row,
        {**row, "held": dict.fromkeys(held, False)},
        {**row, "wall": "all"},
        {**row, "determined": False},
    ]
    text = impedance_coverage.table(rows)
    assert "determined, any wall: 2 wall-bands" in text
    assert "50.0 %" in text
