"""Recordings of a driven mass, by the classical rule of Runge and Kutta; a library's takes a hundred times as long."""

import numpy as np


def halves(rate, count, parts):
    """Instants at the ends and in the middle of `parts` steps between samples."""
    return np.arange(2 * parts * (count - 1) + 1) / (2 * parts * rate)


def displacement(push, rate, parts, acceleration):
    """Displacement at the samples of a mass at rest; `push` at `halves`, ``acceleration(push, x, v)``."""
    push, step = push.tolist(), 1 / (parts * rate)
    path, x, v = [0.0], 0.0, 0.0
    for n in range(0, len(push) - 1, 2):
        speeds, rises = [v], [acceleration(push[n], x, v)]
        for force, part in ((push[n + 1], step / 2), (push[n + 1], step / 2), (push[n + 2], step)):
            there = x + part * speeds[-1], v + part * rises[-1]
            speeds.append(there[1])
            rises.append(acceleration(force, *there))
        x += step * (speeds[0] + 2 * speeds[1] + 2 * speeds[2] + speeds[3]) / 6
        v += step * (rises[0] + 2 * rises[1] + 2 * rises[2] + rises[3]) / 6
        path.append(x)
    return np.array(path[::parts])
