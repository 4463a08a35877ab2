"""Contact ratios, phases, assembly, lines by arithmetic on tooth numbers."""

import math
from fractions import Fraction

import numpy as np
import pytest

from specan.errors import RequestError
from specan.planetary_gear.model.geometry import (
    check_assembly,
    gear_mesh,
    mesh_phases,
)
from specan.planetary_gear.model.kinematics import kind_of_phasing, mesh_line_strength
from specan.planetary_gear.model.rig import Gear, read_rig


def gear(sun, planet, ring, planets=3, **more) -> Gear:
    return Gear(z_sun=sun, z_planet=planet, z_ring=ring, planets=planets, module_mm=2.0, **more)


def test_the_articles_stiffness():
    """Its equation (5), two cylinders at the pitch point: the number on the page."""
    angle, ratio = math.radians(20.0), 21 / 24
    radius = 2e-3 * 24 * math.cos(angle) * math.tan(angle) / 2 * ratio / (1 + ratio)
    k = 4 / 3 * math.sqrt(radius) * 1.154e11
    assert k / 1e3**1.5 == pytest.approx(3.01e5, rel=2e-3)


def test_contact_ratios():
    angle = math.radians(20.0)
    assert gear_mesh(24, 21, 2e-3, angle).contact_ratio == pytest.approx(1.586, abs=5e-4)
    assert gear_mesh(21, -66, 2e-3, angle).contact_ratio == pytest.approx(1.932, abs=5e-4)
    # A gear with ever more teeth becomes a rack; the ratio of two like racks tends to 4 / (pi sin 2a).
    assert gear_mesh(100000, 100000, 2e-3, angle).contact_ratio == pytest.approx(
        4 / (math.pi * math.sin(2 * angle)), rel=1e-3
    )


def test_a_gap_outside_contact_is_that_of_two_cylinders_of_the_flanks():
    """For gears that are alike the tip's way follows the curvatures of the flanks; a larger gear has a smaller gap."""
    angle = math.radians(20.0)
    small, large = gear_mesh(24, 24, 2e-3, angle), gear_mesh(96, 96, 2e-3, angle)
    assert small.gap_before == pytest.approx(small.gap_after, rel=1e-2)
    assert large.gap_before < small.gap_before


# (gear, kind, orders about the first mesh harmonic that show, by n = sum of equal phases at whole multiples of N ...)
SETS = [
    (gear(24, 21, 66), "in phase", {63: 1, 64: 0, 65: 0, 66: 1, 67: 0, 68: 0, 69: 1}),
    (gear(31, 31, 95, centre_distance_mm=63.0), "sequentially phased",
     {92: 0, 93: 1, 94: 0, 95: 0, 96: 1, 97: 0}),
    (gear(26, 24, 74, planets=4), "counter-phased", {72: 1, 73: 0, 74: 0, 75: 0, 76: 1}),
    (gear(24, 21, 66, planet_angles_deg=(0.0, 120.0, 236.0)), "unequally spaced", {}),
]  # fmt: skip


@pytest.mark.parametrize(("made", "kind", "lines"), SETS, ids=[kind for _, kind, _ in SETS])
def test_lines_of_four_kinds_of_sets(made, kind, lines):
    check_assembly(made)
    assert kind_of_phasing(made) == kind
    orders = np.arange(made.z_ring - 6, made.z_ring + 7)
    found = dict(zip(orders.tolist(), mesh_line_strength(made, orders)))
    for order, strength in lines.items():
        assert found[order] == pytest.approx(strength, abs=1e-12)
    places = made.planet_angles_deg or tuple(360 * i / made.planets for i in range(made.planets))
    for order in orders.tolist():
        # exact arithmetic on fractions of a turn: all planets add up where n psi is whole for each
        turns = [Fraction(round(order * a * 1000), 360_000) for a in places]
        if all(t.denominator == 1 for t in turns):
            assert found[order] == pytest.approx(1.0)
        else:
            assert found[order] < 1 - 1e-6


def test_phases_of_the_article_are_equal_on_all_planets():
    sun, ring = mesh_phases(gear(24, 21, 66))
    assert np.allclose(sun, 0)
    assert np.allclose(ring, ring[0])


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (gear(24, 21, 66, planets=4), "4 planets cannot be equally spaced: z_sun \\+ z_ring = 90"),
        (gear(24, 21, 70), "have no common centre distance.*66 teeth"),
        (gear(31, 31, 95), "have no common centre distance"),
        (
            gear(24, 21, 66, planet_angles_deg=(0.0, 120.0, 239.0)),
            "does not mesh with sun and ring at once.*240",
        ),
        (gear(24, 21, 66, planets=6), "neighbouring planets touch"),
        (gear(24, 21, 66, planet_angles_deg=(0.0, 120.0)), "2 angles for 3 planets"),
    ],
)
def test_teeth_that_do_not_assemble(made, said):
    with pytest.raises(RequestError, match=said):
        check_assembly(made)


def test_a_mistyped_key_and_a_missing_table_are_told():
    with pytest.raises(RequestError, match=r"planetts.*planets"):
        read_rig({"gear": {"z_sun": 24, "z_planet": 21, "z_ring": 66, "planetts": 3, "module_mm": 2.0}})
    with pytest.raises(RequestError, match="neither"):
        read_rig({})


def test_lines_that_a_sharper_path_would_give_are_no_evidence():
    """20/70/25 with three planets shows multiples of three: 204 and 216, which its sun's turns reach, are left out."""
    from specan.planetary_gear.model.kinematics import kinematic_orders

    found = kinematic_orders(Gear(z_sun=20, z_planet=25, z_ring=70, planets=3, module_mm=2.0))
    assert not {201.0, 204.0, 216.0, 219.0} & set(found)
    assert {73.5, 67.5, 207.0, 210.0, 213.0} <= set(found)
    article = kinematic_orders(Gear(z_sun=24, z_planet=21, z_ring=66, planets=3, module_mm=2.0))
    assert article.size == 96  # four times the turn of its sun is 11 orders: lines of the ideal set


@pytest.mark.parametrize("teeth", [(24, 21, 66, 3), (20, 25, 70, 3), (18, 24, 66, 4), (31, 31, 95, 3)])
def test_lines_of_an_uneven_sun_are_those_of_a_signal_at_a_sensor(teeth):
    """Planets pass a sensor with a Hann window; each force has the mesh, modulated by m turns of the sun."""
    from specan.planetary_gear.model.kinematics import (
        kinematic_orders,
        mesh_line_strength,
        repeat_turns,
        sun_order,
    )

    z_sun, z_planet, z_ring, planets = teeth
    made = Gear(z_sun=z_sun, z_planet=z_planet, z_ring=z_ring, planets=planets, module_mm=1.0)
    turns, samples = repeat_turns(made), 1 << 16
    at = 2 * np.pi * turns * np.arange(samples) / samples
    known = kinematic_orders(made)
    for h in (1, 2):
        for m in range(1, 7):
            heard = np.zeros(samples)
            for place in 2 * np.pi * np.arange(planets) / planets:
                uneven = np.cos(m * (float(sun_order(made)) * at - place) + 0.3)
                mesh = np.cos(h * z_ring * (at + place))
                heard += (1 + np.cos(at + place)) * uneven * mesh
            size = np.abs(np.fft.rfft(heard))
            there = np.flatnonzero(size > 0.01 * samples) / turns
            whole = np.rint(there).astype(int)
            ideal = (np.abs(there - whole) < 1e-9) & (mesh_line_strength(made, whole) > 1e-9)
            two_away = planets == 4 and (h * z_ring - m) % 4 == 2  # a Hann window reaches one passage
            assert there.size >= 2 or two_away
            assert all(np.abs(known - o).min() < 1e-6 for o in there[~ideal])


@pytest.mark.parametrize("teeth", [(24, 21, 66, 3), (20, 25, 70, 3), (18, 24, 66, 4)])
def test_kind_of_mode_is_that_of_the_forces_on_the_planets(teeth):
    """The m-th multiple of an uneven sun presses planets with the phases (h z_ring -+ m) psi: alike, or in a wave."""
    from specan.planetary_gear.model.kinematics import line_statement
    from specan.planetary_gear.model.rig import Rig

    z_sun, z_planet, z_ring, planets = teeth
    made = Gear(z_sun=z_sun, z_planet=z_planet, z_ring=z_ring, planets=planets, module_mm=2.0)
    known = line_statement(Rig(gear=made), 3)
    place = 2 * np.pi * np.arange(planets) / planets
    looked_at = 0
    for order, h, mode, family in zip(known.order, known.harmonic, known.mode, known.family, strict=True):
        if not family.endswith("(sun)"):
            continue
        offset = order - h * z_ring
        apart = {way: offset - way * z_ring / z_sun for m in range(1, 7) for way in (m, -m)}
        ways = [
            way
            for way, passages in apart.items()
            if abs(passages - round(passages)) < 1e-6 and (h * z_ring - way + round(passages)) % planets == 0
        ]
        if not ways:  # planets that are alike show nothing there
            continue
        waves = np.exp(1j * np.outer([h * z_ring - way for way in ways], place))
        # What is left of each wave beside those in which all planets are alike, or go to a side.
        alike = np.abs(waves.mean(axis=1))
        aside = np.abs((waves * np.exp(1j * place)).mean(axis=1)) + np.abs(
            (waves * np.exp(-1j * place)).mean(axis=1)
        )
        shown = [0 if a > 0.5 else 1 if b > 0.5 else 2 for a, b in zip(alike, aside, strict=True)]
        assert mode in shown
        looked_at += 1
    assert looked_at > 12
