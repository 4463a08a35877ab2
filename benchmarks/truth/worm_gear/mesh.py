"""The tooth contact: explicit points, relative velocities and force vectors; no closed-form efficiency anywhere."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from truth.worm_gear.gear import (
    AXIAL_PITCH,
    CENTRE_DISTANCE,
    FACE_ANGLE,
    NORMAL_PRESSURE_ANGLE,
    RATIO,
    WORM_RADIUS,
    Array,
)

# x along the worm, y from the worm's axis to the wheel's, z along the wheel's axis, origin on the worm's axis.
_WORM_AXIS = np.array([1.0, 0.0, 0.0])
_WHEEL_AXIS = np.array([0.0, 0.0, 1.0])
_WHEEL_CENTRE = np.array([0.0, CENTRE_DISTANCE, 0.0])


@dataclass(frozen=True)
class ContactPoints:
    """Points of the contact with their share of the load; vectors of shape (points, 3), per rad/s of the worm."""

    position: Array
    share: Array
    sliding_speed: Array
    sliding: Array
    normal: Array


@cache
def contact_points() -> ContactPoints:
    """Points on the worm's pitch cylinder under the wheel's rim, two teeth in mesh.

    The flank normal is taken perpendicular to the relative velocity (the law of conjugate flanks), inclined by
    the normal pressure angle.
    """
    nodes, weights = np.polynomial.legendre.leggauss(7)
    angle = np.concatenate([nodes, nodes]) * FACE_ANGLE
    share = np.concatenate([weights, weights]) / (2.0 * weights.sum())
    radial = np.stack([0.0 * angle, np.cos(angle), np.sin(angle)], axis=1)
    position = WORM_RADIUS * radial
    position[:, 0] = np.repeat([-AXIAL_PITCH / 4.0, AXIAL_PITCH / 4.0], nodes.size)
    worm = np.cross(_WORM_AXIS, position)
    wheel = np.cross(_WHEEL_AXIS / RATIO, position - _WHEEL_CENTRE)
    relative = worm - wheel
    speed = np.linalg.norm(relative, axis=1)
    sliding = relative / speed[:, None]
    outward = radial - np.sum(radial * sliding, axis=1, keepdims=True) * sliding
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    along = np.cross(outward, sliding)
    normal = np.cos(NORMAL_PRESSURE_ANGLE) * along + np.sin(NORMAL_PRESSURE_ANGLE) * outward
    return ContactPoints(position, share, speed, sliding, normal)


@dataclass(frozen=True)
class MeshForces:
    """What the contact does under a load; arrays over the conditions."""

    normal_force: Array
    worm_torque: Array
    power: Array
    force: Array  # on the wheel, (conditions, points, 3), N


def forces(wheel_torque: Array, speed: Array, friction: Array) -> MeshForces:
    """Forces between worm and wheel that carry `wheel_torque`, friction along the local sliding velocity.

    Parameters
    ----------
    wheel_torque : array, shape (conditions,)
        Torque that the wheel's rim must give, Nm.
    speed : array, shape (conditions,)
        Of the worm, rad/s.
    friction : array, shape (conditions, points)
        Local friction coefficient.

    Returns
    -------
    MeshForces
        Total normal force (N), torque that the worm needs (Nm), heat made by sliding (W), forces at the points.
    """
    points = contact_points()
    direction = points.normal + friction[..., None] * points.sliding
    lever = np.cross(points.position - _WHEEL_CENTRE, direction) @ _WHEEL_AXIS
    normal_force = wheel_torque / np.sum(points.share * lever, axis=1)
    local = normal_force[:, None] * points.share
    force = local[..., None] * direction
    worm_torque = np.sum(np.cross(points.position, force) @ _WORM_AXIS, axis=1)
    power = np.sum(local * friction * points.sliding_speed, axis=1) * speed
    return MeshForces(normal_force, worm_torque, power, force)


def shaft_loads(
    mesh: MeshForces, shaft: str, near: float, far: float, weight: float = 0.0
) -> tuple[Array, Array, Array]:
    """Axial load and the radial loads of the two bearings of a shaft, N, from the balance of forces and moments.

    Parameters
    ----------
    mesh : MeshForces
        Loads at the contact points.
    shaft : {"worm", "wheel"}
        Which one.
    near, far : float
        Bearing positions along the shaft from the mesh plane, m.
    weight : float
        Of the shaft, in the middle between its bearings, N; the worm lies below the wheel.
    """
    points = contact_points()
    if shaft == "worm":
        force, axis, arm = -mesh.force, 0, points.position
    else:
        force, axis, arm = mesh.force, 2, points.position - _WHEEL_CENTRE
    axial = np.sum(force[..., axis], axis=1)
    others = [i for i in range(3) if i != axis]
    total = np.stack([np.sum(force[..., i], axis=1) for i in others], axis=1)
    # Moment about the near bearing of what acts across the shaft, and of the axial force at its radius.
    moment = np.stack(
        [
            np.sum((arm[:, axis] - near) * force[..., i] - arm[:, i] * force[..., axis], axis=1)
            for i in others
        ],
        axis=1,
    )
    at_far = -moment / (far - near)
    at_near = -total - at_far
    down = others.index(1)
    at_near[:, down] += weight / 2.0
    at_far[:, down] += weight / 2.0
    return np.abs(axial), np.linalg.norm(at_near, axis=1), np.linalg.norm(at_far, axis=1)
