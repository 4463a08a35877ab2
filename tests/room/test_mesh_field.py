"""A room from a mesh: given a box it is the box; given another shape it is what finite elements say."""

import itertools

import numpy as np
import pytest
from scipy.sparse.linalg import splu

from specan.errors import RequestError
from specan.models import check_effect
from specan.models.catalogue import load_model
from specan.room.model.mesh_modes import reduce
from specan.room.model.port import Port

LENGTHS = np.array([0.9, 0.6, 0.7])
AWAY = np.array([1.2, -0.3, 0.4])  # a mesh need not start at the origin
PLACES = np.random.default_rng(8).uniform(0.08, 0.92, (8, 3)) * LENGTHS
CENTRE, RADIUS = np.array([0.0, 0.26, 0.33]), 0.08
F_MAX = 400.0
GRID = [np.linspace(0, length, count) for length, count in zip(LENGTHS, (7, 5, 6), strict=True)]
THIRD_OCTAVES = 1000 * 10 ** (np.arange(-16, -4) / 10)  # 25 Hz to 315 Hz, their lower edges a sixth below


def rig(shape, shift=0.0, **parts):
    whole = {
        "room": shape,
        "piston": {"wall": "x0", "centre_m": (CENTRE + shift).tolist(), "radius_m": RADIUS},
        "band": {"f_max_hz": F_MAX},
        "mics": {"position_m": (PLACES + shift).tolist(), "cards": [[1, 4], [5, 8]]},
    }
    return {**whole, **parts}


@pytest.fixture(scope="module")
def meshed(bricks, tmp_path_factory):
    room = bricks(GRID, uneven=0.1)
    room.points += AWAY
    path = room.write(tmp_path_factory.mktemp("mesh") / "box.msh")
    return load_model("room", rig({"mesh": str(path)}, AWAY))


@pytest.fixture(scope="module")
def box():
    return load_model("room", rig({"dims_m": LENGTHS.tolist()}))


def field(model, frequency, use=(), values=None):
    return model.assemble(use).evaluate({"frequency": frequency}, values)["field"]


def worst_of_third_octaves(got, expected, frequency):
    """Largest deviation over the RMS of its third octave."""
    found = 0.0
    for centre in THIRD_OCTAVES:
        band = (frequency > centre * 10**-0.05) & (frequency < centre * 10**0.05)
        if band.sum() > 1:
            rms = np.sqrt(np.mean(np.abs(expected[:, band]) ** 2))
            found = max(found, np.abs(got[:, band] - expected[:, band]).max() / rms)
    return found


# Elements of degree 4, 0.15 m long under a piston of 0.08 m, have its near field to some 1e-3 of the field. What
# walls answer to the modes is taken as static, which tells where one is soft at the top of the band.
@pytest.mark.long
@pytest.mark.parametrize(
    ("use", "values", "tolerance"),
    [
        ([], {}, 0.003),
        (["wall-impedance@z1"], {"wall-impedance@z1.conductance": 0.1}, 0.003),
        (["porous-absorber@y1"], {"porous-absorber@y1.coverage": 1.0}, 0.01),
        (["panel-resonance@x0"], {"panel-resonance@x0.coverage": 0.1}, 0.003),
        (["flanking-source@z0"], {}, 0.003),
        (["temperature"], {"temperature.offset": 4.0}, 0.003),
        (["piston-size"], {"piston-size.error": -0.15}, 0.003),
    ],
)
def test_a_box_as_a_mesh_is_the_box(meshed, box, use, values, tolerance):
    f = np.arange(22.0, 355.0, 1.5)
    expected = field(box, f, use, values)
    got = field(meshed, f, use, values)
    assert worst_of_third_octaves(got, expected, f) < tolerance
    if use:
        assert worst_of_third_octaves(got, field(box, f), f) > 3 * tolerance  # the effect is seen


def test_natural_frequencies_are_those_of_the_box(meshed):
    modes = modes_of(meshed)
    squares = [
        np.pi**2 * ((np.array(n) / LENGTHS) ** 2).sum() for n in itertools.product(range(12), repeat=3)
    ]
    exact = np.sqrt(np.sort(squares)[: modes.exact])
    got = np.sqrt(modes.values[: modes.exact].clip(min=0))
    inside = (exact > 0) & (exact <= modes.k_max)
    assert inside.sum() == 8
    assert np.abs(got[inside] / exact[inside] - 1).max() < 1e-5


def modes_of(model):
    return reduce(*model.quantities["room_mesh"]())


def test_a_small_patch_couples_with_itself_as_in_the_box(meshed, box):
    conditions = {"frequency": np.linspace(30.0, F_MAX, 6)}
    at, there = (m.assemble().evaluate(conditions)["room_modes"] for m in (meshed, box))
    for radius in (0.01, 0.03):  # elements are 0.15 m long
        place = np.array([0.3, 0.6, 0.35])
        own, same = Port(tuple(AWAY + place), 1, radius), Port(tuple(place), 1, radius)
        got, expected = at.coupling(own, [own]), there.coupling(same, [same])
        assert np.abs(got - expected).max() < 0.01 * 8 / (3 * np.pi**2 * radius)


def test_a_place_of_a_wall_is_that_of_the_box(meshed, box):
    at, there = (m.assemble().evaluate({"frequency": np.array([100.0])})["room_modes"] for m in (meshed, box))
    for wall in ("x0", "x1", "y0", "y1", "z0", "z1"):
        got, expected = at.place(wall, 0.2, 0.7, 0.01), there.place(wall, 0.2, 0.7, 0.01)
        np.testing.assert_allclose(np.array(got.position) - AWAY, expected.position, atol=1e-9)


def test_a_place_in_the_room_is_that_of_the_box_around_it(meshed):
    loads = meshed.assemble(["scatterer"]).evaluate({"frequency": np.array([100.0])}, wanted=["local_loads"])
    np.testing.assert_allclose(loads["local_loads"][0][0].port.position, AWAY + 0.35 * LENGTHS, rtol=1e-9)


def test_couplings_are_reciprocal(meshed):
    room = meshed.assemble(["wall-impedance@z1"]).evaluate({"frequency": np.linspace(50.0, 400.0, 5)})[
        "room_modes"
    ]
    a = Port(tuple(AWAY + np.array([0.0, 0.3, 0.3])), 0, RADIUS)
    b = Port(tuple(AWAY + np.array([0.5, 0.4, 0.2])), 0)
    np.testing.assert_allclose(room.coupling(a, [b]), room.coupling(b, [a]), rtol=2e-3)


@pytest.mark.parametrize(
    "name",
    ["scatterer", "leak", "wall-impedance", "microphone-position", "flanking-source", "microphone-gain"],
)
def test_effects_keep_the_rules(meshed, name):
    conditions = {"frequency": np.linspace(30.0, F_MAX, 20), "velocity_psd": np.full(20, 1e-11)}
    check_effect(meshed.effects[name], meshed, conditions)


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_an_edge_that_is_off_acts_as_in_the_box(meshed, box, axis):
    frequency = np.arange(40.0, F_MAX, 4.0)
    use, values = f"dimension-error@{axis}", {f"dimension-error@{axis}.error": 0.004}
    values |= {"wall_admittance.common": 0.02, "wall-impedance@z1.conductance": 0.05}
    got, expected = (field(m, frequency, [use, "wall-impedance@z1"], values) for m in (meshed, box))
    assert worst_of_third_octaves(got, expected, frequency) < 0.007
    as_drawn = field(box, frequency, [use, "wall-impedance@z1"], values | {f"{use}.error": 0.0})
    assert worst_of_third_octaves(as_drawn, expected, frequency) > 0.05
    assert {n.effect for n in meshed.nuisances} >= {f"dimension-error@{a}" for a in "xyz"}


def test_lines_above_the_band_are_refused(meshed):
    with pytest.raises(RequestError, match=r"700.0 Hz lies above.*raise \[band\] f_max_hz"):
        field(meshed, np.array([100.0, 700.0]))


# --- rooms that are no box ----------------------------------------------------------------------------

BETA, SOFT = 0.02, 0.15
LINES = np.array([171.0, 236.0])


def narrower(points):
    """Width of the slanted room at some points over that of the box."""
    return 1 - points[..., 0] / 3


def slanted(bricks):
    """A wall that is parallel to none."""
    room = bricks(GRID)
    room.points[:, 1] *= narrower(room.points)
    room.surfaces = {"slope" if name == "y1" else name: part for name, part in room.surfaces.items()}
    return room, PLACES[:, 1] < 0.6 * narrower(PLACES)


@pytest.mark.long
def test_a_slanted_room_that_is_off_is_the_room_of_the_stretched_mesh(bricks, tmp_path):
    room, inside = slanted(bricks)
    drawn = room.write(tmp_path / "drawn.msh")
    room.points = room.points * [1.005, 0.99, 1.0]
    stretched = room.write(tmp_path / "stretched.msh")
    mics = {"position_m": (0.9 * PLACES[inside]).tolist()}
    models = [load_model("room", rig({"mesh": str(path)}, mics=mics)) for path in (drawn, stretched)]
    frequency = np.arange(40.0, F_MAX, 4.0)
    values = {"wall_admittance.common": BETA, "wall-impedance@slope.conductance": 0.1}
    off = {"dimension-error@x.error": 0.005, "dimension-error@y.error": -0.01}
    uses = ["dimension-error@x", "dimension-error@y", "wall-impedance@slope"]
    got = field(models[0], frequency, uses, values | off)
    expected = field(models[1], frequency, ["wall-impedance@slope"], values)
    assert worst_of_third_octaves(got, expected, frequency) < 0.012
    as_drawn = field(models[0], frequency, ["wall-impedance@slope"], values)
    assert worst_of_third_octaves(as_drawn, expected, frequency) > 0.1


def cut(bricks):
    """A corner cut off, of which an edge juts into the room."""

    def inside(points):
        return (points[0] < 0.6) | (points[1] < 0.3)

    return bricks(GRID, keep=inside), inside(PLACES.T)


def direct_solution(room, places, k, factor, admittance):
    """Microphones' pressures by quadratic elements of scikit-fem on a mesh twice as fine, nothing reduced."""
    from skfem import Basis, BilinearForm, ElementTetP2, FacetBasis, MeshTet
    from skfem.helpers import dot, grad

    mesh = MeshTet(room.points.T, room.tetrahedra.T).refined(1)
    basis = Basis(mesh, ElementTetP2(), intorder=4)
    stiffness = BilinearForm(lambda u, v, _: dot(grad(u), grad(v))).assemble(basis)
    mass = BilinearForm(lambda u, v, _: u * v)
    faces = mesh.boundary_facets()
    middles = mesh.p[:, mesh.facets[:, faces]].mean(axis=1)
    on_soft = np.abs(middles[2] - LENGTHS[2]) < 1e-9
    walls = {
        name: mass.assemble(FacetBasis(mesh, ElementTetP2(), facets=faces[chosen], intorder=4))
        for name, chosen in (("soft", on_soft), ("hard", ~on_soft))
    }
    r, w = np.polynomial.legendre.leggauss(12)
    angle = 2 * np.pi * np.arange(24) / 24
    ring = RADIUS * (np.repeat(r, 24) + 1) / 2
    disc = np.stack([np.full(ring.size, 1e-9), CENTRE[1] + ring * np.tile(np.cos(angle), 12),
                     CENTRE[2] + ring * np.tile(np.sin(angle), 12)])  # fmt: skip
    weight = np.repeat(w, 24) * ring
    seen = basis.probes(disc)
    load = seen.T @ (weight / weight.sum())
    area = np.pi * RADIUS**2
    rigid = (seen.T.multiply(weight * area / weight.sum())) @ seen  # the piston does not yield
    at = basis.probes(places.T)
    inside = mass.assemble(basis)
    found = []
    for wave, strength in zip(k, factor, strict=True):
        matrix = stiffness - wave**2 * inside + 1j * wave.real * (
            admittance["hard"] * (walls["hard"] - rigid) + admittance["soft"] * walls["soft"]
        )  # fmt: skip
        symmetric = {"diag_pivot_thresh": 0.001, "options": {"SymmetricMode": True}}
        solved = splu(matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", **symmetric)
        found.append(at @ solved.solve((strength * area * load).astype(complex)))
    return np.array(found).T


# The direct solution's piston is coarser: some 5e-3 at the nearest microphone. At an edge that juts in the
# field is singular, and elements that are no smaller there are good to a percent.
@pytest.mark.long
@pytest.mark.parametrize(("shape", "wall", "tolerance"), [(slanted, "slope", 0.007), (cut, "xm", 0.02)])
def test_another_shape_agrees_with_a_direct_solution(bricks, tmp_path, shape, wall, tolerance):
    room, inside = shape(bricks)
    path = room.write(tmp_path / "room.msh")
    model = load_model("room", rig({"mesh": str(path)}, mics={"position_m": PLACES[inside].tolist()}))
    assert wall in model.axes["wall"]
    values = {"wall_admittance.common": BETA, "wall-impedance@z1.conductance": SOFT - BETA}
    got = model.assemble(["wall-impedance@z1"]).evaluate({"frequency": LINES}, values)
    k = 2 * np.pi * LINES / (got["sound_speed"] * (1 + got["air_dispersion"])) - 1j * got["air_attenuation"]
    factor = 2j * np.pi * LINES * got["density"]
    expected = direct_solution(room, PLACES[inside], k, factor, {"hard": BETA, "soft": SOFT})
    rms = np.sqrt(np.mean(np.abs(expected) ** 2, axis=0))
    assert np.all(np.abs(got["field"] - expected).max(axis=0) < tolerance * rms)
