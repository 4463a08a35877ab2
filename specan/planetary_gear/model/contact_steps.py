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
def rates(time, machine, state, change, forces, slopes):
    """Derivative of the state; the forces of the meshes and the derivatives of their contacts, see `mesh_contact`."""
    frequency, law, torque, inertia, body, lever, phases, meshes = machine
    n = len(inertia)
    for k in range(n):
        change[k], change[n + k] = state[n + k], torque[k]
    for i in range(len(body)):
        k, a, b = body[i], lever[i][0], lever[i][1]
        # Approach of the flanks along the line of action, mm: what is beside the steady rotation.
        x, v = 1e3 * (a * state[0] + b * state[k]), 1e3 * (a * state[n] + b * state[n + k])
        force = mesh_contact(frequency * time + phases[i], frequency, x, v, law, meshes[i], slopes[i])
        change[n] -= a * force
        change[n + k] -= b * force
        forces[i] = force
    for k in range(n):
        change[n + k] /= inertia[k]


@compiled
def time_slope(inertia, body, lever, slopes, slope):
    """Derivative of the rates by time alone."""
    n = len(inertia)
    for k in range(len(slope)):
        slope[k] = 0.0
    for i in range(len(body)):
        slope[n] -= lever[i][0] * slopes[i][2] / inertia[0]
        slope[n + body[i]] -= lever[i][1] * slopes[i][2] / inertia[body[i]]


@compiled
def factor(inertia, body, lever, slopes, span, matrix):
    """Inertia / span + damping + span stiffness, eliminated body by body: only the first meets them all.

    Rows of `matrix`: diagonal, and coupling to the first body.
    """
    for k in range(len(inertia)):
        matrix[0][k], matrix[1][k] = inertia[k] / span, 0.0
    for i in range(len(body)):
        k, a, b = body[i], lever[i][0], lever[i][1]
        both = 1e3 * (slopes[i][1] + span * slopes[i][0])
        matrix[0][0] += both * a * a
        matrix[0][k] += both * b * b
        matrix[1][k] += both * a * b
    for k in range(1, len(inertia)):
        matrix[0][0] -= matrix[1][k] ** 2 / matrix[0][k]


@compiled
def solve(inertia, body, lever, slopes, span, matrix, right):
    """Solve (1/span - J) u = right in place."""
    n = len(inertia)
    for k in range(n):
        right[n + k] *= inertia[k]
    # The angles follow from the rates: u_angle = span (right_angle + u_rate).
    for i in range(len(body)):
        k, a, b = body[i], lever[i][0], lever[i][1]
        spring = 1e3 * span * slopes[i][0] * (a * right[0] + b * right[k])
        right[n] -= spring * a
        right[n + k] -= spring * b
    for k in range(1, n):
        right[n] -= right[n + k] * matrix[1][k] / matrix[0][k]
    right[n] /= matrix[0][0]
    for k in range(n):
        if k > 0:
            right[n + k] = (right[n + k] - matrix[1][k] * right[n]) / matrix[0][k]
        right[k] = span * (right[k] + right[n + k])


def advance(steps, every, dt, start, machine, state, out):
    """Integrate and store every so many steps.

    Unknowns are the small angles of bodies beside the steady rotation, and their rates. A mesh lies between the first
    body and one of the others, or the first and the driver.

    Parameters
    ----------
    steps, every : int
    dt, start : float
        Step and the time of the first one, s.
    machine : tuple
        Mesh frequency (Hz); contact law: K (N/mm^e), e, C (N s/mm), depth (mm), backlash (mm); torques on the bodies
        (N m) and their inertias (kg m^2); and of each mesh the number of its other body (the first itself: none), the
        approach by a turn of the first and of the other (m), its phase, and base pitch (mm), contact ratio, gap
        coefficients before and after contact (1/mm).
    state : array
        Angles of the bodies, their rates; changed in place.
    out : array (stored, meshes + 1)
        Forces of the meshes, and the first angle.
    """
    frequency, law, torque, inertia, body, *given = machine
    numbers = body if HAS_NUMBA else body.tolist()
    own = (frequency, *map(_numbers, (law, torque, inertia)), numbers, *map(_numbers, given))
    n, m, moving = len(inertia), len(body), _numbers(state)
    sizes = (2 * n, 2 * n, 2 * n, (len(_M), 2 * n), m, m, (m, SLOPES), (m, SLOPES), (2, n))
    _advance(steps, every, dt, start, own, moving, out, tuple(_numbers(np.zeros(size)) for size in sizes))
    state[:] = moving


@compiled
def _advance(steps, every, dt, start, machine, state, out, work):
    change, slope, trial, u, forces, unused, slopes, other, matrix = work
    _, _, _, inertia, body, lever, _, _ = machine
    size, stages, span, row = len(state), len(_M), dt * _GAMMA, 0
    for step in range(steps):
        time = start + step * dt
        rates(time, machine, state, change, forces, slopes)
        if step % every == 0:
            for j in range(len(forces)):
                out[row][j] = forces[j]
            out[row][len(forces)] = state[0]
            row += 1
        time_slope(inertia, body, lever, slopes, slope)
        factor(inertia, body, lever, slopes, span, matrix)
        for i in range(stages):
            if i > 0:
                for j in range(size):
                    value = state[j]
                    for k in range(i):
                        value += _A[i][k] * u[k][j]
                    trial[j] = value
                rates(time + _ALPHA_I[i] * dt, machine, trial, change, unused, other)
            for j in range(size):
                value = change[j] + dt * _GAMMA_I[i] * slope[j]
                for k in range(i):
                    value += _C[i][k] / dt * u[k][j]
                u[i][j] = value
            solve(inertia, body, lever, slopes, span, matrix, u[i])
        for j in range(size):
            value = state[j]
            for i in range(stages):
                value += _M[i] * u[i][j]
            state[j] = value
