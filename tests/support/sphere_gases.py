"""Spheres for the contact solvers, from arrays: a state, a setup, a box of walls, and positions without overlap."""

import numpy as np
import taichi as ti

from mpp_taichi.contacts._base import ContactSetup
from mpp_taichi.walls._base import Enclosure, Surface


class Places:
    """Positions and velocities as a solver wants them."""

    wide = ti.f64

    def __init__(self, position, velocity):
        real = np.float32 if ti.lang.impl.current_cfg().default_fp == ti.f32 else np.float64
        count, dimensions = np.shape(position)
        self.position = ti.Vector.field(dimensions, float, shape=count)
        self.velocity = ti.Vector.field(dimensions, float, shape=count)
        self.real = real
        self.write(position, velocity)

    def write(self, position, velocity):
        self.position.from_numpy(np.ascontiguousarray(position, dtype=self.real))
        self.velocity.from_numpy(np.ascontiguousarray(velocity, dtype=self.real))

    def read(self):
        return self.position.to_numpy().astype(float), self.velocity.to_numpy().astype(float)


def setup_of(radius, mass=1.0, *, dimensions=3, restitution=1.0, held=None, **others):
    count = len(radius)
    inverse_mass = np.ones((count, 3)) / np.broadcast_to(np.asarray(mass, float), count)[:, None]
    if held is not None:
        inverse_mass[np.asarray(held, bool)] = 0.0
    return ContactSetup(
        dimensions=dimensions,
        radius=np.asarray(radius, float),
        inverse_mass=inverse_mass,
        material=np.zeros(count, np.int32),
        restitution=np.array([[restitution]], float),
        **others,
    )


def box(edges, restitution=1.0):
    """Six planes, or four for two edges, from the origin."""
    surfaces = []
    for axis, edge in enumerate(edges):
        for side, place in ((1.0, 0.0), (-1.0, edge)):
            normal = tuple(side * float(axis == k) for k in range(3))
            point = tuple(place * float(axis == k) for k in range(3))
            surfaces.append(Surface("plane", point, normal, 0.0, True, (0.0, 0.0, 0.0), restitution, f"{axis}{side:+.0f}"))
    return Enclosure(surfaces=tuple(surfaces))


def box_walls(edges):
    """The same for the reference: (axis, side, place)."""
    return [(axis, side, place) for axis, edge in enumerate(edges) for side, place in ((1.0, 0.0), (-1.0, edge))]


def gas(count_along, packing, *, dimensions=3, seed=1):
    """Unit spheres on a square lattice, moved at random within their cells; positions, velocities and edges of the box."""
    random = np.random.default_rng(seed)
    volume = 4.0 * np.pi / 3.0 if dimensions == 3 else np.pi
    cell = (volume / packing) ** (1.0 / dimensions)
    axes = [np.arange(count_along)] * dimensions
    lattice = (np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, dimensions) + 0.5) * cell
    position = lattice + random.uniform(-0.5, 0.5, lattice.shape) * (cell - 2.0)
    return position, random.normal(size=lattice.shape), (count_along * cell,) * dimensions


def largest_overlap(position, radius, period=None):
    """Relative to the smaller radius; negative where none touch."""
    i, j = np.triu_indices(len(position), 1)
    d = position[j] - position[i]
    if period is not None:
        d -= np.asarray(period) * np.round(d / np.asarray(period))
    return ((radius[i] + radius[j] - np.linalg.norm(d, axis=1)) / np.minimum(radius[i], radius[j])).max()
