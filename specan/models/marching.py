"""Steps of the solvers over all samples, written so that they can be compiled together with the rates of a model.

Runge-Kutta's classical method, and the L-stable Rosenbrock method of Shampine and Reichelt (1997, SIAM J. Sci. Comput.
18:1). `times` are those of the samples, `steps` how many are taken from one to the next; `drives` holds what the rates
read beside the states, and then its slopes; `p` parameters, `on` which effects act, `s` the states at the start.
`states` is filled.

What goes from step to step are tuples, which a compiler keeps in registers: arrays take five times as long.
"""

import numpy as np

FINEST = 1 / 32  # of the time between two samples, of steps
CORNERS = 30  # halvings between two samples, which come closer than that
STABLE = 0.5  # of Runge-Kutta's 1.4, where it gets unstable
SHARE = 0.002  # of a slope, below which its changes matter to nothing
CLOSE = 1e-5  # of a state, below which its changes in a step matter to nothing


def rates(s, d, p, on):
    """Those of a model take its place."""


def moved(s, h, slope):
    """A straight step; written out for the states of a model."""


def between(drives, i, part):
    """Drives on the cubic between two samples; written out too."""


def stiff(s, h, k1, k2, k3, steps):
    """Whether the second and third slope of a step differ too much for what the first two do; written out too."""


def bent(s, h, k1, k2, k3, k4, steps):
    """Whether slopes change over the second half of a step unlike over the first; written out too."""


def explicit(times, steps, drives, p, on, s, states, path):
    """Runge-Kutta's method; a step is halved where a slope depends on its own state too much for it, or turns a corner.

    Halving closes in on a corner (Hairer, Norsett and Wanner 1993, II.6), after which steps grow again. `path` keeps
    how often steps of the first march were halved, plus one; others take the same: they then differ smoothly from it.
    """
    level = 0
    for i in range(times.size - 1):
        part, j, corners, level, again = 0.0, 0, 0, max(level - 1, 0), path[i, 0] > 0
        while part < 1:
            if again and j < path.shape[1]:
                level = path[i, j] - 1
            share = 1.0 / (steps << level)  # of the time between two samples
            h = (times[i + 1] - times[i]) * share
            k1 = rates(s, between(drives, i, part), p, on)
            d = between(drives, i, part + 0.5 * share)
            k2 = rates(moved(s, 0.5 * h, k1), d, p, on)
            k3 = rates(moved(s, 0.5 * h, k2), d, p, on)
            k4 = rates(moved(s, h, k3), between(drives, i, part + share), p, on)
            slow = stiff(s, h, k1, k2, k3, 0.5 if again else steps)
            corner = not (again or slow) and corners < CORNERS and bent(s, h, k1, k2, k3, k4, steps)
            if corner or (slow and share > FINEST):
                again, level, corners = False, level + 1, corners + corner
                continue
            if j < path.shape[1]:
                path[i, j] = level + 1
            part += share
            j += 1
            s = moved(moved(moved(moved(s, h / 6, k1), h / 3, k2), h / 3, k3), h / 6, k4)
            if not again and level and int(part / share) % 2 == 0 and not stiff(s, h, k1, k2, k3, 2 * steps):
                level -= 1
        for k in range(len(s)):
            states[k, i + 1] = s[k]


def solve(matrix, right):
    """Gauss's elimination with pivots: numba takes seconds to compile that of LAPACK."""
    n, a, found = right.shape[0], matrix.copy(), right.copy()
    for k in range(n):
        best = k + np.argmax(np.abs(a[k:, k]))
        for j in range(n):
            a[k, j], a[best, j] = a[best, j], a[k, j]
        found[k], found[best] = found[best], found[k]
        for i in range(k + 1, n):
            share = a[i, k] / a[k, k]
            found[i] -= share * found[k]
            for j in range(k, n):
                a[i, j] -= share * a[k, j]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            found[i] -= a[i, j] * found[j]
        found[i] /= a[i, i]
    return found


def implicit(times, steps, drives, p, on, s, states, path):
    """The method of Rosenbrock."""
    n, gamma = states.shape[0], 1 / (2 + np.sqrt(2.0))
    right, each, matrix = np.zeros(n), np.eye(n), np.eye(n)
    for i in range(times.size - 1):
        h = (times[i + 1] - times[i]) / steps
        for j in range(steps):
            d = between(drives, i, j / steps)
            f0 = rates(s, d, p, on)
            for k in range(n):
                step = 1e-7 * max(abs(s[k]), abs(h * f0[k]), 1e-12)
                f1 = rates(moved(s, step, each[k]), d, p, on)
                for m in range(n):
                    matrix[m, k] = each[m, k] - gamma * h * (f1[m] - f0[m]) / step
            f1 = rates(s, between(drives, i, (j + 0.01) / steps), p, on)
            for k in range(n):
                right[k] = f0[k] + gamma * (f1[k] - f0[k]) / 0.01
            k1 = solve(matrix, right)
            f1 = rates(moved(s, 0.5 * h, k1), between(drives, i, (j + 0.5) / steps), p, on)
            for k in range(n):
                right[k] = f1[k] - k1[k]
            s = moved(moved(s, h, k1), h, solve(matrix, right))
        for k in range(n):
            states[k, i + 1] = s[k]
