"""The simulated sound field is compared with cases with an exact solution."""

import itertools

import numpy as np
import pytest

from specan.errors import ComputationError, RequestError
from truth.room.box import WALLS, Box, Disc, axis_of
from truth.room.branch import Lining, Motion, Plug
from truth.room.field import Room, march, pressure_per_velocity
from truth.room.line import gauss_lobatto, line

pytestmark = pytest.mark.long

C, RHO = 343.2, 1.204
TUBE = (0.9, 0.1, 0.1)
END = Disc("x0", (0.0, 0.05, 0.05), 0.045)
FACTOR = np.pi * 0.045**2 / 0.01  # velocity of the plane wave over that of the diaphragm
F = np.arange(40.0, 601.0, 20.0)


def tube(admittance: float, *parts: Lining | Plug, **changes: object) -> Room:
    walls = (0.0, admittance, 0.0, 0.0, 0.0, 0.0)
    options = {"position_m": ((0.5, 0.04, 0.03), (0.75, 0.05, 0.05)), "parts": parts, "air_losses": False}
    options |= {"piston": END}
    return Room(TUBE, C, RHO, walls, **(options | changes))  # type: ignore[arg-type]


def plane_wave(admittance: complex | np.ndarray, x: float) -> np.ndarray:
    """Pressure at x of a tube of 0.9 m, driven with unit velocity at 0, closed by an admittance rho c / Z."""
    k = 2 * np.pi * F / C
    behind, whole = k * (0.9 - x), k * 0.9
    return (
        RHO
        * C
        * (np.cos(behind) + 1j * admittance * np.sin(behind))
        / (admittance * np.cos(whole) + 1j * np.sin(whole))
    )


def assert_plane_waves(room: Room, admittance: complex | np.ndarray) -> None:
    heard = pressure_per_velocity(march(room), F)
    for row, place in zip(heard, room.position_m):
        exact = FACTOR * plane_wave(admittance, place[0])
        assert np.max(np.abs(row - exact)) < 4e-3 * np.sqrt(np.mean(np.abs(exact) ** 2))


def test_rule_of_gauss_and_lobatto() -> None:
    points, weights = gauss_lobatto(6)
    for degree in range(12):
        exact = (1 - (-1) ** (degree + 1)) / (degree + 1)
        assert weights @ points**degree == pytest.approx(exact, abs=1e-13)


@pytest.mark.parametrize("edge", [0.5, 0.6, 0.63, 0.7, 0.9, 1.2, 1.25])
def test_natural_frequencies_of_an_edge_are_right_to_600_hz(edge: float) -> None:
    axis = line(edge)
    root = np.sqrt(axis.weights)
    found = np.sqrt(np.abs(np.linalg.eigvalsh(axis.stiffness / root[:, None] / root)))
    exact = np.pi * np.arange(1, int(600.0 * 2 * edge / C) + 1) / edge
    np.testing.assert_allclose(found[1 : len(exact) + 1], exact, rtol=3e-5)


def test_a_rigid_box_rings_where_it_should() -> None:
    dims = (0.9, 0.6, 0.7)
    room = Room(dims, C, RHO, (0.0,) * 6, Disc("x0", (0.0, 0.05, 0.06), 0.05), ((0.88, 0.58, 0.68),))
    heard = march(Room(**{**room.__dict__, "air_losses": False}), longest_s=2.0)
    order = np.array(list(itertools.product(range(4), repeat=3)))[1:]
    exact = np.sort(C / 2 * np.sqrt(np.sum((order / np.array(dims)) ** 2, axis=1)))
    gaps = np.minimum(np.diff(exact, prepend=0.0), np.diff(exact, append=np.inf))
    alone = [f for f, gap in zip(exact, gaps) if f < 610.0 and gap > 3.0]
    assert len(alone) >= 8
    assert max(alone) > 570.0
    window = np.hanning(heard.pressure.shape[1])
    windowed = type(heard)(heard.pressure * window, heard.pulse, heard.step_s, heard.every)
    for f in alone:
        near = f + np.linspace(-0.5, 0.5, 201)
        found = near[np.argmax(np.abs(pressure_per_velocity(windowed, near)[0]))]
        assert abs(found / f - 1) < 2e-4


@pytest.mark.parametrize("admittance", [0.02, 0.3, 1.0])
def test_a_tube_with_a_resistance_at_its_end(admittance: float) -> None:
    assert_plane_waves(tube(admittance), admittance)


def test_a_tube_with_a_swinging_lining_beside_the_wall() -> None:
    motion = Motion(mass=0.8, resistance=900.0, stiffness=0.8 * (2 * np.pi * 260.0) ** 2)
    omega = 2 * np.pi * F
    impedance = motion.resistance + 1j * omega * motion.mass + motion.stiffness / (1j * omega)
    assert_plane_waves(tube(0.1, Lining("x1", motion)), 0.1 + RHO * C / impedance)


@pytest.mark.parametrize("stiffness", [0.0, 3.0e4])
def test_a_plug_and_the_volume_it_opens(stiffness: float) -> None:
    """Far below the first natural frequency the box is a spring, and neck or opening are beside it."""
    dims = (0.3, 0.25, 0.2)
    plug = Plug(Disc("y1", (0.1, 0.0, 0.1), 0.03), Motion(0.3, 40.0, stiffness))
    piston = Disc("x0", (0.0, 0.1, 0.1), 0.05)
    room = Room(dims, C, RHO, (0.004,) * 6, piston, ((0.2, 0.1, 0.1),), (plug,), air_losses=False)
    f = np.array([4.0, 8.0, 16.0])
    omega = 2 * np.pi * f
    surface = 2 * (0.3 * 0.25 + 0.3 * 0.2 + 0.25 * 0.2) - piston.area_m2
    neck = 40.0 + 1j * omega * 0.3 + stiffness / (1j * omega)
    taken = 1j * omega * 0.3 * 0.25 * 0.2 / (RHO * C**2) + 0.004 * surface / (RHO * C)
    exact = piston.area_m2 / (taken + plug.disc.area_m2 / neck)
    heard = pressure_per_velocity(march(room), f)[0]
    # What the neck adds in the room (its end correction) and the first mode: a few percent of the reactance.
    np.testing.assert_allclose(heard, exact, rtol=0.04)
    without = piston.area_m2 / taken
    assert np.min(np.abs(heard / without - 1)) > 0.06


def test_the_diaphragm_takes_no_sound() -> None:
    piston = Disc("z1", (0.4, 0.3, 0.0), 0.25)
    room = Room((0.8, 0.6, 0.5), C, RHO, (0.02,) * 6, piston, ((0.2, 0.1, 0.1),))
    steady = pressure_per_velocity(march(room), np.array([0.0]))[0, 0]
    surface = 2 * (0.48 + 0.4 + 0.3) - piston.area_m2
    assert steady == pytest.approx(RHO * C * piston.area_m2 / (0.02 * surface), rel=2e-3)


def test_each_wall_is_where_it_is_called() -> None:
    """The same room turned by swapping axes and mirrored: what is heard does not change."""
    dims, centre, place = np.array([0.5, 0.4, 0.3]), np.array([0.0, 0.13, 0.2]), np.array([0.3, 0.3, 0.1])
    beta = {"x1": 0.05, "y0": 0.1, "y1": 0.02, "z0": 0.01, "z1": 0.03, "x0": 0.04}
    f = np.array([100.0, 345.0, 500.0])
    heard = []
    for turn in ((0, 1, 2), (2, 0, 1)):
        names = dict(zip("xyz", ("xyz"[turn.index(i)] for i in range(3))))
        walls = {names[w[0]] + w[1]: b for w, b in beta.items()}
        wall = names["x"] + "0"
        room = Room(
            tuple(dims[list(turn)]),
            C,
            RHO,
            tuple(walls[w] for w in WALLS),
            Disc(wall, tuple(centre[list(turn)]), 0.06),
            (tuple(place[list(turn)]),),
        )
        heard.append(pressure_per_velocity(march(room), f)[0])
    np.testing.assert_allclose(heard[1], heard[0], rtol=1e-6)


def test_a_second_source_adds_its_own_field() -> None:
    second = Disc("y1", (0.6, 0.0, 0.05), 0.03)
    both = march(tube(0.3, second=second, second_gain=0.25, second_delay_s=0.0))
    first = march(tube(0.3))
    alone = march(tube(0.3, piston=second))
    f = np.array([80.0, 333.0, 590.0])
    expected = pressure_per_velocity(first, f) + 0.25 * pressure_per_velocity(alone, f)
    np.testing.assert_allclose(pressure_per_velocity(both, f), expected, rtol=2e-3)


def test_air_takes_what_the_standard_says() -> None:
    """ISO 9613-1 at 20 degC and 50 %: decay of the only natural frequency of a short rigid tube in the band."""
    from acoustics.standards.iso_9613_1_1993 import (
        attenuation_coefficient,
        relaxation_frequency_nitrogen,
        relaxation_frequency_oxygen,
        saturation_pressure,
    )
    from acoustics.standards.iso_9613_1_1993 import (
        molar_concentration_water_vapour as humidity,
    )

    t, p = 293.15, 101.325
    h = humidity(50.0, saturation_pressure(t), p)
    oxygen, nitrogen = relaxation_frequency_oxygen(p, h), relaxation_frequency_nitrogen(p, t, h)
    for length in (0.3, 0.6):
        f = C / 2 / length
        expected = attenuation_coefficient(p, t, p, 293.15, nitrogen, oxygen, f) / (20 * np.log10(np.e)) * C
        room = Room((length, 0.1, 0.1), C, RHO, (0.0,) * 6, END, ((length - 0.02, 0.05, 0.05),))
        heard = march(room, longest_s=2.0)
        window = np.hanning(2048)
        turning = np.exp(-2j * np.pi * f * np.arange(2048) / 4096.0)
        early, late = (
            abs(np.sum(window * turning * heard.pressure[0, at : at + 2048])) for at in (1024, 1024 + 4096)
        )
        assert np.log(early / late) == pytest.approx(expected, rel=0.03)


def test_an_unstable_lining_is_reported() -> None:
    with pytest.raises(ComputationError, match="without bound"), np.errstate(all="ignore"):
        march(tube(0.1, Lining("x1", Motion(1e-4, 1.0, 1e9))))


def test_unknown_wall() -> None:
    with pytest.raises(RequestError, match="x1"):
        axis_of("x")


def test_points_are_interpolated() -> None:
    box = Box((0.7, 0.9, 1.2))
    x, y, z = np.meshgrid(*(axis.nodes for axis in box.lines), indexing="ij")
    smooth = (np.cos(3 * x) * np.sin(2 * y + 0.3) * np.cos(4 * z)).ravel()
    places = np.random.default_rng(1).uniform(0, 0.7, (20, 3))
    exact = np.cos(3 * places[:, 0]) * np.sin(2 * places[:, 1] + 0.3) * np.cos(4 * places[:, 2])
    np.testing.assert_allclose(box.at(places) @ smooth, exact, atol=1e-4)
