"""The merger of two spheres that meet into one, with the mass, the momentum, the charge and the volume of both."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.particle_update import drifted
from mpp_taichi.contacts._base import ContactSetup
from mpp_taichi.contacts.events.log import ContactLog
from mpp_taichi.contacts.shared.contact_counts import Tally
from mpp_taichi.start.overlaps import ALLOWED
from mpp_taichi.walls._roots import first_contact_curved

ROUNDINGS = 8  # of a coordinate, by which a distance may be wrong


@ti.data_oriented
class Merger:
    """Two spheres i and j at the moment they meet become one, s, and the other, g, is gone:

        M = m_i + m_j,  M V = m_i v_i + m_j v_j,  M X = m_i x_i + m_j x_j,  R^d = r_i^d + r_j^d

    with d dimensions. s is the heavier sphere; of equally heavy spheres it is the sphere with the lower number. Along an axis
    on which one of the two is held, the merged sphere is held at its place. The kinetic energy ½ m_i m_j / M (v_i − v_j)² is
    lost; along an axis on which one sphere is held, the lost energy is the energy of the other sphere. The angular momentum
    m_i m_j / M (x_i − x_j) × (v_i − v_j) of the two about their centre is lost, because spheres have no spin here.

    At the time t of a drift sphere i is at state.position[i] + state.velocity[i] · t, also if it is a merged sphere.
    """

    def __init__(self, setup: ContactSetup, state: Any, forces: Any, *, log_capacity: int) -> None:
        """Allocate for the spheres of `state`, on which `forces` act, a TotalForce or None."""
        self.particle_count, self.dimensions = setup.particle_count, setup.dimensions
        self.state, self.forces, self.wide = state, forces, state.wide
        self.has_potential = forces is not None and len(forces.forces) > 0
        real = np.float32 if ti.lang.impl.current_cfg().default_fp == ti.f32 else np.float64
        self.rounding = ROUNDINGS * float(np.finfo(real).eps)
        self.tally = Tally(setup.particle_count, len(setup.enclosure.accounts), self.wide)
        builder = ti.FieldsBuilder()
        self.log = ContactLog(log_capacity, builder, self.wide)
        self.potential_change = ti.field(self.wide)
        builder.dense(ti.i, 1).place(self.potential_change)
        self._tree = builder.finalize()

    def destroy(self) -> None:
        """Give the memory back."""
        self.tally.destroy()
        self._tree.destroy()

    @ti.func
    def is_there(self, i):
        """Whether sphere i is still there, and has not merged into another."""
        return self.state.merged_into[i] < 0

    @ti.func
    def place(self, i, t):
        """Position of sphere i at the time t of the drift."""
        return drifted(self.state.position[i], self.state.velocity[i], t)

    @ti.func
    def time_of_meeting(self, i, j, now, h):
        """First time from `now` to h at which i and j touch, or infinity; `now` if they overlap by more than rounding.

        Spheres that recede, and overlap by at most `ALLOWED` of the smaller radius or by the rounding of their positions, have
        only touched. Two spheres that are held along every axis do not meet.
        """
        u = self.state.velocity[j] - self.state.velocity[i]
        separation = (self.state.position[j] - self.state.position[i]) + u * now
        r_i, r_j = self.state.radius[i], self.state.radius[j]
        reach = r_i + r_j
        result = now + first_contact_curved(separation, u, reach, False, h - now)
        square = separation.dot(separation)
        if square < reach * reach:
            size = self.state.position[i].norm() + self.state.position[j].norm()
            if reach - ti.sqrt(square) > ALLOWED * ti.min(r_i, r_j) + self.rounding * size:
                result = now
        if (self.state.free[i] + self.state.free[j]).max() == 0.0:
            result = ti.math.inf
        return result

    @ti.func
    def merge(self, i, j, time, t):
        """Merge i and j, which meet at the time t of a drift that began at `time`; returns the merged sphere."""
        s, g = i, j
        m_i, m_j = self.state.mass[i], self.state.mass[j]
        if m_j > m_i or (m_j == m_i and j < i):
            s, g = j, i
        m_s, m_g = self.state.mass[s], self.state.mass[g]
        # From here on the state holds their positions at t; at the end s gets back the position that its flight starts from.
        x_s, x_g = self.place(s, t), self.place(g, t)
        v_s, v_g = self.state.velocity[s], self.state.velocity[g]
        self.state.position[s] = x_s
        self.state.position[g] = x_g
        before = self._potential(s, g, time, t) + self._potential(g, s, time, t) + self._mutual(s, g)
        total = m_s + m_g
        reduced = m_s * (m_g / total)
        position, velocity = x_s, v_s
        free_s, free_g = self.state.free[s], self.state.free[g]
        lost, exchanged, virial = 0.0, 0.0, 0.0
        for axis in ti.static(range(self.dimensions)):
            u = v_g[axis] - v_s[axis]
            if free_s[axis] != 0.0 and free_g[axis] != 0.0:
                position[axis] += (m_g / total) * (x_g[axis] - x_s[axis])
                velocity[axis] += (m_g / total) * u
                lost += 0.5 * reduced * u * u
                exchanged += reduced * u * (reduced * u)
                virial -= reduced * u * (x_g[axis] - x_s[axis])
            else:
                moving = m_s * v_s[axis] * v_s[axis] + m_g * v_g[axis] * v_g[axis]  # a held axis has no velocity
                lost += 0.5 * moving
                velocity[axis] = 0.0
                if free_s[axis] != 0.0:
                    position[axis] = x_g[axis]
        self._unite(s, g, total)
        self.state.position[s] = position
        self.state.velocity[s] = velocity
        self.potential_change[0] += self._potential(s, g, time, t) - before
        self.state.position[s] = position - velocity * t
        self.tally.begin(s)
        self.tally.add_pair(s, virial, 1.0, lost, 0)
        self.tally.keep(0, s)
        self.log.note(time + t, s, g, ti.sqrt(exchanged))
        return s

    @ti.func
    def _unite(self, s, g, total):
        r_s, r_g = self.state.radius[s], self.state.radius[g]
        larger, smaller = ti.max(r_s, r_g), ti.min(r_s, r_g)
        if larger > 0.0:
            ratio = smaller / larger
            if ti.static(self.dimensions == 2):
                larger *= ti.sqrt(1.0 + ratio * ratio)
            else:
                larger *= (1.0 + ratio * ratio * ratio) ** (1.0 / 3.0)
        self.state.radius[s] = larger
        self.state.mass[s] = total
        self.state.charge[s] = self.state.charge[s] + self.state.charge[g]
        self.state.free[s] = self.state.free[s] * self.state.free[g]
        self.state.radius[g] = 0.0
        self.state.mass[g] = 0.0
        self.state.charge[g] = 0.0
        nothing = ti.Vector.zero(float, self.dimensions)
        self.state.free[g] = nothing
        self.state.velocity[g] = nothing
        self.state.acceleration[g] = nothing
        self.state.merged_into[g] = s

    # Potential energy

    @ti.func
    def _potential(self, i, other, time, t):
        """Potential energy of sphere i, at state.position[i], in external forces and with all spheres but `other`, at t."""
        result = ti.cast(0.0, self.wide)
        if ti.static(self.has_potential):
            for force in ti.static(self.forces.external):
                result += force.potential(self.state, i, time + t)
            if ti.static(self.forces.has_pairs):
                for k in range(self.particle_count):
                    if k != i and k != other and self.is_there(k):
                        result += self._between(i, self.state.position[i], k, self.place(k, t))
        return result

    @ti.func
    def _mutual(self, i, j):
        """Potential energy of spheres i and j with each other."""
        result = ti.cast(0.0, self.wide)
        if ti.static(self.has_potential and self.forces.has_pairs):
            result += self._between(i, self.state.position[i], j, self.state.position[j])
        return result

    @ti.func
    def _between(self, i, x_i, k, x_k):
        separation = ti.cast(x_k, self.wide) - ti.cast(x_i, self.wide)
        return self.forces.pair_sum.potential_between(self.state, i, k, separation)
