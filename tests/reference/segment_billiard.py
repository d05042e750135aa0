"""One disk among segments in straight flight, in long double, by brute force: each event tries every line and every end."""

import numpy as np

REAL = np.longdouble


def run(position, velocity, radius, segments, end):
    """Position and velocity of the disk at time `end`, and the number of bounces.

    segments: (begin, end, restitution) each. A disk that recedes from what it touches goes on.
    """
    x, v, time, bounces = np.array(position, REAL), np.array(velocity, REAL), REAL(0), 0
    while True:
        best, normal, e = end - time, None, 1.0
        for begin, stop, restitution in segments:
            for s, n in _contacts(x, v, REAL(radius), np.array(begin, REAL), np.array(stop, REAL)):
                if s < best:
                    best, normal, e = s, n, restitution
        x, time = x + best * v, time + best
        if normal is None:
            return x, v, bounces
        v = v - (1 + REAL(e)) * (v @ normal) * normal
        bounces += 1


def _contacts(x, v, radius, begin, stop):
    """Times and normals of the contacts with the two sides of a segment, and with its ends."""
    way = stop - begin
    length = np.sqrt(way @ way)
    for n in (np.array([-way[1], way[0]]) / length, np.array([way[1], -way[0]]) / length):
        gap, speed = (x - begin) @ n - radius, v @ n
        if speed < 0 and gap > -radius / 2:  # less than half a radius deep: rounding; deeper: it is on the other side
            s = max(gap / -speed, REAL(0))
            if 0 <= (x + s * v - begin) @ way <= way @ way:
                yield s, n
    for point in (begin, stop):
        q = x - point
        a, b, c = v @ v, q @ v, q @ q - radius * radius
        if b < 0 and b * b - a * c > 0:
            s = max(c / (np.sqrt(b * b - a * c) - b), REAL(0))
            yield s, (q + s * v) / np.sqrt((q + s * v) @ (q + s * v))
