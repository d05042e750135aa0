"""The spheres of an event-driven run, each at its own time."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.particle_update import drifted
from mpp_taichi.contacts._base import ContactSetup
from mpp_taichi.contacts.events.lines import Lines
from mpp_taichi.device import bulk_copy


@ti.data_oriented
class FlyingSpheres:
    """Position and velocity of each sphere at its own clock; between contacts it is in free flight.

    The fields of a neighbour that a prediction reads lie in one line of the cache. Spheres are numbered anew, so that
    neighbours in space are neighbours in memory; `order` holds their numbers in the scene. Times are `wide` floats, as they
    grow while flights stay short.
    """

    def __init__(self, setup: ContactSetup, order: np.ndarray, lines: Lines, wide: Any) -> None:
        """Place the fields; `write` fills them."""
        self.dimensions, self.count = setup.dimensions, setup.particle_count
        self.wide = wide
        inverse_mass = np.asarray(setup.inverse_mass)[:, : self.dimensions]
        self.gravity = tuple(float(g) for g in setup.gravity[: self.dimensions])
        self.has_held = bool((inverse_mass == 0).any())
        # Gravity has no effect along an axis on which all spheres are held; if only some are, spheres do not fall together.
        self.gravity = tuple(g if (inverse_mass[:, k] > 0).any() else 0.0 for k, g in enumerate(self.gravity))
        self.has_gravity = any(self.gravity)
        self.falls_together = not any(g != 0 and (inverse_mass[:, k] == 0).any() for k, g in enumerate(self.gravity))
        self.position = lines.field(float, self.dimensions)
        self.velocity = lines.field(float, self.dimensions)
        self.clock = lines.field(wide)
        radius = np.asarray(setup.radius, dtype=float)
        self.has_common_radius = bool((radius == radius[0]).all())
        self.common_radius = float(radius[0])
        if not self.has_common_radius:
            self.own_radius = lines.field(float)
        self.contacts = lines.field(ti.i32)
        self.last_partner, self.stalled, self.order, self.material = (lines.field(ti.i32, seldom=True) for _ in range(4))
        self.has_common_mass = bool((inverse_mass == inverse_mass[0]).all())
        self.common_mass = tuple(map(float, inverse_mass[0]))
        if not self.has_common_mass:
            self.own_inverse_mass = lines.field(float, self.dimensions, seldom=True)
        self.lasting = (self.position, self.velocity, self.clock, self.contacts, self.last_partner, self.stalled)
        self._setup, self._order = setup, order

    def write(self, position: np.ndarray, velocity: np.ndarray, time: float) -> None:
        """Start all spheres from (n, dimensions) arrays in the scene's order, at one time."""
        real = np.float32 if self.position.dtype == ti.f32 else np.float64
        order, d = self._order, self.dimensions
        arrays = [(self.position, position[order].astype(real)), (self.velocity, velocity[order].astype(real))]
        if not self.has_common_radius:
            arrays.append((self.own_radius, np.asarray(self._setup.radius)[order].astype(real)))
        if not self.has_common_mass:
            arrays.append((self.own_inverse_mass, np.asarray(self._setup.inverse_mass)[order, :d].astype(real)))
        arrays.append((self.clock, np.full(len(order), time, np.float32 if self.clock.dtype == ti.f32 else np.float64)))
        arrays.append((self.material, np.asarray(self._setup.material)[order].astype(np.int32)))
        arrays.append((self.order, order.astype(np.int32)))
        arrays.append((self.last_partner, np.full(len(order), self.count, np.int32)))
        arrays += [(field, np.zeros(len(order), np.int32)) for field in (self.contacts, self.stalled)]
        bulk_copy.write(*zip(*arrays))

    @ti.func
    def radius(self, i):
        """Radius of sphere i; a constant of the kernel if all are equal."""
        result = 0.0
        if ti.static(self.has_common_radius):
            result = self.common_radius
        else:
            result = self.own_radius[i]
        return result

    @ti.func
    def inverse_mass(self, i):
        """Inverse mass of sphere i along each axis; a constant of the kernel if all are equal."""
        result = ti.Vector.zero(float, self.dimensions)
        if ti.static(self.has_common_mass):
            result = ti.Vector([w for w in ti.static(self.common_mass)], float)
        else:
            result = self.own_inverse_mass[i]
        return result

    @ti.func
    def acceleration(self, i):
        """Acceleration of free flight: gravity along the axes on which sphere i is not held."""
        result = ti.Vector([g for g in ti.static(self.gravity)], float)
        if ti.static(not self.falls_together):
            for k in ti.static(range(self.dimensions)):
                if self.own_inverse_mass[i][k] == 0:
                    result[k] = 0.0
        return result

    @ti.func
    def position_at(self, i, time):
        """Position of sphere i at `time`, if it has had no contact since its clock."""
        s = ti.cast(time - self.clock[i], float)
        result = drifted(self.position[i], self.velocity[i], s)
        if ti.static(self.has_gravity):
            result += self.acceleration(i) * (s * s / 2)
        return result

    @ti.func
    def velocity_at(self, i, time):
        """Velocity of sphere i at `time`, if it has had no contact since its clock."""
        result = self.velocity[i]
        if ti.static(self.has_gravity):
            result += self.acceleration(i) * ti.cast(time - self.clock[i], float)
        return result

    @ti.func
    def is_held(self, i):
        """Whether sphere i is held along every axis."""
        return self.inverse_mass(i).max() == 0
