"""The spheres of a setup on the device, and the formulas of one contact: its time, its impulse, the velocities after it."""

import numpy as np
import taichi as ti

from mpp_taichi.contacts._base import ContactSetup
from mpp_taichi.contacts.shared.impulse import impulse_between, pushed
from mpp_taichi.neighbors.periodic import nearest_image
from mpp_taichi.types import Template
from mpp_taichi.walls._roots import first_contact_curved
from mpp_taichi.walls._surfaces import WallSurfaces

ROUNDINGS = 4.0  # of the velocities; a slower approach is round-off
SLACK = 1e-5  # of a squared distance; more than round-off, even in f32


@ti.data_oriented
class Bounce:
    """The spheres of a setup on the device, and the formulas of their contacts.

    Between spheres, with n from i to j and u = v_j − v_i, the impulse along n is
    J = (1 + e) (−u·n) / Σ_k n_k² (w_ik + w_jk), w the inverse masses along the axes; for free axes this is Eq. 9 of the MPPhys
    paper. The impulse acts as −J w_i n on v_i and +J w_j n on v_j, and takes the energy (1 − e²) (u·n)² / (2 Σ …).
    Two spheres that are both infinitely heavy pass through each other.
    """

    def __init__(self, setup: ContactSetup) -> None:
        """Allocate and fill; needs a started Taichi."""
        self.dimensions = setup.dimensions
        self.walls = WallSurfaces(setup.enclosure)
        self.period = tuple(float(edge) for edge in setup.enclosure.period)
        self.contact_time = float(setup.contact_time)
        inverse_mass = np.asarray(setup.inverse_mass)[:, : self.dimensions]
        self.has_common_mass = bool((inverse_mass == inverse_mass[:1]).all())
        self.has_one_material = setup.restitution.shape == (1, 1)
        self.has_held = bool((inverse_mass.max(axis=1) == 0.0).any())
        restitutions = [*np.unique(setup.restitution), *(surface.restitution for surface in self.walls.surfaces)]
        self.is_elastic = all(e == 1.0 for e in restitutions)
        real = np.float32 if ti.lang.impl.current_cfg().default_fp == ti.f32 else np.float64
        self.slowest = ROUNDINGS * float(np.finfo(real).eps)
        self.radius = ti.field(float)
        self.material = ti.field(ti.i32)
        self.inverse_mass = ti.Vector.field(self.dimensions, float)
        self.restitution = ti.field(float)
        numbers, integers = ti.FieldsBuilder(), ti.FieldsBuilder()  # apart: see State._builder
        for field in (self.radius, self.inverse_mass):
            numbers.dense(ti.i, setup.particle_count).place(field)
        numbers.dense(ti.ij, setup.restitution.shape).place(self.restitution)
        integers.dense(ti.i, setup.particle_count).place(self.material)
        self._trees = [numbers.finalize(), integers.finalize()]
        self.radius.from_numpy(np.ascontiguousarray(setup.radius, dtype=real))
        self.material.from_numpy(np.ascontiguousarray(setup.material, dtype=np.int32))
        self.inverse_mass.from_numpy(np.ascontiguousarray(inverse_mass, dtype=real))
        self.restitution.from_numpy(np.ascontiguousarray(setup.restitution, dtype=real))

    def destroy(self) -> None:
        """Give the memory back."""
        for part in (self.walls, *self._trees):
            part.destroy()

    @ti.func
    def separation(self, first, second):
        """From the place `first` to the nearest image of the place `second`."""
        return nearest_image(second - first, self.period)

    @ti.func
    def time_of_contact(self, i, j, reach, separation, v_i, v_j, horizon):
        """When i and j, which touch at distance `reach`, meet in straight flight: 0 … horizon from now, or infinity."""
        u = v_j - v_i
        result = ti.math.inf
        # Before two spheres touch, s > c / −2b with the b and c of the exact test, so that most pairs need no quotient.
        if separation.norm_sqr() - reach * reach <= SLACK * reach * reach - 2.0 * horizon * separation.dot(u):
            result = first_contact_curved(separation, u, reach, False, horizon)
        if ti.static(self.has_held):
            if (self.inverse_mass[i] + self.inverse_mass[j]).max() == 0.0:
                result = ti.math.inf
        if ti.static(not self.is_elastic):
            # An approach of touching spheres that is round-off counts as none, so that inelastic groups come to rest.
            if result == 0.0 and -separation.dot(u) <= self.slowest * separation.norm() * (v_i.norm() + v_j.norm()):
                result = ti.math.inf
        return result

    @ti.func
    def time_of_wall(self, s: Template, i, radius, x, v, time, horizon):
        """When i meets surface s, 0 … horizon from `time`; infinity if it does not."""
        result = self.walls.time_of_contact(s, x, v, radius, time, horizon)
        if ti.static(self.has_held):
            if self.inverse_mass[i].max() == 0.0:
                result = ti.math.inf
        if ti.static(not self.is_elastic or self.walls.curves):
            w = self.walls.velocity(s, x, time)
            n = self.walls.normal(s, x, time)
            if result == 0.0 and -n.dot(v - w) <= self.slowest * (v.norm() + w.norm()):
                result = ti.math.inf
        return result

    @ti.func
    def inverse_mass_of(self, i):
        """Inverse mass of sphere i along each axis; if all are equal, one entry is read, which stays in the cache."""
        k = i
        if ti.static(self.has_common_mass):
            k = 0
        return self.inverse_mass[k]

    @ti.func
    def restitution_of(self, i, j):
        """Restitution of a contact of two spheres, by their materials."""
        one, other = 0, 0
        if ti.static(not self.has_one_material):
            one, other = self.material[i], self.material[j]
        return self.restitution[one, other]

    @ti.func
    def pair_impulse(self, i, j, n, v_i, v_j, e):
        """The result of `impulse_between` for i and j with n from i to j: the impulse acts on j, and its opposite on i."""
        return impulse_between(n, v_j, v_i, self.inverse_mass_of(j), self.inverse_mass_of(i), e)

    @ti.func
    def wall_impulse(self, i, n, v, surface_velocity, e):
        """The result of `impulse_between` for sphere i and a surface of normal n."""
        return impulse_between(n, v, surface_velocity, self.inverse_mass_of(i), ti.Vector.zero(float, n.n), e)

    @ti.func
    def after(self, i, v, n, impulse, sign: Template):
        """The velocity v of sphere i after `sign` times an impulse, the result of one of the functions above."""
        return pushed(v, self.inverse_mass_of(i), n, impulse[0], impulse[1], sign)
