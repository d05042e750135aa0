"""Hard disks between fixed or moving walls, in long double: a flight from collision to collision, apart from the program.

Its roundings are 2,000 times smaller than those of f64, so that its positions are right for some collisions longer.
"""

import numpy as np

REAL = np.longdouble


class ExactFlight:
    """Disks that bounce elastically, fall under uniform gravity, and never leave the box.

    planes   (point, normal, velocity) of each wall, in as many numbers as `position` has columns
    period   length of a periodic box along each axis, 0 where there is none
    """

    def __init__(self, position, velocity, radius, mass, planes, gravity, period):
        """Begin at time 0."""
        self.x, self.v = position.astype(REAL), velocity.astype(REAL)
        self.r, self.m = radius.astype(REAL), mass.astype(REAL)
        self.planes = [tuple(np.asarray(part, REAL) for part in plane) for plane in planes]
        self.g, self.period = np.asarray(gravity, REAL), np.asarray(period, REAL)
        self.time, self.collisions = REAL(0), 0
        count = len(self.r)
        self.due, self.partner = np.full(count, np.inf, REAL), np.full(count, -1)
        for i in range(count):
            self._predict(i)

    def advance(self, until):
        """Go on to a time; positions (disks, axes)."""
        while True:
            i = int(np.argmin(self.due))
            if not self.due[i] <= until:
                self._move(REAL(until) - self.time)
                return self.x.astype(float)
            self._move(self.due[i] - self.time)
            j = int(self.partner[i])
            self._bounce(i, j)
            self.collisions += 1
            again = np.flatnonzero((self.partner == i) | ((self.partner == j) & (j >= 0)))
            for k in {i, *([j] if j >= 0 else []), *again.tolist()}:
                self._predict(k)

    def _move(self, h):
        self.x += self.v * h + self.g * (h * h / 2)
        self.v += self.g * h
        self.time += h

    def _bounce(self, i, j):
        if j < 0:
            _, normal, moving = self.planes[-1 - j]
            self.v[i] -= 2 * ((self.v[i] - moving) @ normal) * normal
            return
        normal = self._nearest(self.x[j] - self.x[i])
        normal = normal / np.sqrt(normal @ normal)
        impulse = 2 * ((self.v[i] - self.v[j]) @ normal) / (1 / self.m[i] + 1 / self.m[j])
        self.v[i] -= impulse / self.m[i] * normal
        self.v[j] += impulse / self.m[j] * normal

    def _nearest(self, separation):
        wrapped = np.where(self.period > 0, np.rint(separation / np.where(self.period > 0, self.period, 1)) * self.period, 0)
        return separation - wrapped

    def _predict(self, i):
        self.due[i], self.partner[i] = np.inf, -1
        best, partner = REAL(np.inf), 0
        shifts = [np.zeros_like(self.g)]
        for axis, length in enumerate(self.period):
            shifts = [
                s + step * length * np.eye(len(self.g), dtype=REAL)[axis]
                for s in shifts
                for step in ((-1, 0, 1) if length else (0,))
            ]
        u = self.v - self.v[i]
        square = (u * u).sum(axis=1)
        reach = self.r + self.r[i]
        for shift in shifts:
            d = self.x - self.x[i] + shift
            along = (d * u).sum(axis=1)
            root = along**2 - square * ((d * d).sum(axis=1) - reach**2)
            meets = (along < 0) & (root > 0)
            meets[i] = False
            if meets.any():
                wait = ((d * d).sum(axis=1)[meets] - reach[meets] ** 2) / (-along[meets] + np.sqrt(root[meets]))
                k = int(np.argmin(wait))
                if wait[k] < best:
                    best, partner = max(wait[k], REAL(0)), int(np.flatnonzero(meets)[k])
        for number, (point, normal, moving) in enumerate(self.planes):
            gap = (self.x[i] - point - moving * self.time) @ normal - self.r[i]
            speed, fall = (self.v[i] - moving) @ normal, self.g @ normal
            if fall == 0:
                wait = gap / -speed if speed < 0 else np.inf
            else:  # gap + speed t + fall t²/2 = 0, the root at which the disk approaches
                under = speed**2 - 2 * fall * gap
                if under < 0 or (fall > 0 and speed >= 0):
                    continue
                wait = 2 * gap / (-speed + np.sqrt(under)) if speed < 0 else (-speed - np.sqrt(under)) / fall
            if wait < best:
                best, partner = max(REAL(wait), REAL(0)), -1 - number
        if np.isfinite(best):
            self.due[i], self.partner[i] = self.time + best, partner
            if partner >= 0 and self.due[i] < self.due[partner]:  # the partner of the partner is looked for when it is due
                lost = int(self.partner[partner])
                self.due[partner], self.partner[partner] = self.due[i], i
                if lost >= 0 and self.partner[lost] == partner:
                    self.due[lost] = self.time  # predicted anew at once
                    self._predict(lost)
