"""Steps of the solvers over all samples, written so that they can be compiled together with the rates of a model.

Runge-Kutta's classical method, and the L-stable Rosenbrock method of Shampine and Reichelt (1997, SIAM J. Sci. Comput.
18:1). `times` are those of the samples, `steps` how many are taken from one to the next; `drives` holds what the rates
read beside the states, `p` parameters, `on` which effects act, and `states` is filled from its first column on.
"""

import numpy as np


def rates(s, d, p, on, out):
    """Those of a model take its place."""


def between(drives, i, part, d):
    """Drives on the straight line between two samples."""
    for k in range(drives.shape[0]):
        d[k] = drives[k, i] + (drives[k, i + 1] - drives[k, i]) * part


def moved(s, h, slope, y):
    """A straight step."""
    for k in range(s.shape[0]):
        y[k] = s[k] + h * slope[k]


def explicit(times, steps, drives, p, on, states):
    """Runge-Kutta's method."""
    s, d = states[:, 0].copy(), drives[:, 0].copy()
    y, k1, k2, k3, k4 = s.copy(), s.copy(), s.copy(), s.copy(), s.copy()
    for i in range(times.size - 1):
        h = (times[i + 1] - times[i]) / steps
        for j in range(steps):
            between(drives, i, j / steps, d)
            rates(s, d, p, on, k1)
            between(drives, i, (j + 0.5) / steps, d)
            moved(s, 0.5 * h, k1, y)
            rates(y, d, p, on, k2)
            moved(s, 0.5 * h, k2, y)
            rates(y, d, p, on, k3)
            between(drives, i, (j + 1) / steps, d)
            moved(s, h, k3, y)
            rates(y, d, p, on, k4)
            for k in range(s.shape[0]):
                s[k] = s[k] + h / 6 * (k1[k] + 2 * k2[k] + 2 * k3[k] + k4[k])
        moved(s, 0.0, s, states[:, i + 1])


def solve(matrix, right, found):
    """Gauss's elimination with pivots: numba takes seconds to compile that of LAPACK."""
    n, a = right.shape[0], matrix.copy()
    moved(right, 0.0, right, found)
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


def implicit(times, steps, drives, p, on, states):
    """The method of Rosenbrock."""
    n, gamma = states.shape[0], 1 / (2 + np.sqrt(2.0))
    s, d = states[:, 0].copy(), drives[:, 0].copy()
    f0, f1, y, right, k1, k2 = s.copy(), s.copy(), s.copy(), s.copy(), s.copy(), s.copy()
    matrix = np.eye(n)
    for i in range(times.size - 1):
        h = (times[i + 1] - times[i]) / steps
        for j in range(steps):
            between(drives, i, j / steps, d)
            rates(s, d, p, on, f0)
            for k in range(n):
                kept = s[k]
                step = 1e-7 * max(abs(kept), abs(h * f0[k]), 1e-12)
                s[k] = kept + step
                rates(s, d, p, on, f1)
                s[k] = kept
                for m in range(n):
                    matrix[m, k] = (1.0 if m == k else 0.0) - gamma * h * (f1[m] - f0[m]) / step
            between(drives, i, (j + 0.01) / steps, d)
            rates(s, d, p, on, f1)
            for k in range(n):
                right[k] = f0[k] + gamma * (f1[k] - f0[k]) / 0.01
            solve(matrix, right, k1)
            between(drives, i, (j + 0.5) / steps, d)
            moved(s, 0.5 * h, k1, y)
            rates(y, d, p, on, f1)
            moved(f1, -1.0, k1, right)
            solve(matrix, right, k2)
            for k in range(n):
                s[k] = s[k] + h * (k1[k] + k2[k])
        moved(s, 0.0, s, states[:, i + 1])
