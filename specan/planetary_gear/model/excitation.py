"""What the meshes do of themselves: deflection that changes with the pairs in contact, errors of the teeth."""

import numpy as np

from specan.models.quantity import quantity

PHASES = 128  # places within a pitch at which the deflection is solved
_NEWTON, _EXACT = 30, 1e-12  # steps at most, and the part of the load that may be missing before the last


@quantity(unit="1")
def angles(sun_error, ring_error, sun_softness, torque_ripple, friction_share, repeat_turns):
    """Number of angles that are followed: those of the fewest turns of the carrier with which everything repeats."""
    whole = sun_error.shape[-1]
    courses = (sun_error, ring_error, sun_softness, torque_ripple, friction_share)
    errors = [course for course in courses if np.any(course)]
    each = [whole // repeat_turns * turns for turns in range(1, repeat_turns) if repeat_turns % turns == 0]
    return next((n for n in each if all(_repeats(error, n) for error in errors)), whole)


def _repeats(course, period):
    """Whether a course over the angle has a period of so many samples; rounding of the angle counts for nothing."""
    rounding = 1e-9 * np.max(np.abs(course))
    return bool(np.max(np.abs(course[..., period:] - course[..., :-period]), initial=0.0) <= rounding)


def _pairs(phase, meshes, relief):
    """Gap of each pair of teeth at phases of a pitch, m, (meshes, pairs, phases)."""
    place = phase[None, :] + np.arange(-1, np.ceil(meshes[:, 1].max()) + 1)[:, None]
    gaps = []
    for pitch, ratio, before, after in meshes:
        early, late = np.clip(-place, 0, None) * pitch, np.clip(place - ratio, 0, None) * pitch
        # Relief takes material off the tips, linearly over the parts where two pairs share the load.
        double = max(ratio - 1.0, 0.2)
        near = np.clip(1 - place / double, 0, 1) + np.clip(1 - (ratio - place) / double, 0, 1)
        gaps.append(before * early**2 + after * late**2 + relief * np.clip(near, 0, 1))
    return np.stack(gaps)


@quantity(unit="m", axes=("planet",), reference="quasi-static equilibrium of the article's contact law")
def mesh_deflection(planet_load, planet_stiffness, contact_law, mesh_geometry, tip_relief):
    """Approach of the flanks that carries the load, over a pitch, (points, 2, planets, phases)."""
    stiffness, exponent = contact_law[0], contact_law[1]
    gap = _pairs(np.arange(PHASES) / PHASES, mesh_geometry, tip_relief)[:, None]  # mesh, 1, pair, phase
    load = (planet_load / planet_stiffness)[:, None, :, None]
    # From above, where one pair carries all: the force is convex, so that no step passes the root.
    high = (load / stiffness) ** (1 / exponent) + gap.min(axis=2)
    for _ in range(_NEWTON):
        pressed = np.clip(high[..., None, :] - gap, 0, None)
        soft = pressed ** (exponent - 1.0) * (pressed > 0)
        excess = stiffness * np.sum(pressed * soft, axis=-2) - load
        high = high - np.maximum(excess, 0.0) / (exponent * stiffness * np.sum(soft, axis=-2))
        if np.all(excess <= _EXACT * load):
            break
    return high


@quantity(unit="N/m", axes=("planet",))
def mesh_spring(mesh_deflection, planet_stiffness, contact_law, mesh_geometry, tip_relief, stiffness_change):
    """Stiffness of each mesh about its load, over a pitch, (points, 2, planets, phases)."""
    stiffness, exponent = contact_law[0], contact_law[1]
    gap = _pairs(np.arange(PHASES) / PHASES, mesh_geometry, tip_relief)[:, None]
    pressed = np.clip(mesh_deflection[..., None, :] - gap, 0, None)
    slope = exponent * stiffness * np.sum(pressed ** (exponent - 1.0) * (pressed > 0), axis=-2)
    return slope * (1.0 + stiffness_change[None, :, None, None]) * planet_stiffness[None, None, :, None]


@quantity(unit="N*s/m", axes=("planet",))
def mesh_damping(mesh_deflection, contact_law, damping_scale):
    """Mean damping of each mesh by the cubic step of the contact law, (points, 2, planets)."""
    depth = np.clip(mesh_deflection / contact_law[3], 0, 1)
    return contact_law[2] * ((3 - 2 * depth) * depth**2).mean(axis=-1) * damping_scale


@quantity(unit="m", axes=("planet",))
def transmission_error(mesh_deflection, planet_phase, sun_error, ring_error, mesh_waves, angles):
    """Change of each mesh's approach under a steady load, (points, 2, planets, angle).

    Harmonics of the deflection at the mesh's phase, less what errors of the teeth put between the flanks.
    """
    harmonic = np.arange(1, mesh_waves.shape[0] + 1)
    coefficient = np.fft.rfft(mesh_deflection, axis=-1)[..., harmonic] * (2.0 / PHASES)
    turned = coefficient * np.exp(2j * np.pi * harmonic * planet_phase[..., None])
    waves = mesh_waves[:, :angles]
    found = turned.real @ waves.real - turned.imag @ waves.imag
    return found - np.stack([sun_error, ring_error])[None, ..., :angles]
