"""Two masses with a small tuned one on the second, driven at the first: states stepped in time.

Nothing here knows a transfer function: the equations of motion are a state-space system, stepped exactly between
samples of a force that is linear there, at a rate far above the analysed band; force and displacements are then
decimated and read with noise.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]

OVER = 32  # internal steps a sample: between them the force is linear, which costs it 0.003 dB at 80 Hz


@dataclass(frozen=True)
class ThreeMasses:
    """Masses in kg, stiffnesses in N/m, dampings in N s/m; the third is tuned in Hz and damped by a loss ratio."""

    masses: tuple[float, float] = (2.05, 0.98)
    stiffnesses: tuple[float, float] = (4.3e4, 4.6e4)
    dampings: tuple[float, float] = (7.0, 5.0)
    tuned_mass: float = 0.06
    tuned_hz: float = 33.0
    tuned_loss: float = 0.02

    def matrices(self) -> tuple[Real, Real, Real]:
        """Mass, damping and stiffness matrix."""
        omega = 2 * np.pi * self.tuned_hz
        spring, damper = self.tuned_mass * omega**2, 2 * self.tuned_loss * self.tuned_mass * omega
        mass = np.diag([*self.masses, self.tuned_mass])
        return mass, _chain(*self.dampings, damper), _chain(*self.stiffnesses, spring)

    def modes_hz(self) -> Real:
        """Natural frequencies without damping."""
        mass, _, stiffness = self.matrices()
        return np.sqrt(np.sort(np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real)) / (2 * np.pi)


def _chain(first: float, second: float, third: float) -> Real:
    """Ground, first, second, third mass, one behind the other."""
    return np.array([[first + second, -second, 0], [-second, second + third, -third], [0, -third, third]])


def simulate(
    system: ThreeMasses,
    seconds: float = 40.0,
    rate: float = 256.0,
    noise: float = 0.01,
    force_rms: float = 3.0,
    seed: int = 0,
) -> Mapping[str, Real]:
    """Force (N) and displacements x1 and x2 (m) as they are recorded.

    Parameters
    ----------
    noise : float
        Of each displacement's reading, as a part of its RMS.
    force_rms : float
        N, about; white up to 100 Hz.
    """
    from scipy.linalg import expm
    from scipy.signal import butter, decimate, lfilter, sosfilt

    random, steps = np.random.default_rng(seed), int(seconds * rate * OVER)
    dt = 1 / (rate * OVER)
    white = random.standard_normal(steps) * np.sqrt(rate * OVER / 200)
    force = force_rms * sosfilt(butter(4, 100, fs=rate * OVER, output="sos"), white)
    mass, damping, stiffness = system.matrices()
    inverse = np.linalg.inv(mass)
    whole = np.zeros((8, 8))  # state, force, slope of the force
    whole[:3, 3:6] = np.eye(3)
    whole[3:6, :3], whole[3:6, 3:6] = -inverse @ stiffness, -inverse @ damping
    whole[3, 6] = inverse[0, 0]
    whole[6, 7] = 1 / dt
    step = expm(whole * dt)
    value, vector = np.linalg.eig(step[:6, :6])
    at_once, on_the_way = np.linalg.solve(vector, step[:6, 6]), np.linalg.solve(vector, step[:6, 7])
    rises = np.append(np.diff(force), 0.0)
    states = np.zeros((6, steps), dtype=complex)
    for k in range(6):
        driven = at_once[k] * force + on_the_way[k] * rises
        states[k, 1:] = lfilter([1.0], [1.0, -value[k]], driven[:-1])
    moved = (vector[:2] @ states).real
    force, moved = decimate(force, OVER, ftype="fir"), decimate(moved, OVER, ftype="fir", axis=1)
    moved = moved + noise * moved.std(axis=1, keepdims=True) * random.standard_normal(moved.shape)
    return {"force": force, "x1": moved[0], "x2": moved[1]}


def as_text(recorded: Mapping[str, Real], rate: float = 256.0) -> str:
    """The recording as a logger writes it: CSV, displacements in micrometres."""
    lines = ["time [s],force [N],x1 [um],x2 [um]"]
    columns = zip(recorded["force"], 1e6 * recorded["x1"], 1e6 * recorded["x2"], strict=True)
    lines += [f"{k / rate:.8g},{f:.5g},{a:.5g},{b:.5g}" for k, (f, a, b) in enumerate(columns)]
    return "\n".join(lines) + "\n"
