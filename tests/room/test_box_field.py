"""The sound field of a box against solutions that are found in another way."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import j1, spherical_jn

from specan.models.kept import forget
from specan.room.model import box_field
from specan.room.model.axis_modes import axis_modes, slopes, waves
from specan.room.model.box_field import box
from specan.room.model.port import Port, ball_mean, disc_mean
from specan.room.model.static_correction import _closed_form

LENGTHS = (0.9, 0.6, 0.7)
PISTON = Port((0.0, 0.246, 0.3229), 0, 0.05)
K = np.linspace(0.5, 27.0, 40)
FINE = np.linspace(0.5, 15.0, 600)


def field_of(beta, counts, k=K):
    soft = np.array([1j * k * b for b in beta])
    return box(k, LENGTHS, (k**2).astype(complex), soft, LENGTHS, 1.025 * K.max(), counts)


def summed_across(beta0, beta1, points):
    """Both x walls soft, the others rigid: in-plane modes, and the x axis solved in closed form."""
    m = np.arange(260)
    qm, qn = np.pi * m / LENGTHS[1], np.pi * m / LENGTHS[2]
    kt2 = qm[:, None] ** 2 + qn**2
    z = np.sqrt(kt2) * PISTON.radius
    mean = np.where(z < 1e-9, 1.0, 2 * j1(z) / np.where(z < 1e-9, 1.0, z))
    double = np.where(m == 0, 1, 2)
    weight = double[:, None] * double / (LENGTHS[1] * LENGTHS[2]) * mean
    weight = weight * np.cos(qm * PISTON.position[1])[:, None] * np.cos(qn * PISTON.position[2])
    out = np.empty((len(K), len(points)), dtype=complex)
    for i, k in enumerate(K):
        kappa, a0, a1 = np.sqrt(kt2 - k**2 + 0j), 1j * k * beta0, 1j * k * beta1
        back = (kappa - a1) / (kappa + a1)
        for r, (x, y, z) in enumerate(points):
            wave = np.exp(-kappa * x) + back * np.exp(-kappa * (2 * LENGTHS[0] - x))
            wave = wave / ((kappa + a0) - (kappa - a0) * back * np.exp(-2 * kappa * LENGTHS[0]))
            out[i, r] = (weight * wave * np.cos(qm * y)[:, None] * np.cos(qn * z)).sum()
    return out


@pytest.mark.parametrize(
    ("beta", "tolerance"), [((0.005, 0.01), 5e-5), ((0.3, 0.1), 1e-3), ((0.2 + 0.3j, 0.02), 1e-3)]
)
def test_field_agrees_with_a_sum_in_closed_form(beta, tolerance):
    points = np.array([[0.02, 0.25, 0.33], [0.5, 0.1, 0.6], [0.85, 0.55, 0.05]])
    got = field_of((*beta, 0, 0, 0, 0), (14, 10, 12)).coupling(PISTON, [Port(tuple(p), 0) for p in points])
    expected = summed_across(*beta, points)
    size = np.sqrt(np.mean(np.abs(expected) ** 2, axis=0))
    assert np.max(np.abs(got - expected) / size) < tolerance


@pytest.mark.parametrize("beta", [(0.0, 0.0), (0.01, 0.3), (0.5 + 0.8j, 0.05), (-2j, 0.1), (20j, 1.0)])
def test_axis_modes_are_orthogonal_and_complete(beta):
    k, count = np.array([1.0, 14.0, 27.0]), 20
    modes = axis_modes(0.9, 0.9j * k * beta[0], 0.9j * k * beta[1], count)
    x, weight = np.polynomial.legendre.leggauss(200)
    at = modes.at(0.45 * (x + 1))
    gram = np.einsum("fmx,fnx,x->fmn", at, at, 0.45 * weight)
    for line in range(3):
        size = np.sqrt(np.abs(np.outer(np.diag(gram[line]), np.diag(gram[line]))))
        off = gram[line] - np.diag(np.diag(gram[line]))
        assert np.max(np.abs(off) / size) < 1e-8
        np.testing.assert_allclose(np.diag(gram[line]), modes.norm[line], rtol=1e-7)
    # Zeros of an entire function of order 1/2 are as dense as those of the rigid axis: none is skipped.
    assert np.max(np.sort(modes.w.real, axis=1)[:, -1]) < (np.pi * count) ** 2 * 1.15


def test_slope_is_the_derivative():
    modes = axis_modes(0.9, np.array([0.3j]), np.array([0.2 + 1j]), 6)
    x, h = 0.31, 1e-6
    numeric = (waves(modes.w, modes.a0, x + h) - waves(modes.w, modes.a0, x - h)) / (2 * h)
    np.testing.assert_allclose(slopes(modes.w, modes.a0, x), numeric, rtol=1e-6)


@pytest.mark.parametrize("radius", [0.05, 0.01])
def test_a_patchs_own_coupling_does_not_depend_on_the_truncation(radius):
    patch = Port((0.0, 0.246, 0.3229), 0, radius)
    few, many = (
        field_of((0,) * 6, counts).coupling(patch, [patch]) for counts in ((12, 9, 10), (28, 24, 26))
    )
    np.testing.assert_allclose(few, many, rtol=3e-4 * np.abs(many).max() / np.abs(many).min())
    assert np.max(np.abs(few - many)) < 1e-3 * np.median(np.abs(many))


@pytest.mark.parametrize(("x", "y"), [(0.0, 0.0), (0.9, 0.9), (0.0, 0.3), (0.2, 0.7), (0.45, 0.9)])
def test_the_closed_form_of_an_axis_is_its_sum_over_all_modes(x, y):
    kt2 = np.concatenate([np.linspace(0.0, 40.0, 9), [300.0, 3e3, 2e4]]) ** 2
    k2 = np.array([300.0 + 250.0j, 120.0 + 90.0j])
    n = np.arange(400_000)
    got = _closed_form(np.sqrt(kt2 - k2[:, None]), 0.9, x, y)
    waves = np.where(n == 0, 1, 2) / 0.9 * np.cos(np.pi * n * x / 0.9) * np.cos(np.pi * n * y / 0.9)
    few = [(waves / ((np.pi * n / 0.9) ** 2 + one - k2[0])).sum() for one in kt2[:9]]
    np.testing.assert_allclose(got[0, :9], few, rtol=1e-6, atol=1e-6)
    kappa = np.sqrt(kt2 - k2[:, None])
    low, high = min(x, y), max(x, y)
    plain = (np.exp(-kappa * (high - low)) + np.exp(-kappa * (high + low))) * (
        1 + np.exp(-2 * kappa * (0.9 - high))
    )
    np.testing.assert_allclose(got, plain / (2 * kappa * (1 - np.exp(-2 * kappa * 0.9))), rtol=1e-12)


def test_a_place_of_a_wall_moves_with_it_and_keeps_the_remainder_of_the_drawn_room():
    drawn = field_of((0.01,) * 6, (14, 10, 12))
    longer = replace(drawn, lengths=(0.909, 0.6, 0.7), _done={})
    place = longer.place("z1", 0.4, 0.8, 0.01)
    assert place.position == pytest.approx((0.3636, 0.48, 0.7))
    there = Port((0.2, 0.3, 0.3), 0)
    as_drawn = drawn.place("z1", 0.4, 0.8, 0.01)
    assert as_drawn.position == pytest.approx((0.36, 0.48, 0.7))
    np.testing.assert_array_equal(longer._rest(place, [there]), drawn._rest(as_drawn, [there]))
    patch = Port(as_drawn.position, 2, 0.01)
    np.testing.assert_allclose(drawn.coupling(as_drawn, [there]), drawn.coupling(patch, [there]), rtol=1e-12)


WIDE, NARROW = (0.1 * d / (d + 1j * (FINE / 11.0 - 11.0 / FINE)) for d in (1.0, 0.01))
LINED = 0.95 / (1 + 0.95j * (0.3 * FINE / 5.4 - 3.0 / FINE))  # resistance, mass and stiffness
WALLS = [
    pytest.param(np.full((6, 1), 0.01), 24, id="hard"),
    pytest.param(np.array([0.3, 0.02, 0.1 + 0.2j, 0.0, -0.3j, 0.05])[:, None], 24, id="soft"),
    pytest.param(np.array([0.01, WIDE, 0, 0, 0.1, 0], dtype=object)[:, None], 48, id="resonant"),
    pytest.param(
        np.array([0.01, LINED, 0, 0, 0.02, 0], dtype=object)[:, None], None, id="modes change places"
    ),
    pytest.param(np.array([0.01, NARROW, 0, 0, 0.1, 0], dtype=object)[:, None], None, id="narrow"),
]


@pytest.mark.parametrize(("beta", "few"), WALLS)
def test_few_lines_tell_the_others_or_are_not_used(beta, few, monkeypatch):
    beta = np.array([np.broadcast_to(b[0], FINE.shape) for b in beta], dtype=complex)
    arguments = (FINE, LENGTHS, (FINE - 0.01j) ** 2, 1j * FINE * beta, LENGTHS, FINE.max(), (14, 10, 12))
    source = Port((0.0, 0.246, 0.3229), 0, 0.05)
    receivers = [
        source,
        Port((0.4, 0.0, 0.2), 1, 0.01),
        Port((0.31, 0.2, 0.5), 0, 0.04, ball=True),
        Port((0.31, 0.2, 0.5), 0, slope=1),
        Port((0.7, 0.5, 0.1), 0),
    ]
    sparse = box(*arguments)
    assert (len(sparse.resonances.few.chosen) if sparse.resonances else None) == few
    got = sparse.coupling(source, receivers)
    monkeypatch.setattr(box_field, "interpolations", lambda frequency: ())
    expected = box(*arguments).coupling(source, receivers)
    size = np.sqrt(np.mean(np.abs(expected) ** 2, axis=0))
    assert np.max(np.abs(got - expected) / size) < 1e-8


def test_coupling_is_reciprocal():
    here, there = (field_of((0.1, 0.02, 0.05, 0, 0.2j, 0), (14, 10, 12)) for _ in "ab")
    a, b = Port((0.3, 0.2, 0.5), 0), Port((0.7, 0.45, 0.1), 0)
    np.testing.assert_allclose(here.coupling(a, [b]), there.coupling(b, [a]), rtol=1e-4)


def test_an_opening_in_another_wall_answers_to_the_piston_as_all_modes_say():
    """A patch across the axis that is summed in closed form was taken for one along it: 0.5 % of the coupling."""
    opening, k = Port((0.06, 0.3, 0.7), 2, 0.02), np.linspace(0.8, 8.0, 20)
    room, all_modes = (field_of([0.005] * 6, counts, k) for counts in ((12, 9, 11), (60, 48, 54)))
    room.coupling(PISTON, [PISTON, opening])
    found, expected = room.coupling(opening, [PISTON])[:, 0], all_modes.modal(PISTON, [opening])[:, 0]
    assert np.linalg.norm(found - expected) < 0.002 * np.linalg.norm(expected)


def test_the_mean_over_a_ball_is_a_spherical_bessel_function():
    z = np.array([1e-4, 0.3, 2.0, 7.0])
    np.testing.assert_allclose(ball_mean(z**2, 1.0), 3 * spherical_jn(1, z) / z, rtol=1e-12, atol=1e-13)


def test_means_over_disc_and_ball_are_the_averages_they_claim():
    rng = np.random.default_rng(5)
    u = rng.uniform(-1, 1, (400_000, 3))
    disc = u[np.hypot(u[:, 0], u[:, 1]) < 1][:, :2]
    ball = u[np.linalg.norm(u, axis=1) < 1]
    assert disc_mean(np.array(4.0), 1.0) == pytest.approx(np.cos(disc @ [1.2, 1.6]).mean(), abs=3e-3)
    assert ball_mean(np.array(4.0), 1.0).real == pytest.approx(
        np.cos(ball @ [1.2, 1.6, 0.0]).mean(), abs=3e-3
    )


@pytest.mark.parametrize("beta", [(0.01, 0.3), (0.5 + 0.8j, 0.05)])
def test_modes_do_not_depend_on_what_was_solved_before(beta):
    """Copies of a process that have solved other rooms give the same bytes."""
    k, count = np.array([1.0, 14.0, 27.0]), 12
    near = [0.9j * k * b for b in beta]
    first = axis_modes(0.9, *near, count).w.tobytes()
    forget()
    for factor in (1.002, 0.998, 3.0, 1.0):
        found = axis_modes(0.9, *(factor * a for a in near), count)
    assert found.w.tobytes() == first
