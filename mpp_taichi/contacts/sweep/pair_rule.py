"""The rule for an event where contacts are resolved one by one: two spheres bounce, or a sphere off a surface."""

import taichi as ti

from mpp_taichi.contacts.shared.thermal_bounce import off_wall
from mpp_taichi.contacts.shared.wall_friction import work_of_wall
from mpp_taichi.contacts.sweep.sweep_parts import SweepParts


@ti.data_oriented
class PairRule:
    """The impulse of `Bounce`, with the restitution that the memory of the last contacts allows."""

    in_turn = False  # whether islands have to be played one after the other

    def __init__(self, parts: SweepParts) -> None:
        """Bind the parts."""
        self.bounce, self.walls, self.tally = parts.bounce, parts.bounce.walls, parts.tally
        self.slots, self.played, self.memory, self.islands = parts.slots, parts.played, parts.memory, parts.islands

    def destroy(self) -> None:
        """Own no memory."""

    @ti.func
    def resolve(self, root, i, partner, t, time):
        """Let i and its partner (surface s: −2 − s) bounce at time t; returns how many spheres changed their velocities.

        These are listed in `touched`, from `islands.begin[root]` on, and their stamps are counted up.
        """
        begin = self.islands.begin[root]
        count = 1
        self.played.advance(i, t)
        self.played.stamp[i] = self.played.stamp[i] + 1
        self.played.touched[begin] = i
        if partner >= 0:
            self.played.advance(partner, t)
            self.played.stamp[partner] = self.played.stamp[partner] + 1
            self.played.touched[begin + 1] = partner
            count = 2
        self.bounce_now(i, partner, t, time)
        return count

    @ti.func
    def bounce_now(self, i, partner, t, time):
        """Change the velocities of i and its partner, which are at time t, and count the contact."""
        if partner >= 0:
            self._bounce_pair(ti.min(i, partner), ti.max(i, partner), t)
        else:
            self._bounce_off_wall(i, -2 - partner, t, time)

    @ti.func
    def _bounce_pair(self, i, j, t):
        separation = self.bounce.separation(self.played.position[i], self.played.position[j])
        distance = separation.norm()
        n = separation / distance
        a, b = self.slots.index(i), self.slots.index(j)
        e, elastic = self.memory.restitution(self.bounce.restitution_of(a, b), i, j, t)
        v_i, v_j = self.played.velocity[i], self.played.velocity[j]
        result = self.bounce.pair_impulse(a, b, n, v_i, v_j, e)
        self.played.velocity[i] = self.bounce.after(a, v_i, n, result, -1)
        self.played.velocity[j] = self.bounce.after(b, v_j, n, result, 1)
        self.tally.add_pair(i, result[0], distance, result[2], elastic)
        if not result[0] > 0.0:
            self.tally.fail(i, 1)

    @ti.func
    def _bounce_off_wall(self, i, surface, t, time):
        v, radius = self.played.velocity[i], self.slots.radius_of(i)
        gap, n, w, nominal, account = self.walls.touched(surface, self.played.position[i], radius, time + t)
        approaches = True
        if ti.static(self.walls.curves):
            # A contact is predicted along a tangent, at whose end the wall may already be faster than the sphere.
            approaches = n.dot(v - w) < 0.0
        if approaches:
            e, elastic = self.memory.restitution(nominal, i, i, t)
            index = self.slots.index(i)
            bounce = self.bounce.wall_impulse(index, n, v, w, e)
            inverse_mass = self.bounce.inverse_mass_of(index)
            after, impulse, lost = off_wall(self.walls, surface, index, n, v, w, inverse_mass, bounce, time + t)
            self.played.velocity[i] = after
            if ti.static(self.walls.pushes):
                self._put_back(i, surface, gap, n, inverse_mass)
            work = ti.cast(0.0, float)
            if ti.static(self.tally.works):
                work = self._work(surface, w, v, after, inverse_mass)
            self.tally.add_wall(i, account, impulse, lost, elastic, work)
            if not impulse > 0.0:
                self.tally.fail(i, 1)

    @ti.func
    def _put_back(self, i, surface, gap, n, w):
        """Put sphere i back onto a surface in which it has sunk; it stays in place along held axes."""
        yielding = (n * n).dot(w)
        if yielding > 0.0:
            depth = self.walls.sunk(surface, gap) / yielding
            self.played.position[i] = self.played.position[i] + depth * (w * n)

    @ti.func
    def _work(self, surface, wall_velocity, before, after, w):
        """The work of a surface in a bounce; a thermal surface has counted it as energy that it took."""
        result = work_of_wall(wall_velocity, before, after, w)
        if ti.static(self.walls.heats):
            heat, _ = self.walls.temperature(surface)
            if heat >= 0.0:
                result = 0.0
        return result
