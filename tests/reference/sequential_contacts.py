"""Hard spheres event by event: find the earliest contact, move to it, resolve it, and search again."""

import numpy as np


def fly(position, velocity, radius, mass, time, *, walls=(), period=None, restitution=1.0):
    """Positions, velocities and contacts [(time, i, j or -1 - wall)] after `time`; walls are (axis, side ±1 inwards, place).

    Smooth spheres, n from i to j: u·n → −e u·n. In a box of `period` every image within two boxes is looked at.
    """
    x, v = np.array(position, float), np.array(velocity, float)
    radius, mass = np.asarray(radius, float), np.asarray(mass, float)
    shifts = images(x.shape[1], period)
    contacts = []
    now = 0.0
    while True:
        step, what = earliest(x, v, radius, walls, shifts)
        if not now + step <= time:
            return x + v * (time - now), v, contacts
        x = x + v * step
        now += step
        i, j, shift = what
        contacts.append((now, i, j))
        if j < 0:
            axis, side, _ = walls[-1 - j]
            v[i, axis] = side * restitution * abs(v[i, axis])
        else:
            n = x[j] + shift - x[i]
            n /= np.linalg.norm(n)
            reduced = 1.0 / (1.0 / mass[i] + 1.0 / mass[j])
            impulse = -(1.0 + restitution) * reduced * (v[j] - v[i]).dot(n)
            v[i] -= impulse / mass[i] * n
            v[j] += impulse / mass[j] * n


def images(dimensions, period):
    """Shifts of all images that are looked at."""
    if period is None:
        return np.zeros((1, dimensions))
    steps = np.arange(-2, 3)
    return np.stack(np.meshgrid(*[steps] * dimensions, indexing="ij"), -1).reshape(-1, dimensions) * np.asarray(period)


def earliest(x, v, radius, walls, shifts):
    """Time from now to the next contact, and (i, j, shift of j)."""
    best = np.inf
    what = None
    i, j = np.triu_indices(len(x), 1)
    u = v[j] - v[i]
    for shift in shifts:
        d = x[j] + shift - x[i]
        a, b = (u * u).sum(1), (d * u).sum(1)
        c = (d * d).sum(1) - (radius[i] + radius[j]) ** 2
        with np.errstate(invalid="ignore", divide="ignore"):
            root = np.sqrt(b * b - a * c)  # NaN where they miss
            t = np.where((b < 0) & (root >= 0), np.maximum(c, 0.0) / (root - b), np.inf)
        if len(t) and t.min() < best:
            k = t.argmin()
            best, what = t[k], (i[k], j[k], shift)
    for w, (axis, side, place) in enumerate(walls):
        gap = side * (x[:, axis] - place) - radius
        speed = side * v[:, axis]
        with np.errstate(invalid="ignore", divide="ignore"):
            t = np.where(speed < 0, np.maximum(gap, 0.0) / -speed, np.inf)
        if t.min() < best:
            k = t.argmin()
            best, what = t[k], (k, -1 - w, 0)
    return best, what
