"""Splitting methods: a table of drifts and kicks, and one step for all of them."""

import math
from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.force_numbers import copied, zero_vector
from mpp_taichi.arithmetic.particle_update import drift_particle, kick_particle, step_number
from mpp_taichi.integrators._base import Integrator, SumForces
from mpp_taichi.integrators._launchers import Launchers
from mpp_taichi.integrators._splitting_table import KICK_METHODS, without_rounding
from mpp_taichi.integrators._turning import only_turns, turned_acceleration
from mpp_taichi.types import Template

MOST_SLOPES = 16  # slopes of all damped kicks of a step in one kernel


class Splitting(Integrator):
    """Composition of drifts x += c h v and kicks v += d h a(x), taken in turn.

    With as many drifts as kicks plus one the step begins and ends with a drift; with one kick more than drifts it begins and
    ends with a kick, and the last force serves the first kick of the next step. Every splitting is symplectic for conservative
    forces; palindromic tables are time-reversible.

    Where forces only turn the velocity, as magnetic fields do, a kick is exact (_turning.py). Other forces that depend on
    velocity are integrated inside each kick, at frozen positions, by a Runge–Kutta method of the order of the splitting, so
    that the order is kept; from order 6 on only for forces linear in velocity, and other forces are refused (see `taylor`).
    Runge–Kutta–Nyström tables have their order because [B,[B,[B,A]]] = 0 for kicks B and drifts A, which holds for forces of
    positions and time only. Such tables declare `takes_velocity = False`, and other forces are refused with them.

    Bodies on given paths are put where they are after each drift, and masses and charges that change are set. The time moves on
    in the drifts only, so that all of these are functions of the time as it is in each kick, and the order is kept.
    """

    drifts: tuple = ()
    kicks: tuple = ()
    symplectic = True
    can_use_tree = True
    takes_low_parts = True
    takes_rods = True
    takes_paths = True
    takes_any_numbers = True
    sums_slices = True
    solves_kicks = True  # from order 6 on with its order only for forces that are linear in all velocities
    launchers = Launchers(vectors=True)

    @property
    def time_reversible(self) -> bool:
        """Whether the table reads the same backwards."""
        return self.drifts == self.drifts[::-1] and self.kicks == self.kicks[::-1]

    @property
    def begins_with_kick(self) -> bool:
        """Kick–drift–…–kick."""
        return len(self.kicks) > len(self.drifts)

    @property
    def entries(self) -> tuple:
        """(node, kick, drift) of each stage: the first is the opening drift, or a kick by the force that was kept."""
        kicks = self.kicks if self.begins_with_kick else (0.0, *self.kicks)
        drifts = (*self.drifts, 0.0) if self.begins_with_kick else self.drifts
        return tuple((sum(drifts[:k]), kick, drift) for k, (kick, drift) in enumerate(zip(kicks, drifts, strict=True)))

    @property
    def ends(self) -> tuple:
        """Sums of the drifts up to the drift of each stage: the time of the step to which each stage leads."""
        return tuple(node + drift for node, _kick, drift in self.entries)

    @property
    def nodes(self) -> tuple:
        """Sums of the drifts before each kick."""
        return tuple(node for node, _kick, _drift in self.entries[1:])

    @property
    def drift_parts(self) -> tuple:
        """The two parts of the drift of each stage where rods keep their lengths; a part of 0 is none.

        A drift along rods is symmetric, but it is exact only to second order. A splitting of order p for exact drifts D and
        kicks K is a composition of the maps D K and K D of lengths α₁, α₂, … in turn, which has order p for any such maps: the
        table's coefficients are sums of two successive α. Hence a drift of α₁ + α₂ becomes two drifts. Up to second order a
        symmetric table needs no parts. Source: McLachlan, SIAM J. Sci. Comput. 16 (1995) 151; Hairer, Lubich & Wanner,
        Geometric Numerical Integration (2006), theorem III.3.17.
        """
        if self.order <= 2:
            return tuple((drift, 0.0) for _node, _kick, drift in self.entries)
        parts, earlier = [], 0.0
        for number, (_node, kick, drift) in enumerate(self.entries):
            if number > 0 or self.begins_with_kick:
                earlier = without_rounding(kick - earlier)
            later = without_rounding(drift - earlier)
            parts.append((earlier, later) if drift != 0.0 or earlier != 0.0 else (0.0, 0.0))
            earlier = later
        return tuple(parts)

    @property
    def part_ends(self) -> tuple:
        """The times of the step to which the two parts of the drift of each stage lead."""
        parts = zip(self.entries, self.drift_parts, self.ends, strict=True)
        return tuple((node + early if late != 0.0 else end, end) for (node, _kick, _drift), (early, late), end in parts)

    @property
    def most_parts(self) -> int:
        """2 where some drift has two parts; else 1."""
        return 2 if any(late != 0.0 for _early, late in self.drift_parts) else 1

    def drifts_along_rods(self) -> int:
        """The parts of the drifts that are not 0."""
        return sum(part != 0.0 for parts in self.drift_parts for part in parts)

    @property
    def kick_method(self) -> tuple:
        """(way, end) of a damped kick: slope s + 1 is taken at v + way[s] h × slope s; `end` are the weights of the slopes."""
        a, b = KICK_METHODS[self.order]
        return tuple(row[-1] for row in a[1:]), b

    def prepare(self, state: Any, total_force: Any, time: float, sum_forces: SumForces) -> None:
        """A step that begins with a kick uses the force that the step before ended with."""
        if self.begins_with_kick:
            sum_forces(total_force, time)

    def scratch_count(self, velocity_dependent: bool) -> int:
        """One field for each slope of the kick's method but the last slope, which is used at once."""
        return max(1, len(self.kick_method[1]) - 1) if velocity_dependent else 0

    def slopes(self, velocity_dependent: bool) -> range:
        """All fields of `scratch_count`."""
        return range(self.scratch_count(velocity_dependent))

    def step_numbers(self, dt: float) -> list[float]:
        """Kick and drift of every stage."""
        return [number * dt for _node, *numbers in self.entries for number in numbers]

    def amplification(self, frequency: float, damping: float = 0.0) -> np.ndarray:
        """Product of the drifts and kicks; a kick multiplies v by the polynomial of its own method."""
        step = np.eye(2)
        for _node, kick, drift in self.entries:
            # v' = A − γ v over the time `kick`: v ← R(w) v + kick·φ(w) A with w = −γ·kick, R the Taylor series of exp.
            terms = [(-damping * kick) ** k / math.factorial(k) for k in range(len(KICK_METHODS[self.order][1]) + 1)]
            growth = math.fsum(terms)
            push = kick * math.fsum(term / (k + 1) for k, term in enumerate(terms[:-1]))
            step = np.array([[1.0, 0.0], [-push * frequency**2, growth]]) @ step
            step = np.array([[1.0, drift], [0.0, 1.0]]) @ step
        return step

    def wants_sum(self, total_force: Any) -> bool:
        """Only with forces between pairs: a kick sums all other forces itself, without a field between two loops."""
        return total_force.has_pairs

    def sums(self, k: int, total_force: Any) -> bool:
        """Whether stage k sums the forces itself; the opening kick uses the force that the step before ended with."""
        return k > 0 and not self.wants_sum(total_force)

    def joins_steps(self, total_force: Any) -> bool:
        """For a step that begins and ends with a drift: the last drift and the first drift of the next step are one loop.

        Bodies on given paths, and masses that change, are put between these drifts, so that no loop is shared.
        """
        if self.begins_with_kick or total_force.has_given or self.looks_stages_up(total_force):
            return False
        if total_force.has_pairs and total_force.depends_on_velocity:
            return False
        return self.drifts[0] != 0.0 and self.drifts[-1] != 0.0

    def looks_stages_up(self, total_force: Any) -> bool:
        """For damped kicks with many slopes: each slope holds all forces, and takes half a second to compile; and for rods.

        Also for many stages with many functions of the time, whose formulas stand in each stage.
        """
        slopes = self.evaluations * self.slope_count(total_force)
        paths = self.evaluations * sum(part.count for part in total_force.given if part is not None)
        damped = bool(total_force.depends_on_velocity and slopes > MOST_SLOPES)
        return total_force.has_rods or damped or paths > MOST_SLOPES

    def slope_count(self, total_force: Any) -> int:
        """Loops over the forces in a kick: one, or one for each slope where the kick is solved for a force of the velocity."""
        return len(self.kick_method[1]) if total_force.depends_on_velocity and not only_turns(total_force) else 1

    def loops(self, k: int, total_force: Any) -> int:
        """One loop for kick and drift, or for each slope of a damped kick; one more for a drift that waits for all kicks.

        Before a loop that sums forces there is a loop over the slices of springs, where there are slices.
        """
        _node, kick, drift = self.entries[k]
        if total_force.has_rods:
            slopes = self.slope_count(total_force)
            drifts = sum(part != 0.0 for part in self.drift_parts[k]) if k == 0 else self.most_parts
            return (0 if kick == 0.0 else 2 * slopes + (slopes > 1 and total_force.mixes_velocities)) + drifts
        if kick == 0.0:
            return 1 if drift != 0.0 else 0
        if total_force.depends_on_velocity:
            slopes = self.slope_count(total_force)
            return (
                slopes * (1 + total_force.slice_loops(True))
                + (total_force.slice_loops(False) if self.sums(k, total_force) else 0)
                + ((slopes == 1 and not only_turns(total_force)) or total_force.mixes_velocities)
                + (drift != 0.0 or (k > 0 and self.looks_stages_up(total_force)))
            )
        if not self.sums(k, total_force):
            return 1
        return 1 + total_force.slice_loops(False) + (drift != 0.0 and not total_force.sums_ahead)

    @ti.func
    def stage(self, state: Template, total_force: Template, first, time: Template, dt: Template, k: Template):
        """A kick and the drift after it; a coefficient of zero compiles to nothing."""
        node, kick, drift = ti.static(self.entries[k])
        if ti.static(total_force.has_changes and self.begins_with_kick and k == 0):
            total_force.changes.put(state, first, time)
        sums = ti.static(self.sums(k, total_force))
        if ti.static(total_force.has_rods):
            if ti.static(kick != 0.0):
                self.kick_and_drift(state, total_force, first, time + node * dt, k, kick * dt, 0.0, sums, False)
            for part, end in ti.static(tuple(zip(self.drift_parts[k], self.part_ends[k]))):
                if ti.static(part != 0.0):
                    total_force.rods.drift(state, total_force, first, part * dt, time, end * dt)
        elif ti.static(kick != 0.0):
            self.kick_and_drift(state, total_force, first, time + node * dt, k, kick * dt, drift * dt, sums, drift != 0.0)
        elif ti.static(drift != 0.0):
            self.drift(state, total_force, first, k, drift * dt)
        if ti.static(total_force.has_paths and not total_force.has_rods and drift != 0.0):
            total_force.paths.put(state, first, time + self.ends[k] * dt, True, True)
        if ti.static(total_force.has_changes and drift != 0.0):
            total_force.changes.put(state, first, time + self.ends[k] * dt)

    @ti.func
    def kick_stage(
        self, state: Template, total_force: Template, first, time: Template, dt: Template, k: Template, shape: Template
    ):
        """Stage k with its force and without its drift, for contact solvers, which move the particles themselves.

        `shape` is the shape of the loop over pairs; "launched" where the forces between pairs have been summed already.
        """
        node, kick, _drift = ti.static(self.entries[k])
        if ti.static(k > 0 and shape != "launched" and self.wants_sum(total_force)):
            total_force.accumulate(state, first, time + node * dt, shape)
        sums = ti.static(self.sums(k, total_force))
        self.kick_and_drift(state, total_force, first, time + node * dt, k, kick * dt, 0.0, sums, False)

    @ti.func
    def stage_after_force(self, state: Template, total_force: Template, first, time: Template, dt: Template, k):
        """A stage whose coefficients are looked up while the kernel runs, so that all stages share one copy of the code."""
        # dt comes first in products: in a tangent it is a number of its own kind, and such a number must be on the left.
        node, kick, drift, early, late, end = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for c in ti.static(range(1, self.evaluations + 1)):
            if k == c:
                node, kick, drift = self.entries[c]
                if ti.static(total_force.has_rods):
                    early, late = self.drift_parts[c]
                if ti.static(total_force.has_paths or total_force.has_changes):
                    end = self.ends[c]
        sums = ti.static(self.sums(1, total_force))
        if ti.static(total_force.has_rods):
            self.kick_and_drift(state, total_force, first, time + dt * node, k, dt * kick, 0.0, sums, False)
            total_force.rods.drift(state, total_force, first, early * dt, time, dt * (node + early))
            if ti.static(self.most_parts > 1):
                total_force.rods.drift(state, total_force, first, late * dt, time, dt * end)
        else:
            self.kick_and_drift(state, total_force, first, time + dt * node, k, dt * kick, dt * drift, sums, True)
            if ti.static(total_force.has_paths):
                total_force.paths.put(state, first, time + dt * end, True, True)
        if ti.static(total_force.has_changes):
            total_force.changes.put(state, first, time + dt * end)

    @ti.func
    def stage_and_opening(self, state: Template, total_force: Template, first, time: Template, dt: Template, opens):
        """The last stage, and in the loop of its drift the opening drift of the next step."""
        node, kick, drift = ti.static(self.entries[-1])
        last = ti.static(len(self.entries) - 1)
        if ti.static(total_force.sums_ahead):
            total_force.sum_slices(state, state.velocity, False)
        elif ti.static(not self.wants_sum(total_force)):
            self.kick_and_drift(state, total_force, first, time + node * dt, last, kick * dt, 0.0, True, False)
        for i in range(first, first + total_force.particle_count):
            if ti.static(self.wants_sum(total_force)):
                kick_particle(state, i, kick * dt, 2 * last, state.acceleration[i])
            if ti.static(total_force.sums_ahead):
                acceleration = total_force.local_acceleration(state, first, i, time + node * dt, False, True)
                kick_particle(state, i, kick * dt, 2 * last, acceleration)
            drift_particle(state, i, drift * dt, 2 * last + 1)
            if opens:
                drift_particle(state, i, self.drifts[0] * dt, 1)

    @ti.func
    def kick_and_drift(
        self,
        state: Template,
        total_force: Template,
        first,
        time,
        k,
        kick_time: Template,
        drift_time: Template,
        sums: Template,
        drifts: Template,
    ):
        """v += kick time × a, then x += drift time × v, of stage k; a is summed here, or was summed into state.acceleration."""
        if ti.static(sums):
            total_force.look(state, first, time)
        if ti.static(only_turns(total_force)):
            self.turning_kick(state, total_force, first, time, k, kick_time, sums)
        elif ti.static(total_force.depends_on_velocity):
            self.damped_kick(state, total_force, first, time, k, kick_time, sums)
        elif ti.static(sums):
            total_force.sum_slices(state, state.velocity, False)
            for i in range(first, first + total_force.particle_count):
                acceleration = total_force.local_acceleration(state, first, i, time, False, True)
                if ti.static(self.begins_with_kick):
                    state.acceleration[i] = acceleration
                kick_particle(state, i, kick_time, 2 * k, acceleration)
                if ti.static(drifts and total_force.sums_ahead):
                    drift_particle(state, i, drift_time, 2 * k + 1)
        else:
            for i in range(first, first + total_force.particle_count):
                kick_particle(state, i, kick_time, 2 * k, state.acceleration[i])
                if ti.static(drifts):
                    drift_particle(state, i, drift_time, 2 * k + 1)
        if ti.static(total_force.has_rods):
            total_force.rods.project(state, first, state.velocity, 1.0)
        # The kicks of other particles read the positions, so the drift is a loop of its own.
        if ti.static(drifts and ((sums and not total_force.sums_ahead) or total_force.depends_on_velocity)):
            self.drift(state, total_force, first, k, drift_time)

    @ti.func
    def drift(self, state: Template, total_force: Template, first, k, drift_time: Template):
        """x += drift time × v, the drift of stage k."""
        for i in range(first, first + total_force.particle_count):
            drift_particle(state, i, drift_time, 2 * k + 1)

    @ti.func
    def turning_kick(self, state: Template, total_force: Template, first, time: Template, stage, h: Template, sums: Template):
        """Solve v' = A + v × Ω over h at fixed positions, which is exact (see _turning.py)."""
        if ti.static(sums):
            total_force.sum_slices(state, state.velocity, False)
        for i in range(first, first + total_force.particle_count):
            still = zero_vector(state)
            if ti.static(total_force.has_velocity_independent):
                if ti.static(sums):
                    state.acceleration[i] = total_force.local_acceleration(state, first, i, time, False, True)
                still = state.acceleration[i] + still
            kick_particle(state, i, h, 2 * stage, turned_acceleration(state, total_force, i, time, h, still))

    @ti.func
    def damped_kick(self, state: Template, total_force: Template, first, time: Template, stage, h: Template, sums: Template):
        """Solve v' = a + f(v) over h at fixed positions, with one loop for each slope; a does not depend on velocity.

        The forces are summed once, for the first slope. The other slopes differ from it by the friction of the velocity gained.
        """
        way, end = ti.static(self.kick_method)
        for s in ti.static(range(len(end))):
            if ti.static(s > 0):
                total_force.sum_slices(state, state.scratch[s - 1], True, False)
            else:
                total_force.sum_slices(state, state.velocity, True)
                if ti.static(sums):
                    total_force.sum_slices(state, state.velocity, False)
            for i in range(first, first + total_force.particle_count):
                slope = zero_vector(state)
                if ti.static(s == 0):
                    slope = total_force.local_acceleration(state, first, i, time, True, True)
                    if ti.static(total_force.has_velocity_independent):
                        if ti.static(sums):
                            state.acceleration[i] = total_force.local_acceleration(state, first, i, time, False, True)
                        slope = state.acceleration[i] + slope
                else:
                    gained = step_number(state, h, 2 * stage) * way[s - 1]
                    slope = state.scratch[0][i] + total_force.acceleration_gained(
                        state, state.moving_as_scratch[s - 1], gained, first, i, time, True
                    )
                if ti.static(s == len(end) - 1 and s > 0):
                    if ti.static(state.carries_low or total_force.mixes_velocities):
                        whole = end[s] * slope
                        for k in ti.static(range(s)):
                            if ti.static(end[k] != 0.0):
                                whole += end[k] * state.scratch[k][i]
                        if ti.static(total_force.mixes_velocities):
                            state.kick_slope[i] = whole  # the last slopes of other particles read the velocity
                        else:
                            kick_particle(state, i, h, 2 * stage, whole)
                    else:
                        velocity = copied(state.velocity[i])
                        for k in ti.static(range(s)):
                            if ti.static(end[k] != 0.0):
                                velocity += h * end[k] * state.scratch[k][i]
                        state.velocity[i] = velocity + h * end[s] * slope
                else:
                    state.scratch[s][i] = slope  # the velocity stays: the slopes of other particles read it
            if ti.static(total_force.has_rods and s < len(end) - 1):
                # All slopes hold the first slope, and the weights of all slopes add up to 1.
                total_force.rods.project(state, first, state.scratch[s], h * (1.0 if s == 0 else end[s]))
        if ti.static(len(end) == 1):
            for i in range(first, first + total_force.particle_count):
                kick_particle(state, i, h, 2 * stage, state.scratch[0][i])
        elif ti.static(total_force.mixes_velocities):
            for i in range(first, first + total_force.particle_count):
                kick_particle(state, i, h, 2 * stage, state.kick_slope[i])
