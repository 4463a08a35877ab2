"""Equations of motion of gears in contact, integrated in fixed steps (Runge and Kutta, fourth order).

Plain loops over floats: the file is compiled where numba is present. Lengths in mm and forces in N within the contact
law (its constants are given so), SI elsewhere.
"""

from __future__ import annotations

import numpy as np

from specan.models.planetary_gear.compiled import compiled


@compiled
def impact(depth, rate, law):
    """Elastic and damping part of the contact law, equations 3 and 4 of the article."""
    part = depth / law[3]
    share = 1.0 if part >= 1.0 else (3.0 - 2.0 * part) * part * part
    return law[0] * depth ** law[1], law[2] * share * rate


@compiled
def mesh_force(phase, frequency, x, v, law, mesh):
    """Force of all pairs of teeth of a mesh, N; power lost and power of the change of contact, W; energy held, J."""
    base = phase - np.floor(phase)
    force, lost, changed, stored = 0.0, 0.0, 0.0, 0.0
    for j in range(-1, 4):
        place = base + j
        gap, opening = 0.0, 0.0
        if place < 0.0:
            u = -place * mesh[0]
            gap, opening = mesh[2] * u * u, -2.0 * mesh[2] * u * mesh[0] * frequency
        elif place > mesh[1]:
            u = (place - mesh[1]) * mesh[0]
            gap, opening = mesh[3] * u * u, 2.0 * mesh[3] * u * mesh[0] * frequency
        if gap > 1.0:
            continue
        if x - gap > 0.0:
            f, c = impact(x - gap, v, law)
            force += f + c
            lost += 1e-3 * c * v
            changed += 1e-3 * f * opening
            stored += 1e-3 * f * (x - gap) / (law[1] + 1.0)
        elif -x - law[4] - gap > 0.0:  # the other flank
            f, c = impact(-x - law[4] - gap, -v, law)
            force -= f + c
            lost -= 1e-3 * c * v
            changed += 1e-3 * f * opening
            stored += 1e-3 * f * (-x - law[4] - gap) / (law[1] + 1.0)
    return force, lost, changed, stored


@compiled
def rates(time, n, sizes, law, sun_mesh, ring_mesh, phases, sun_speed, load, state, change, forces):
    """Derivative of the state, and the forces."""
    rb_s, rb_p, rb_r = sizes[0], sizes[1], sizes[2]
    carrier, carrier_rate = state[0], state[n + 1]
    torque_carrier, torque_sun, dissipated, changed, stored = 0.0, 0.0, 0.0, 0.0, 0.0
    mesh = sizes[5] * time
    speed_carrier = sizes[6]
    for i in range(n):
        planet, planet_rate = state[1 + i], state[n + 2 + i]
        # Approach of the flanks along the lines of action, mm: what is beside the steady rotation.
        x_s = 1e3 * (-(rb_s + rb_p) * carrier + rb_p * planet)
        v_s = 1e3 * (-(rb_s + rb_p) * carrier_rate + rb_p * planet_rate)
        x_r = 1e3 * ((rb_p - rb_r) * carrier - rb_p * planet)
        v_r = 1e3 * ((rb_p - rb_r) * carrier_rate - rb_p * planet_rate)
        f_s, d_s, c_s, e_s = mesh_force(mesh + phases[0, i], sizes[5], x_s, v_s, law, sun_mesh)
        f_r, d_r, c_r, e_r = mesh_force(mesh + phases[1, i], sizes[5], x_r, v_r, law, ring_mesh)
        forces[i], forces[n + i] = f_s, f_r
        dissipated += d_s + d_r
        changed += c_s + c_r
        stored += e_s + e_r
        torque_carrier += f_s * (rb_s + rb_p) + f_r * (rb_r - rb_p)
        torque_sun += f_s * rb_s
        change[1 + i] = planet_rate
        change[n + 2 + i] = (f_r - f_s) * rb_p / sizes[4]
    change[0] = carrier_rate
    change[n + 1] = (torque_carrier - load) / sizes[3]
    forces[2 * n] = torque_sun
    forces[2 * n + 1] = stored
    change[2 * n + 2] = torque_sun * sun_speed
    change[2 * n + 3] = load * (speed_carrier + carrier_rate)
    change[2 * n + 4] = dissipated
    change[2 * n + 5] = changed


@compiled
def advance(
    steps, every, dt, start, planets, sizes, law, sun_mesh, ring_mesh, phases, sun_speed, load, state, out
):
    """Integrate and store every so many steps.

    Unknowns are the small angles of carrier and planets beside the steady rotation, and their rates; energy that was
    brought in, taken out, dissipated and taken up by the change of contact are integrated with them.

    Parameters
    ----------
    steps, every : int
    dt, start : float
        Step and the time of the first one, s.
    planets : int
    sizes : array
        Base radii of sun, planet, ring (m), inertia of carrier with its planets' masses, of a planet (kg m^2);
        mesh frequency (Hz), steady speed of the carrier (rad/s), driver's base radius (m), planet's speed (rad/s).
    law : array
        K (N/mm^e), e, C (N s/mm), depth (mm), backlash (mm).
    sun_mesh, ring_mesh : arrays
        Base pitch (mm), contact ratio, gap coefficients before and after contact (1/mm).
    phases : array (2, planets)
    sun_speed : float
        Of the sun in the steady state, rad/s.
    load : float
        Torque on the carrier, N m.
    state : array
        Carrier angle, planet angles, their rates, four energies; changed in place.
    out : array (stored, 2 planets + 9)
        Forces of sun meshes, of ring meshes, carrier angle and rate, torque of the sun, six energies.
    """
    n = planets
    size = 2 * (n + 1) + 4
    k1, k2, k3, k4, trial = np.zeros(size), np.zeros(size), np.zeros(size), np.zeros(size), np.zeros(size)
    forces = np.zeros(2 * n + 4)
    row = 0
    for step in range(steps):
        time = start + step * dt
        rates(time, n, sizes, law, sun_mesh, ring_mesh, phases, sun_speed, load, state, k1, forces)
        if step % every == 0:
            for j in range(2 * n):
                out[row, j] = forces[j]
            out[row, 2 * n] = state[0]
            out[row, 2 * n + 1] = state[n + 1]
            out[row, 2 * n + 2] = forces[2 * n]
            for j in range(4):
                out[row, 2 * n + 3 + j] = state[2 * n + 2 + j]
            out[row, 2 * n + 7] = forces[2 * n + 1]
            kinetic = 0.5 * sizes[3] * (sizes[6] + state[n + 1]) ** 2
            for j in range(n):
                kinetic += 0.5 * sizes[4] * (sizes[8] + state[n + 2 + j]) ** 2
            out[row, 2 * n + 8] = kinetic
            row += 1
        for j in range(size):
            trial[j] = state[j] + 0.5 * dt * k1[j]
        rates(time + 0.5 * dt, n, sizes, law, sun_mesh, ring_mesh, phases, sun_speed, load, trial, k2, forces)
        for j in range(size):
            trial[j] = state[j] + 0.5 * dt * k2[j]
        rates(time + 0.5 * dt, n, sizes, law, sun_mesh, ring_mesh, phases, sun_speed, load, trial, k3, forces)
        for j in range(size):
            trial[j] = state[j] + dt * k3[j]
        rates(time + dt, n, sizes, law, sun_mesh, ring_mesh, phases, sun_speed, load, trial, k4, forces)
        for j in range(size):
            state[j] += dt / 6.0 * (k1[j] + 2.0 * k2[j] + 2.0 * k3[j] + k4[j])
