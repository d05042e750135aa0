"""Hard spheres event by event, with a search over all pairs for each event: slow, short, and independent of the program."""

import numpy as np


def run(position, velocity, radius, mass, planes, end, restitution=1.0):
    """Positions, velocities and the list of contacts (time, i, j or −1 − plane) at the time `end`.

    planes: (point, normal, velocity) each. Times of contact are roots found by numpy.roots.
    """
    x, v, time, log = np.array(position, float), np.array(velocity, float), 0.0, []
    last = None
    while True:
        best, who = end - time, None
        for i in range(len(x)):
            for w, (point, n, speed) in enumerate(planes):
                gap = (x[i] - point - speed * time) @ n - radius[i]
                closing = -(v[i] - speed) @ n
                if closing > 0 and gap / closing < best and last != (i, -1 - w):
                    best, who = gap / closing, (i, -1 - w)
            for j in range(i):
                q, u, reach = x[i] - x[j], v[i] - v[j], radius[i] + radius[j]
                if q @ u < 0 and last != (i, j):
                    roots = np.roots([u @ u, 2 * q @ u, q @ q - reach**2])
                    if np.all(np.isreal(roots)) and roots.min() < best:
                        best, who = roots.min(), (i, j)
        x += v * best
        time += best
        if who is None:
            return x, v, log
        i, j = who
        log.append((time, i, j))
        last = who
        if j < 0:
            n, speed = planes[-1 - j][1:]
            v[i] -= (1 + restitution) * ((v[i] - speed) @ n) * n
        else:
            n = (x[i] - x[j]) / np.linalg.norm(x[i] - x[j])
            impulse = -(1 + restitution) * ((v[i] - v[j]) @ n) / (1 / mass[i] + 1 / mass[j])
            v[i] += n * impulse / mass[i]
            v[j] -= n * impulse / mass[j]
