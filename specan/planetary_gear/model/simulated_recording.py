"""What the instruments on the test rig would record of a simulated run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from specan.arrays import Complex, Real
from specan.models.chosen_model import SimulatedChannel
from specan.planetary_gear.model.geometry import planet_angles
from specan.planetary_gear.model.kinematics import carrier_speed_ratio
from specan.planetary_gear.model.rig import Rig

if TYPE_CHECKING:
    from specan.planetary_gear.model.dynamics import Motion


# N/m: radial stiffness of the ring's rim below a planet, of the order of that of its housing.
RIM_STIFFNESS = 1.0e9
TACHO_V = 5.0
SHORT = 0.1  # part of a turn that a pulse lasts where there is one a turn; half of a pulse's pitch otherwise
# Second derivative by central differences of the eighth order (Fornberg, Math. Comp. 51 (1988) 699, table 1).
_SECOND = np.array([-1 / 560, 8 / 315, -1 / 5, 8 / 5, -205 / 72, 8 / 5, -1 / 5, 8 / 315, -1 / 560])


def recorded_channels(motion: Motion, sampling_rate: float) -> list[SimulatedChannel]:
    """Forces, torques, places of the planets, accelerations, tachos; a pair has forces, torques and tachos."""
    from specan.planetary_gear.model.dynamics import force_normal_angle

    rig = motion.rig
    sensors = rig.sensors
    force, torque = sensors.force_N_per_V, sensors.torque_Nm_per_V
    on_sun, on_ring = force_normal_angle(rig, motion)
    driver = "driver" if rig.gear is None else "sun"
    given = SimulatedChannel(f"Torque {driver}", "Nm", motion.torque_in, torque, "Nm/V")
    turns = tacho_channel(f"Tacho {driver}", motion.sun_angle, sensors.tacho_sun_pulses)
    if rig.gear is None:
        return [*_forces(["Mesh"], motion.sun_force, on_sun, 50 * force), given, turns]
    sun, planet, ring = rig.gear.base_radii_m
    on_carrier = (sun + planet) * motion.sun_force.sum(axis=0)
    on_carrier += (ring - planet) * motion.ring_force.sum(axis=0)
    numbers = range(1, rig.gear.planets + 1)
    return [
        *_forces([f"Sun-planet {i}" for i in numbers], motion.sun_force, on_sun, force),
        *_forces([f"Ring-planet {i}" for i in numbers], motion.ring_force, on_ring, force),
        given,
        SimulatedChannel("Torque carrier", "Nm", on_carrier, torque, "Nm/V"),
        *_centres(motion, rig),
        *_accelerations(motion, rig, sampling_rate),
        turns,
        tacho_channel("Tacho carrier", motion.carrier_angle, sensors.tacho_carrier_pulses),
    ]


def _forces(meshes: Sequence[str], forces: Real, angle: Real, per_volt: float) -> list[SimulatedChannel]:
    found = []
    for i, mesh in enumerate(meshes):
        name = f"{mesh} force"
        found.append(SimulatedChannel(f"{name} normal", "N", forces[i], per_volt, "N/V"))
        found.append(SimulatedChannel(f"{name} vertical", "N", forces[i] * np.sin(angle[i]), per_volt, "N/V"))
    return found


def planet_centres(motion: Motion) -> list[tuple[Real, Real]]:
    """x and y of each planet's centre, m."""
    gear = motion.rig.gear
    assert gear is not None
    angles = [motion.carrier_angle + place for place in planet_angles(gear)]
    return [(gear.pin_distance_m * np.cos(angle), gear.pin_distance_m * np.sin(angle)) for angle in angles]


def _centres(motion: Motion, rig: Rig) -> list[SimulatedChannel]:
    per_volt = rig.sensors.displacement_mm_per_V
    return [
        SimulatedChannel(f"Planet {i} {axis}", "m", samples, per_volt, "mm/V")
        for i, centre in enumerate(planet_centres(motion), 1)
        for axis, samples in zip("xy", centre, strict=True)
    ]


def path_window(angle: Real) -> Real:
    """Weight with which a planet at an angle from a sensor is heard: the third power of a Hann window around the ring.

    Inalpolat and Kahraman (J. Sound Vib. 323 (2009) 677) take a Hann window; its third power is heard over a third of a
    turn and has the lines 3 orders beside the mesh that recordings of such sets show. The power is an assumption, the
    effect transmission-path changes it.
    """
    hann = 0.5 + 0.5 * np.cos(angle)
    return hann * hann * hann  # ten times as fast as a power


def _accelerations(motion: Motion, rig: Rig, sampling_rate: float) -> list[SimulatedChannel]:
    """The rim gives way to the planets' forces as a spring; the sensor sees the second derivative of that."""
    gear = rig.gear
    assert gear is not None
    found = []
    for k, degrees in enumerate(rig.sensors.acc_angle_deg):
        pressed = np.zeros(motion.time.size)
        for i, place in enumerate(planet_angles(gear)):
            weight = path_window(motion.carrier_angle + place - math.radians(degrees))
            pressed += weight * motion.ring_force[i]
        inside = np.convolve(pressed, _SECOND, mode="valid") * sampling_rate**2 / RIM_STIFFNESS
        found.append(_acceleration(k, np.pad(inside, 4, mode="edge"), rig))
    return found


def _acceleration(number: int, samples: Real, rig: Rig) -> SimulatedChannel:
    where: dict[str, object] = {"Angle_deg": rig.sensors.acc_angle_deg[number]}
    per_volt = rig.sensors.acc_mV_per_m_s2
    return SimulatedChannel(f"Acc {number + 1}", "m/s^2", samples, per_volt, "mV/(m/s^2)", where)


def channels_of_lines(
    rig: Rig, orders: Real, lines: Complex, count: int, rate: float
) -> list[SimulatedChannel]:
    """Accelerations made of order lines (sensors, orders), and tachos, at the constant speed of the rig file."""
    assert rig.gear is not None
    ratio = carrier_speed_ratio(rig.gear)
    sun = 2 * np.pi * rig.operation.sun_speed_hz * np.arange(count) / rate
    heard = np.zeros((len(lines), count))
    for order, amplitude in zip(orders, lines.T, strict=True):
        heard += (amplitude[:, None] * np.exp(1j * order * ratio * sun)).real
    return [
        *(_acceleration(k, samples, rig) for k, samples in enumerate(heard)),
        tacho_channel("Tacho sun", sun, rig.sensors.tacho_sun_pulses),
        tacho_channel("Tacho carrier", ratio * sun, rig.sensors.tacho_carrier_pulses),
    ]


def tacho_channel(name: str, angle: NDArray[np.floating], pulses: int) -> SimulatedChannel:
    """Rectangular pulses with edges of one sample, so that their instants are known between samples."""
    phase = angle / (2 * np.pi) * pulses
    step = np.gradient(phase)
    inside = phase % 1.0
    duty = SHORT if pulses == 1 else 0.5
    before = inside < 0.5 + duty / 2  # nearer to the edges of this pulse than to the beginning of the next
    rise = np.clip(np.where(before, inside, inside - 1.0) / step + 0.5, 0.0, 1.0)
    fall = np.clip((inside - duty) / step + 0.5, 0.0, 1.0)
    volts = TACHO_V * np.where(before, rise - fall, rise)
    return SimulatedChannel(name, "V", volts, 1.0, "V/V", {"PulsesPerRevolution": pulses})
