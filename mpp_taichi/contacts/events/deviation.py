"""Deviation of an event-driven run: small changes of all positions and velocities, carried through flights and collisions."""

from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.particle_update import drifted
from mpp_taichi.contacts.events.lines import Lines
from mpp_taichi.contacts.events.spheres import FlyingSpheres
from mpp_taichi.state.tangent_meter import RANGE_BITS
from mpp_taichi.walls._geometry import turn
from mpp_taichi.walls._surfaces import WallSurfaces

LARGE = 2.0**RANGE_BITS


@ti.data_oriented
class Deviation:
    """The derivative of the motion along one direction: δx and δv of each sphere at the clock of the sphere.

    In free flight δx grows by δv s, as every sphere has a constant acceleration a. At a collision two spheres have the distance
    σ along the normal n and the relative velocity u, and each takes the share w of the impulse J, its inverse mass. With the
    relative deviation δq, δu the collision takes place at another time, by δτ = −(n·δq)/(n·u). At this contact

        δq′ = δq + u δτ,  δu′ = δu + (a_i − a_j) δτ,  δn = (δq′ − n (n·δq′))/σ,
        δJ = J (δ(n·u)/(n·u) − δ(n²·w)/(n²·w)),  δv_i → δv_i + w_i (δJ n + J δn),  δx_i → δx_i − w_i J n δτ.

    Source: Dellago, Posch & Hoover, Phys. Rev. E 53 (1996) 1485, for equal masses and elastic collisions.
    Collisions that touch without approach (n·u = 0), and contacts of more than two spheres at once, have no derivative; at the
    latter this is the derivative of the collisions in the order in which they are resolved.

    Where a component exceeds 2⁴⁰, all are multiplied by 2⁻⁴⁰, which changes no digit; `show` returns how often.
    """

    def __init__(self, state: Any, spheres: FlyingSpheres, walls: WallSurfaces, lines: Lines, builder: Any) -> None:
        """Place the fields; `state` has the deviation of all particles at one time, in the fields `tangent_…`."""
        self.state, self.spheres, self.walls, self.dimensions = state, spheres, walls, spheres.dimensions
        self.position, self.velocity = (lines.field(float, self.dimensions, seldom=True) for _ in range(2))
        self.lasting = (self.position, self.velocity)
        self.is_large, self.scaled = ti.field(ti.i32), ti.field(ti.i32)
        builder.place(self.is_large, self.scaled)

    @ti.kernel
    def read(self):
        """Begin with the deviation that the state has."""
        self.is_large[None] = 0
        self.scaled[None] = 0
        for i in range(self.spheres.count):
            self.position[i] = self.state.tangent_position[self.spheres.order[i]]
            self.velocity[i] = self.state.tangent_velocity[self.spheres.order[i]]

    @ti.kernel
    def show(self, time: ti.f64) -> ti.i32:
        """Write the deviation at `time` into the state; how often it was multiplied by 2⁻⁴⁰ since the last call."""
        for i in range(self.spheres.count):
            s = ti.cast(ti.cast(time, self.spheres.wide) - self.spheres.clock[i], float)
            self.state.tangent_position[self.spheres.order[i]] = drifted(self.position[i], self.velocity[i], s)
            self.state.tangent_velocity[self.spheres.order[i]] = self.velocity[i]
        scaled = self.scaled[None]
        self.scaled[None] = 0
        return scaled

    @ti.kernel
    def scale(self, factor: ti.f64):
        """Multiply by a power of two, as the meter has done with the state."""
        for i in range(self.spheres.count):
            self.position[i] *= ti.cast(factor, float)
            self.velocity[i] *= ti.cast(factor, float)

    @ti.func
    def keep_in_range(self):
        """Make all components smaller where a collision has made one too large."""
        if self.is_large[None] != 0:
            self.is_large[None] = 0
            self.scaled[None] += 1
            for i in range(self.spheres.count):
                self.position[i] *= ti.static(1.0 / LARGE)
                self.velocity[i] *= ti.static(1.0 / LARGE)

    @ti.func
    def fly(self, i, s):
        """Bring sphere i to a time that is s later than its clock."""
        self.position[i] = drifted(self.position[i], self.velocity[i], s)

    @ti.func
    def pair(self, i, j, n, distance, impulse):
        """Change the deviations of two spheres at their collision, before their velocities change."""
        w_i, w_j = self.spheres.inverse_mass(i), self.spheres.inverse_mass(j)
        q, u = self.position[i] - self.position[j], self.spheres.velocity[i] - self.spheres.velocity[j]
        later = -n.dot(q) / n.dot(u)
        q += u * later
        turned = turn(n, q, distance)
        change = self.velocity[i] - self.velocity[j]
        if ti.static(not self.spheres.falls_together):
            change += (self.spheres.acceleration(i) - self.spheres.acceleration(j)) * later
        push = self._push(n, turned, u, change, w_i + w_j, impulse)
        self._pushed(i, w_i, push, n * (impulse * later))
        self._pushed(j, w_j, -push, n * (-impulse * later))

    @ti.func
    def wall(self, i, w, n, velocity, impulse, now):
        """Change the deviation of sphere i at its bounce off surface w, before its velocity changes."""
        share, u = self.spheres.inverse_mass(i), self.spheres.velocity[i] - velocity
        later = -n.dot(self.position[i]) / n.dot(u)
        turned = self.walls.normal_change(w, self.spheres.position[i], now, self.position[i] + u * later)
        change = self.velocity[i]
        if ti.static(self.spheres.has_gravity):
            change += self.spheres.acceleration(i) * later
        self._pushed(i, share, self._push(n, turned, u, change, share, impulse), n * (impulse * later))

    @ti.func
    def _push(self, n, turned, u, change, shares, impulse):
        """δ(J n), by the changes of n and of the relative velocity."""
        speed, softness = n.dot(u), (n * n).dot(shares)
        faster, softer = turned.dot(u) + n.dot(change), 2 * (n * turned).dot(shares)
        return turned * impulse + n * (impulse * (faster / speed - softer / softness))

    @ti.func
    def _pushed(self, i, share, push, delayed):
        self.velocity[i] += share * push
        self.position[i] -= share * delayed
        if ti.max(ti.abs(self.velocity[i]).max(), ti.abs(self.position[i]).max()) > LARGE:
            self.is_large[None] = 1
