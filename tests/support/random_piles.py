"""Random piles for `resting`: few spheres of different sizes and masses that fall into a box or onto slopes."""

import numpy as np
import taichi as ti
from spheres import Spheres, plane, setup_of

from mpp_taichi.contacts.resting import Resting

MOST, WIDTH, AWAY = 40, 8.0, 1e3
GRAVITY = 1.0


@ti.kernel
def kick(velocity: ti.template(), inverse_mass: ti.template(), change: float, axis: ti.template()):
    ti.loop_config(serialize=True)
    for i in velocity:
        if inverse_mass[i][axis] > 0.0:
            velocity[i][axis] = velocity[i][axis] - change


class RandomPiles:
    """One solver, whose 40 spheres get new places, sizes and masses for each seed; spheres that a seed lacks are held far away.

    A seed has 10 to 40 spheres, sizes up to a ratio of 10 and masses up to a ratio of 10⁴, or masses by size; some seeds have
    up to five held spheres.
    """

    def __init__(self, dimensions, kind, restitution, *, parallel=None):
        self.dimensions, self.up = dimensions, dimensions - 1
        surfaces = []
        for axis in range(self.up):
            along = np.eye(3)[axis]
            surfaces += [
                plane((0, 0, 0), along, restitution=restitution),
                plane(WIDTH * along, -along, restitution=restitution),
            ]
            for side in (1, -1) if kind == "slope" else ():
                normal = np.eye(3)[self.up] + 0.3 * side * along
                surfaces.append(plane(WIDTH / 2 * along, normal / np.linalg.norm(normal), restitution=restitution))
        if kind == "box":
            surfaces.append(plane((0, 0, 0), np.eye(3)[self.up], restitution=restitution))
        self.setup = setup_of(
            np.full(MOST, 0.5),
            dimensions=dimensions,
            restitution=restitution,
            surfaces=surfaces,
            gravity=tuple(-GRAVITY * np.eye(3)[self.up]),
        )
        self.spheres = Spheres(np.zeros((MOST, dimensions)), np.zeros((MOST, dimensions)), dimensions)
        self.solver = Resting(restitution=restitution)
        self.solver.bind(self.setup, self.spheres, parallel=parallel)

    def place(self, seed):
        """The spheres of a seed, above the floor and without overlaps."""
        random = np.random.default_rng(seed)
        n = int(random.integers(10, MOST + 1))
        radius = 0.5 * 10.0 ** -(random.uniform(0, 1) * random.uniform(0, 1, n))
        by_size = random.random() < 0.3
        self.mass = radius**self.dimensions if by_size else 10.0 ** -(random.uniform(0, 4) * random.uniform(0, 1, n))
        self.held = int(random.integers(0, 6)) if random.random() < 0.4 else 0
        place = np.zeros((n, self.dimensions))
        for i in range(n):
            height = 1.6
            while True:
                place[i] = random.uniform(radius[i], WIDTH - radius[i], self.dimensions)
                place[i, self.up] = random.uniform(height, height + 3.0)
                if (np.linalg.norm(place[:i] - place[i], axis=1) > radius[:i] + radius[i] + 1e-3).all():
                    break
                height += 0.02
        velocity = random.normal(size=place.shape) * random.choice([0.0, 0.5, 3.0])
        velocity[: self.held] = 0.0
        every, speeds = np.full((MOST, self.dimensions), AWAY), np.zeros((MOST, self.dimensions))
        every[:, 0] += 10.0 * np.arange(MOST)
        every[:n], speeds[:n] = place, velocity
        rows = self.solver.step.rows
        inverse_mass = np.zeros((MOST + 1, self.dimensions))
        inverse_mass[self.held : n] = 1 / self.mass[self.held :, None]
        radii = np.full(MOST + 1, 0.5)
        radii[:n] = radius
        for field, values in ((rows.inverse_mass, inverse_mass), (rows.radius, radii)):
            field.from_numpy(values.astype(field.to_numpy().dtype))
        self.spheres.write(every, speeds)
        self.count = n
        self.solver.prepare(0.0)
        self.solver.collect()

    def energy(self):
        """Kinetic, and of gravity, of the spheres that are not held."""
        position, velocity = (values[self.held : self.count] for values in self.spheres.read())
        mass = self.mass[self.held :]
        return 0.5 * np.sum(mass[:, None] * velocity**2) + GRAVITY * np.sum(mass * position[:, self.up])

    def step(self, number, dt):
        """Drift, kick, drift."""
        self.solver.drift(self.spheres, number * dt, dt / 2)
        kick(self.spheres.velocity, self.solver.step.rows.inverse_mass, GRAVITY * dt, self.up)
        self.solver.drift(self.spheres, (number + 0.5) * dt, dt / 2)
