"""Equations of motion of gears in contact, integrated in fixed steps by a linearly implicit method.

Contacts may be damped far beyond the critical value, which makes the equations stiff: an explicit method needs steps
as short as the fastest decay. The method is RODAS of E. Hairer and G. Wanner, Solving Ordinary Differential Equations
II, 2nd ed., Springer 1996, section VI.4: six stages, fourth order, L-stable and stiffly accurate. It is written with
unknowns that need no product with the Jacobian J (same book, section IV.7):

(1/(h gamma) - J) u_i = f(t + alpha_i h, y + sum_j a_ij u_j) + sum_j c_ij u_j / h + h gamma_i df/dt,
y_new = y + sum_i m_i u_i.

Plain loops over floats: the file is compiled where numba is present, and works on lists where it is not, which Python
reads three times as fast as arrays. All that is compiled together is in this one file: numba renews what it keeps on
disk when the file of a caller changes, not when that of what is called does.
Lengths in mm and forces in N within the contact law (its constants are given so), SI elsewhere.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from specan.planetary_gear.model.compiled import HAS_NUMBA, compiled

SLOPES = 3  # that mesh_contact gives


def _numbers(values: Any) -> Any:
    """An array for compiled loops, a list for those of Python."""
    array = np.array(values, dtype=float)
    return array if HAS_NUMBA else array.tolist()


# Coefficients of the authors' program RODAS (METH = 1), their symbols in the equation above.
_GAMMA = 0.25
_ALPHA_I = _numbers([0.0, 0.386, 0.21, 0.63, 1.0, 1.0])
_GAMMA_I = _numbers([0.25, -0.1043, 0.1035, -0.03620000000000023, 0.0, 0.0])
_M = _numbers([1.221224509226641, 6.019134481288629, 12.53708332932087, -0.687886036105895, 1.0, 1.0])
_A = _numbers(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0],
        [1.544, 0.0, 0.0, 0.0, 0.0],
        [0.9466785280815826, 0.2557011698983284, 0.0, 0.0, 0.0],
        [3.314825187068521, 2.896124015972201, 0.9986419139977817, 0.0, 0.0],
        [1.221224509226641, 6.019134481288629, 12.53708332932087, -0.687886036105895, 0.0],
        [1.221224509226641, 6.019134481288629, 12.53708332932087, -0.687886036105895, 1.0],
    ]
)
_C = _numbers(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0],
        [-5.6688, 0.0, 0.0, 0.0, 0.0],
        [-2.430093356833875, -0.2063599157091915, 0.0, 0.0, 0.0],
        [-0.1073529058151375, -9.594562251023355, -20.47028614809616, 0.0, 0.0],
        [7.496443313967647, -10.24680431464352, -33.99990352819905, 11.7089089320616, 0.0],
        [8.083246795921522, -7.981132988064893, -31.52159432874371, 16.31930543123136, -6.058818238834054],
    ]
)


@compiled
def mesh_contact(phase, frequency, x, v, law, mesh, slopes):
    """Sum over all pairs of teeth of a mesh.

    The contact law is that of equations 3 and 4 of the article: K d^e + C s(d) v, with d the depth, v the rate of
    approach and s rising from 0 to 1 over the first `law[3]` of the depth.

    Parameters
    ----------
    phase : float
        Of the mesh, in base pitches.
    frequency : float
        Of the mesh, Hz.
    x, v : float
        Approach of the flanks (mm) and its rate (mm/s).
    law : array
        K (N/mm^e), e, C (N s/mm), depth (mm), backlash (mm).
    mesh : array
        Base pitch (mm), contact ratio, gap coefficients before and after contact (1/mm).
    slopes : array (SLOPES)
        Is filled with the derivatives of the force by x, v and time.

    Returns
    -------
    float
        Force, N.
    """
    base = phase - math.floor(phase)
    force = 0.0
    for k in range(len(slopes)):
        slopes[k] = 0.0
    speed = mesh[0] * frequency
    for j in range(-1, 4):
        place = base + j
        gap, opening = 0.0, 0.0  # of the flanks, and its derivative
        if place < 0.0:
            u = -place * mesh[0]
            gap, opening = mesh[2] * u * u, -2.0 * mesh[2] * u * speed
        elif place > mesh[1]:
            u = (place - mesh[1]) * mesh[0]
            gap, opening = mesh[3] * u * u, 2.0 * mesh[3] * u * speed
        if gap > 1.0:
            continue
        if x - gap > 0.0:
            side, depth = 1.0, x - gap
        elif -x - law[4] - gap > 0.0:  # the other flank
            side, depth = -1.0, -x - law[4] - gap
        else:
            continue
        f = law[0] * depth ** law[1]
        stiffness = law[1] * f / depth
        part = min(depth / law[3], 1.0)
        c = law[2] * (3.0 - 2.0 * part) * part * part
        rise = law[2] * 6.0 * (1.0 - part) * part / law[3]
        force += side * f + c * v
        slopes[0] += stiffness + side * rise * v
        slopes[1] += c
        slopes[2] -= opening * (side * stiffness + rise * v)
    return force


@compiled
def rates(time, n, sizes, law, sun_mesh, ring_mesh, phases, load, state, change, forces, slopes):
    """Derivative of the state, the forces, and the derivatives of the contacts (sun meshes, then ring meshes)."""
    rb_s, rb_p, rb_r = sizes[0], sizes[1], sizes[2]
    carrier, carrier_rate = state[0], state[n + 1]
    torque_carrier, torque_sun = 0.0, 0.0
    mesh = sizes[5] * time
    for i in range(n):
        planet, planet_rate = state[1 + i], state[n + 2 + i]
        # Approach of the flanks along the lines of action, mm: what is beside the steady rotation.
        x_s = 1e3 * (-(rb_s + rb_p) * carrier + rb_p * planet)
        v_s = 1e3 * (-(rb_s + rb_p) * carrier_rate + rb_p * planet_rate)
        x_r = 1e3 * ((rb_p - rb_r) * carrier - rb_p * planet)
        v_r = 1e3 * ((rb_p - rb_r) * carrier_rate - rb_p * planet_rate)
        f_s = mesh_contact(mesh + phases[0][i], sizes[5], x_s, v_s, law, sun_mesh, slopes[i])
        f_r = 0.0
        if rb_r > 0.0:  # a pair has no ring
            f_r = mesh_contact(mesh + phases[1][i], sizes[5], x_r, v_r, law, ring_mesh, slopes[n + i])
        forces[i], forces[n + i] = f_s, f_r
        torque_carrier += f_s * (rb_s + rb_p) + f_r * (rb_r - rb_p)
        torque_sun += f_s * rb_s
        change[1 + i] = planet_rate
        change[n + 2 + i] = (f_r - f_s) * rb_p / sizes[4]
    change[0] = carrier_rate
    change[n + 1] = (torque_carrier - load) / sizes[3]
    forces[2 * n] = torque_sun


@compiled
def time_slope(n, sizes, slopes, slope):
    """Derivative of the rates by time alone."""
    rb_s, rb_p, rb_r = sizes[0], sizes[1], sizes[2]
    for k in range(len(slope)):
        slope[k] = 0.0
    for i in range(n):
        f_s, f_r = slopes[i][2], slopes[n + i][2]
        slope[n + 1] += (f_s * (rb_s + rb_p) + f_r * (rb_r - rb_p)) / sizes[3]
        slope[n + 2 + i] = (f_r - f_s) * rb_p / sizes[4]


@compiled
def factor(n, sizes, slopes, span, matrix):
    """Inertia / span + damping + span stiffness, eliminated planet by planet: only the carrier meets them all.

    Rows of `matrix`: diagonal and coupling to the carrier of each planet; the last diagonal is the carrier's.
    """
    rb_s, rb_p, rb_r = sizes[0], sizes[1], sizes[2]
    carrier = sizes[3] / span
    for i in range(n):
        sun = 1e3 * (slopes[i][1] + span * slopes[i][0])
        ring = 1e3 * (slopes[n + i][1] + span * slopes[n + i][0])
        own = sizes[4] / span + (sun + ring) * rb_p**2
        coupling = (-sun * (rb_s + rb_p) + ring * (rb_r - rb_p)) * rb_p
        carrier += sun * (rb_s + rb_p) ** 2 + ring * (rb_r - rb_p) ** 2 - coupling**2 / own
        matrix[0][i], matrix[1][i] = own, coupling
    matrix[0][n] = carrier


@compiled
def solve(n, sizes, slopes, span, matrix, right):
    """Solve (1/span - J) u = right in place."""
    rb_s, rb_p, rb_r = sizes[0], sizes[1], sizes[2]
    a_s, a_r = -(rb_s + rb_p), rb_p - rb_r
    # The angles follow from the rates: u_angle = span (right_angle + u_rate).
    carrier = sizes[3] * right[n + 1]
    for i in range(n):
        sun = 1e3 * span * slopes[i][0] * (a_s * right[0] + rb_p * right[1 + i])
        ring = 1e3 * span * slopes[n + i][0] * (a_r * right[0] - rb_p * right[1 + i])
        planet = sizes[4] * right[n + 2 + i] - (sun - ring) * rb_p
        carrier -= sun * a_s + ring * a_r + planet * matrix[1][i] / matrix[0][i]
        right[n + 2 + i] = planet
    carrier /= matrix[0][n]
    right[n + 1] = carrier
    right[0] = span * (right[0] + carrier)
    for i in range(n):
        planet = (right[n + 2 + i] - matrix[1][i] * carrier) / matrix[0][i]
        right[n + 2 + i] = planet
        right[1 + i] = span * (right[1 + i] + planet)


def advance(steps, every, dt, start, planets, sizes, law, sun_mesh, ring_mesh, phases, load, state, out):
    """Integrate and store every so many steps.

    Unknowns are the small angles of carrier and planets beside the steady rotation, and their rates.

    Parameters
    ----------
    steps, every : int
    dt, start : float
        Step and the time of the first one, s.
    planets : int
    sizes : array
        Base radii of sun, planet, ring (m), inertia of carrier with its planets' masses, of a planet (kg m^2);
        mesh frequency (Hz).
    law : array
        K (N/mm^e), e, C (N s/mm), depth (mm), backlash (mm).
    sun_mesh, ring_mesh : arrays
        Base pitch (mm), contact ratio, gap coefficients before and after contact (1/mm).
    phases : array (2, planets)
    load : float
        Torque on the carrier, N m.
    state : array
        Carrier angle, planet angles, their rates; changed in place.
    out : array (stored, 2 planets + 2)
        Forces of sun meshes, of ring meshes, carrier angle, torque of the sun.
    """
    n, size = planets, len(state)
    moving = _numbers(state)
    given = (sizes, law, sun_mesh, ring_mesh, phases)
    contacts = (2 * n, SLOPES)
    work = (size, size, size, (len(_M), size), 2 * n + 1, 2 * n + 1, contacts, contacts, (2, n + 1))
    zeros = (_numbers(np.zeros(shape)) for shape in work)
    _advance(steps, every, dt, start, n, *map(_numbers, given), load, moving, out, *zeros)
    state[:] = moving


@compiled
def _advance(
    steps, every, dt, start, n, sizes, law, sun_mesh, ring_mesh, phases, load, state, out,
    change, slope, trial, u, forces, unused, slopes, other, matrix,
):  # fmt: skip
    size, stages, span = len(state), len(_M), dt * _GAMMA
    row = 0
    for step in range(steps):
        time = start + step * dt
        rates(time, n, sizes, law, sun_mesh, ring_mesh, phases, load, state, change, forces, slopes)
        if step % every == 0:
            for j in range(2 * n):
                out[row][j] = forces[j]
            out[row][2 * n], out[row][2 * n + 1] = state[0], forces[2 * n]
            row += 1
        time_slope(n, sizes, slopes, slope)
        factor(n, sizes, slopes, span, matrix)
        for i in range(stages):
            if i > 0:
                for j in range(size):
                    value = state[j]
                    for k in range(i):
                        value += _A[i][k] * u[k][j]
                    trial[j] = value
                rates(
                    time + _ALPHA_I[i] * dt, n, sizes, law, sun_mesh, ring_mesh, phases, load,
                    trial, change, unused, other,
                )  # fmt: skip
            for j in range(size):
                value = change[j] + dt * _GAMMA_I[i] * slope[j]
                for k in range(i):
                    value += _C[i][k] / dt * u[k][j]
                u[i][j] = value
            solve(n, sizes, slopes, span, matrix, u[i])
        for j in range(size):
            value = state[j]
            for i in range(stages):
                value += _M[i] * u[i][j]
            state[j] = value
