"""Spheres for tests of contact solvers: a setup from a few numbers, and positions and velocities on the device."""

import numpy as np
import taichi as ti

from mpp_taichi.contacts._base import ContactSetup
from mpp_taichi.walls._base import Enclosure, Surface


class Spheres:
    """What a contact solver needs of a state."""

    def __init__(self, position, velocity, dimensions):
        self.dimensions = dimensions
        self.wide = ti.f64
        self.particle_count = len(position)
        self.position = ti.Vector.field(dimensions, float, shape=len(position))
        self.velocity = ti.Vector.field(dimensions, float, shape=len(position))
        self.write(position, velocity)

    def write(self, position, velocity):
        """Positions and velocities, (n, dimensions)."""
        kind = self.position.to_numpy().dtype
        self.position.from_numpy(np.ascontiguousarray(position, kind))
        self.velocity.from_numpy(np.ascontiguousarray(velocity, kind))

    def read(self):
        """Positions and velocities in f64."""
        return self.position.to_numpy().astype(float), self.velocity.to_numpy().astype(float)


def setup_of(radius, *, dimensions, mass=None, inverse_mass=None, restitution=1.0, surfaces=(), **more):
    """Spheres of one material; masses are 1 if none are given."""
    n = len(radius)
    if inverse_mass is None:
        inverse_mass = np.repeat(1 / (np.ones(n) if mass is None else np.asarray(mass, float)), 3).reshape(n, 3)
    return ContactSetup(
        dimensions=dimensions,
        radius=np.asarray(radius, float),
        inverse_mass=inverse_mass,
        material=np.zeros(n, np.int32),
        restitution=np.array([[restitution]]),
        enclosure=Enclosure(surfaces=tuple(surfaces)),
        **more,
    )


def plane(point, normal, *, restitution=1.0, velocity=(0.0, 0.0, 0.0)):
    """A plane with its free side where the normal points."""
    return Surface("plane", tuple(map(float, point)), tuple(map(float, normal)), 0.0, False, velocity, restitution, "plane")


def bound(solver, setup, position, velocity):
    """The solver with its fields, and the spheres it moves."""
    spheres = Spheres(position, velocity, setup.dimensions)
    solver.bind(setup, spheres)
    return solver, spheres
