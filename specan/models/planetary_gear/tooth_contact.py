"""Forces of teeth in contact, and how they change with approach, its rate and time.

Plain loops over floats: the file is compiled where numba is present. Lengths in mm and forces in N, as the constants
of the contact law are given.
"""

from __future__ import annotations

import numpy as np

from specan.models.planetary_gear.compiled import compiled

SLOPES = 8  # that mesh_contact gives


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
        Is filled with the derivatives of the force by x, v and time, of the power lost by the same, and of the power of
        the change of contact by x and time.

    Returns
    -------
    force, lost, changed, stored : float
        Force, N; power lost and power of the change of contact, W; energy held, J.
    """
    base = phase - np.floor(phase)
    force, lost, changed, stored = 0.0, 0.0, 0.0, 0.0
    slopes[:] = 0.0
    speed = mesh[0] * frequency
    for j in range(-1, 4):
        place = base + j
        gap, opening, widening = 0.0, 0.0, 0.0  # of the flanks, its first and second derivative
        if place < 0.0:
            u = -place * mesh[0]
            gap, opening, widening = mesh[2] * u * u, -2.0 * mesh[2] * u * speed, 2.0 * mesh[2] * speed**2
        elif place > mesh[1]:
            u = (place - mesh[1]) * mesh[0]
            gap, opening, widening = mesh[3] * u * u, 2.0 * mesh[3] * u * speed, 2.0 * mesh[3] * speed**2
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
        lost += 1e-3 * c * v * v
        changed += 1e-3 * f * opening
        stored += 1e-3 * f * depth / (law[1] + 1.0)
        slopes[0] += stiffness + side * rise * v
        slopes[1] += c
        slopes[2] -= opening * (side * stiffness + rise * v)
        slopes[3] += 1e-3 * side * rise * v * v
        slopes[4] += 2e-3 * c * v
        slopes[5] -= 1e-3 * opening * rise * v * v
        slopes[6] += 1e-3 * side * stiffness * opening
        slopes[7] += 1e-3 * (f * widening - stiffness * opening * opening)
    return force, lost, changed, stored
