"""Operating points, and what each planet carries."""

import numpy as np

from specan.models.quantity import quantity

LEAST_LOAD = 0.02  # of the mean load: friction and inertia keep teeth touching


@quantity(unit="1")
def operating_points(sun_speed, carrier_torque, order):
    """Speeds and torques that occur, a row each (Hz, N m)."""
    speed, torque, _ = np.broadcast_arrays(sun_speed, carrier_torque, order)
    return np.unique(np.stack([speed, torque], axis=-1).reshape(-1, 2), axis=0)


@quantity(unit="1")
def point_of_line(sun_speed, carrier_torque, order, operating_points):
    """Number of the operating point of each line."""
    speed, torque, _ = np.broadcast_arrays(sun_speed, carrier_torque, order)
    given = np.stack([speed, torque], axis=-1).reshape(-1, 2)
    same = np.all(given[:, None, :] == operating_points[None, :, :], axis=-1)
    return np.argmax(same, axis=1)


@quantity(unit="N", reference="balance of moments on carrier and planets")
def mean_load(operating_points, planet_angle, base_radii):
    """Force of each mesh where all planets carry the same, one an operating point."""
    return operating_points[:, 1] / (planet_angle.size * (base_radii[0] + base_radii[2]))


@quantity(unit="N/m")
def load_stiffness(mean_load, contact_law, mesh_geometry):
    """Stiffness of a planet's two meshes against its pin at the mean load, one an operating point.

    On average as many pairs share the load as the contact ratio says, and n pairs are n^(1/e) times as stiff as one.
    Sun and ring mesh are in series, and a pin that moves by e changes the approach of both by e cos(a): twice the
    stiffness in series.
    """
    stiffness, exponent = contact_law[0], contact_law[1]
    pair = exponent * stiffness ** (1 / exponent) * mean_load ** (1 - 1 / exponent)
    return pair * 2.0 / np.sum(mesh_geometry[:, 1] ** (-1 / exponent))


@quantity(unit="1", axes=("planet",))
def planet_stiffness(load_share):
    """Stiffness of each planet's meshes over the mean of all: who is stiffer carries more, at every torque."""
    return load_share / np.mean(load_share)


@quantity(unit="N", axes=("planet",), reference="springs between rigid carrier, sun and ring, one per planet")
def planet_load(mean_load, planet_stiffness, planet_position, load_stiffness, pressure_cosine):
    """Force that each planet passes on, (operating points, planets).

    Sun and ring push a planet forward, its pin holds it back. A pin that lies e ahead gives way: its planet carries
    less by k cos(a) e, the others more, so that together they hold the torque. A planet that would be pulled goes
    almost without load.
    """
    spring = load_stiffness[:, None] * planet_stiffness
    given = mean_load[:, None] * planet_stiffness - spring * pressure_cosine * planet_position.T
    least, whole = LEAST_LOAD * mean_load[:, None], given.shape[1] * mean_load[:, None]
    closer = np.zeros_like(whole)  # by how much the carrier turns back
    for _ in range(given.shape[1]):  # each round takes out planets that lift off, at the latest all but one
        carrying = given + spring * closer > least
        missing = whole - np.where(carrying, given + spring * closer, least).sum(axis=1, keepdims=True)
        closer = closer + missing / np.maximum((spring * carrying).sum(axis=1, keepdims=True), spring.min())
    return np.maximum(given + spring * closer, least)


@quantity(unit="1", axes=("planet",), reference="Parker and Lin, J. Mech. Des. 126 (2004) 365")
def planet_phase(nominal_phase, planet_position, mean_load, centre_distance, ring_teeth, sun_teeth):
    """Phases of the sun and the ring meshes in pitches, (operating points, 2, planets)."""
    turn = planet_position.T / centre_distance / (2 * np.pi) + np.zeros((mean_load.size, 1))
    return nominal_phase + np.stack([-sun_teeth * turn, ring_teeth * turn], axis=1)
