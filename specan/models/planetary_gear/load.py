"""Operating points, and what each planet carries."""

import numpy as np

from specan.models.quantity import quantity


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
def mean_load(operating_points, planet_count, base_radii):
    """Force of each mesh where all planets carry the same, one an operating point."""
    return operating_points[:, 1] / (planet_count * (base_radii[0] + base_radii[2]))


@quantity(unit="N", axes=("planet",), reference="springs between rigid carrier, sun and ring, one a planet")
def planet_load(mean_load, load_share, planet_position, load_stiffness, pressure_cosine):
    """Force that each planet passes on, (operating points, planets).

    Sun and ring push a planet forward, its pin holds it back. A pin that lies e ahead gives way: its planet carries
    less by k cos(a) e, the others more.
    """
    share = load_share / np.mean(load_share)
    ahead = planet_position - np.mean(planet_position)
    found = mean_load[:, None] * share - load_stiffness[:, None] * pressure_cosine * ahead
    return np.maximum(found, 0.02 * mean_load[:, None])  # a planet is hardly ever without load


@quantity(unit="N/m")
def load_stiffness(mean_load, contact_law):
    """Stiffness of one pair of teeth at the mean load, one an operating point."""
    stiffness, exponent = contact_law[0], contact_law[1]
    return exponent * stiffness ** (1 / exponent) * mean_load ** (1 - 1 / exponent)


@quantity(unit="1", axes=("planet",), reference="Parker and Lin, J. Mech. Des. 126 (2004) 365")
def planet_phase(nominal_phase, planet_position, centre_distance, ring_teeth, sun_teeth):
    """Phases of the sun and the ring meshes in pitches, (2, planets)."""
    turn = planet_position / centre_distance / (2 * np.pi)
    return nominal_phase + np.stack([-sun_teeth * turn, ring_teeth * turn])


QUANTITIES = (operating_points, point_of_line, mean_load, load_stiffness, planet_load, planet_phase)
