"""What a mesh must be to be a room; what is wrong is said in a sentence."""

import sys

import numpy as np
import pytest
from click.testing import CliRunner

from specan.errors import RequestError
from specan.models.catalogue import load_model, read_rig_file
from specan.room.model.mesh_file import read_room_mesh
from specan.study.study_file import rig_hash
from specan_cli.main import main

GRID = [np.linspace(0, 0.9, 4), np.linspace(0, 0.6, 3), np.linspace(0, 0.7, 3)]


@pytest.fixture
def box(bricks):
    return bricks(GRID)


def test_a_box_is_read_with_its_walls(box, tmp_path):
    mesh = read_room_mesh(box.write(tmp_path / "room.msh"))
    assert set(mesh.walls) == {"x0", "x1", "y0", "y1", "z0", "z1"}
    assert mesh.volume == pytest.approx(0.9 * 0.6 * 0.7)
    assert mesh.surface == pytest.approx(2 * (0.54 + 0.63 + 0.42))


def test_quadratic_elements_and_named_sets_of_cells_are_read(tmp_path, box):
    import meshio

    box.surfaces = {"all": np.concatenate(list(box.surfaces.values()))}
    middles = {}

    def quadratic(cells, edges):
        rows = []
        for cell in cells:
            pairs = [tuple(sorted((int(cell[i]), int(cell[j])))) for i, j in edges]
            rows.append(
                [*cell, *(middles.setdefault(pair, len(box.points) + len(middles)) for pair in pairs)]
            )
        return np.array(rows)

    tetrahedra = quadratic(box.tetrahedra, [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)])
    triangles = quadratic(box.surfaces["all"], [(0, 1), (1, 2), (0, 2)])
    points = np.vstack([box.points, [box.points[list(pair)].mean(axis=0) for pair in middles]])
    cells = [("triangle6", triangles), ("tetra10", tetrahedra)]
    sets = {"all": [np.arange(len(triangles)), []]}
    meshio.write(tmp_path / "room.inp", meshio.Mesh(points, cells, cell_sets=sets))
    mesh = read_room_mesh(tmp_path / "room.inp")
    assert list(mesh.walls) == ["all"]
    assert mesh.volume == pytest.approx(0.9 * 0.6 * 0.7)
    assert len(mesh.points) == len(box.points)


def without_names(box):
    box.surfaces = {}


def with_an_odd_name(box):
    box.surfaces["y1.left"] = box.surfaces.pop("y1")


def without_volume(box):
    box.tetrahedra = box.tetrahedra[:0]


def with_a_gap_inside(box):
    outer = box.mesh.f2t[0, box.mesh.boundary_facets()]
    inner = np.setdiff1d(np.arange(len(box.tetrahedra)), outer)
    box.tetrahedra = np.delete(box.tetrahedra, inner[0], axis=0)


def with_a_wall_that_ends(box):
    box.surfaces["y1"] = box.surfaces["y1"][1:]


def with_a_wall_inside(box):
    box.surfaces["screen"] = box.mesh.facets[:, box.mesh.f2t[1] >= 0].T[:2]


def with_a_triangle_twice(box):
    box.surfaces["door"] = box.surfaces["y1"][:1]


def in_millimetres(box):
    box.points = box.points * 1000


def twice(box):
    count = len(box.points)
    box.points = np.vstack([box.points, box.points + np.array([5.0, 0, 0])])
    box.tetrahedra = np.vstack([box.tetrahedra, box.tetrahedra + count])
    box.surfaces = {name: np.vstack([part, part + count]) for name, part in box.surfaces.items()}


def flat(box):
    box.points[np.abs(box.points - [0.3, 0.3, 0.35]).max(axis=1) < 1e-6] = [0.3, 0.3, 0.0]


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (without_names, "no named surfaces.*Physical Surface"),
        (with_an_odd_name, "'y1.left'.*without"),
        (without_volume, "holds no tetrahedra, only triangle"),
        (with_a_gap_inside, "has a hole"),
        (with_a_wall_that_ends, r"has a hole: 0\.0.* m²"),
        (with_a_wall_inside, "'screen'.*no outer face"),
        (with_a_triangle_twice, "belongs to 'y1' and to 'door'"),
        (in_millimetres, "900 x 600 x 700 m large.*millimetres"),
        (twice, "2 pieces"),
        (flat, "no volume"),
    ],
)
def test_a_mesh_that_is_no_room_is_refused(bricks, tmp_path, spoil, message):
    room = bricks(GRID)
    spoil(room)
    with pytest.raises(RequestError, match=message):
        read_room_mesh(room.write(tmp_path / "room.msh"))


def test_a_file_that_is_no_mesh_or_not_there(tmp_path, capsys):
    with pytest.raises(RequestError, match="does not exist"):
        read_room_mesh(tmp_path / "none.msh")
    for name in ("junk.msh", "junk.abc"):
        (tmp_path / name).write_text("this is not a mesh\n")
        with pytest.raises(RequestError, match="cannot be read"):
            read_room_mesh(tmp_path / name)
    assert capsys.readouterr().out == ""


def test_without_the_library_the_extra_is_named(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "meshio", None)
    with pytest.raises(RequestError, match=r"specan\[mesh\]"):
        read_room_mesh(tmp_path / "room.msh")


PISTON = {"wall": "x0", "centre_m": [0.0, 0.3, 0.35], "radius_m": 0.1}


def rig(path, **parts):
    whole = {
        "room": {"mesh": str(path)},
        "piston": PISTON,
        "band": {"f_max_hz": 250.0},
        "mics": {"position_m": [[0.2, 0.2, 0.2], [0.5, 0.3, 0.4]]},
    }
    return {**whole, **parts}


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"mics": {"position_m": [[0.2, 0.2, 0.2], [0.5, 0.61, 0.4]]}}, "microphone 2 .*outside the room"),
        (
            {"piston": {"wall": "x9", "centre_m": [0, 0.3, 0.35], "radius_m": 0.1}},
            "'x9', no named surface.*known are x0",
        ),
        ({"piston": PISTON | {"centre_m": [0.1, 0.3, 0.35]}}, "0.1 m off the wall"),
        ({"piston": PISTON | {"centre_m": [0, 0.05, 0.35]}}, "reaches over the edge"),
        ({"piston": PISTON | {"radius_m": 0.02}}, "under the piston"),
        ({"band": {"f_max_hz": 1200.0}}, "too coarse for 1200 Hz.*elements of about 0.1"),
        ({"band": {"f_max_hz": 3000.0}}, "unknowns up to 3000 Hz; expected at most 40000; lower"),
    ],
)
def test_a_rig_that_does_not_fit_its_mesh_is_refused(box, tmp_path, parts, message):
    with pytest.raises(RequestError, match=message):
        load_model("room", rig(box.write(tmp_path / "room.msh"), **parts))


def test_a_mesh_with_too_many_elements_is_refused(bricks, tmp_path):
    fine = bricks([np.linspace(0, a[-1], 18) for a in GRID])
    with pytest.raises(RequestError, match="unknowns, its 29478 tetrahedra being of degree 2"):
        load_model("room", rig(fine.write(tmp_path / "room.msh"), band={"f_max_hz": 100.0}))


RIG = """
room.mesh = "meshes/room.msh"
piston = {wall = "x0", centre_m = [0.0, 0.3, 0.35], radius_m = 0.1}
band.f_max_hz = 250.0
mics.position_m = [[0.2, 0.2, 0.2]]
"""


def test_the_mesh_lies_beside_the_rig_file_and_belongs_to_its_hash(box, tmp_path):
    (tmp_path / "meshes").mkdir()
    (tmp_path / "rig.toml").write_text(RIG)
    box.write(tmp_path / "meshes" / "room.msh")
    model = load_model("room", read_rig_file(tmp_path / "rig.toml"))
    assert model.axes["wall"] == ("x0", "x1", "y0", "y1", "z0", "z1")
    before = rig_hash(tmp_path / "rig.toml")
    assert before == rig_hash(tmp_path / "rig.toml")
    box.points = box.points * 1.01
    box.write(tmp_path / "meshes" / "room.msh")
    assert rig_hash(tmp_path / "rig.toml") != before


def test_the_size_is_said_before_anything_is_computed(box, tmp_path):
    (tmp_path / "meshes").mkdir()
    (tmp_path / "rig.toml").write_text(RIG)
    box.write(tmp_path / "meshes" / "room.msh")
    said = CliRunner().invoke(main, ["model", "show", "room", "--rig", str(tmp_path / "rig.toml")])
    assert said.exit_code == 0
    text = " ".join(said.output.split())
    for part in (
        "72 tetrahedra",
        "unknowns",
        "0.9 x 0.6 x 0.7 m large",
        "modes and responses of walls",
    ):
        assert part in text
