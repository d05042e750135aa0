"""Wisdom and Holman's mapping for planets: Kepler's orbits exactly, the forces between planets by kicks."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.component import Particle, component, param
from mpp_taichi.device import bulk_copy
from mpp_taichi.integrators import _correctors
from mpp_taichi.integrators._base import Integrator
from mpp_taichi.integrators._compensated_sum import compensated_sum
from mpp_taichi.integrators._kepler import kepler_changes
from mpp_taichi.integrators._launchers import Launchers
from mpp_taichi.integrators._trouble import Trouble, not_finite
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.types import Template

UNROLLED = 10  # bodies at most, whose kick is compiled pair by pair
BEGINS, STEPS, LOOKS = range(3)  # the parts of a launch, in turn


@component
@ti.data_oriented
class WisdomHolman(Integrator):
    """Drift–kick–drift in Jacobi's coordinates: drifts are orbits about all mass farther in, kicks are the remaining gravity.

    Bodies are counted from the central body outwards, by the energies of their orbits. Body k has the coordinate r_k from
    the centre of mass of the bodies before it. H = Σ (p²/2m_k′ − G M_k m_k′/r_k) + R, M_k the mass of the bodies 0 … k; the
    sum is Kepler's problem for each body, and R is smaller by the ratio ε of the planets' masses to the central mass. So
    the error is of the order ε dt²; for two bodies it is round-off. A corrector of order n changes coordinates once at the
    start, and back for each output: no step costs more, and the error is ε dt^(n+1) + ε² dt². With `kernel: lazy`, the kick
    of a step is the acceleration a at the places r + a dt²/12, so that ε² dt² becomes ε² dt⁴ + ε³ dt², for a second
    evaluation in a step. Output changes no bit of the motion; a change of dt begins anew. Take more than twenty steps per
    shortest period, taking the period of a circle at the pericentre distance; planets must not meet.
    Sources: Wisdom & Holman, Astron. J. 102 (1991) 1528; Rein & Tamayo, Mon. Not. R. Astron. Soc. 452 (2015) 376; the lazy
    kernel: Wisdom, Holman & Touma, Fields Inst. Commun. 10 (1996) 217; Rein, Tamayo & Brown, Mon. Not. R. Astron. Soc. 489
    (2019) 4632.
    """

    dt: float = param(above=0.0, unit="time", help="time step")
    central: Particle = param(
        None, optional=True, help="the body that the others orbit, by name or index; absent: the heaviest body"
    )
    corrector: int = param(11, minimum=0, maximum=17, help="order of the symplectic corrector: 0 (none), 3, 5, 7, 11 or 17")
    kernel: str = param(
        "kick", choices=("kick", "lazy"), help="lazy: kicks from displaced places, a second evaluation; smaller ε² dt² term"
    )

    order = 2
    symplectic = True
    time_reversible = True
    takes_velocity = False
    takes_sliders = False  # the strength is part of every orbit's constants
    promising_for = ("planets",)
    made_for = ("gravitates",)
    made_for_reason = "its drifts are Kepler's orbits"
    orbits_central_body = True
    steps_about_center = True
    carries_rounding = True
    correctors = (0, 3, 5, 7, 11, 17)
    variants = {"lazy": {"kernel": "lazy"}}
    launchers = Launchers(serial="own_state", replicas="own_state", parallel="", cpu_only=True)
    nodes = (0.5,)
    VECTORS = ("jacobi_position", "jacobi_velocity", "position_rest", "velocity_rest")
    memory = ("order_inside_out", "step_and_count", "unsolved_orbits", "center_of_mass", *VECTORS)

    @property
    def evaluations_per_step(self) -> int:
        """Two with the lazy kernel."""
        return 2 if self.kernel == "lazy" else 1

    def scratch_count(self, velocity_dependent: bool) -> int:
        """None: its fields are work fields with names."""
        return 0

    def work_fields(self, total_force: Any, start: Snapshot, *, plan: str, on_cpu: bool) -> dict[str, tuple[str, int]]:
        """The state in Jacobi's coordinates with rounding errors, a copy of it for output, and the masses in order."""
        n = start.particle_count
        self._strength = total_force.pair_forces[0].strength
        vectors = [*self.VECTORS, *(f"kept_{name}" for name in self.VECTORS), "place"]
        if self.kernel == "lazy":
            vectors.append("undisplaced")
        return {
            "order_inside_out": ("index", n),
            "unsolved_orbits": ("index", 2),
            "step_and_count": ("wide", 2),
            "center_of_mass": ("vector", 2),
            "orbit_energy": ("scalar", n),
            "attraction": ("scalar", n),
            "inner_attraction": ("scalar", n),
            "share": ("scalar", n),
            **{name: ("vector", n) for name in vectors},
        }

    def arrange(self, state: Any) -> None:
        """Let the next step begin anew from positions and velocities."""
        bulk_copy.clear((state.step_and_count,))

    def trouble(self, state: Any, bad: int) -> Trouble | None:
        """The last particle of a replica in which Kepler's equation was not solved; such a particle is not finite."""
        if bad < 0:
            return None
        found = state.unsolved_orbits.to_numpy().reshape(-1, 2)
        replicas = np.flatnonzero(found[:, 0])
        if not len(replicas):
            return not_finite(bad)
        return Trouble("lost", int(replicas[0]) * state.particle_count + int(found[replicas[0], 1]))

    # Steps of one launch

    @ti.func
    def launch(self, state: Template, total_force: Template, first, dt, steps, beyond):
        """Take steps from the replica's own state, and show the positions and velocities a part `beyond` of a step later.

        The motion of this part is only along the orbits, with an error of ε a dt² / 2. One loop runs the corrector at the
        start, the steps, and on a copy of the state the way back to positions and velocities: so the kernel holds drift and
        kick, which take longest to compile, once.
        """
        r = first // total_force.particle_count
        begins = state.step_and_count[2 * r] != ti.cast(dt, state.wide)
        if begins:
            self._order(state, total_force, first)
            state.unsolved_orbits[2 * r] = 0
            self._take_over(state, total_force, first)
            state.step_and_count[2 * r] = ti.cast(dt, state.wide)
            state.step_and_count[2 * r + 1] = 0.0
        for part in range(3):
            from_here, to_there = 0, ti.static(len(_correctors.opening(self.corrector)))
            if part == BEGINS and not begins:
                to_there = 0
            elif part == STEPS:
                from_here, to_there = 1, steps + 1
            elif part == LOOKS:
                self._copy(state, total_force, first, True)
            for j in range(from_here, to_there):
                kick, drift = ti.cast(1.0, float), ti.cast(1.0, float)
                if part != STEPS:
                    kick, drift = self._looked_up(part, j)
                if part == LOOKS and j == to_there - 1:
                    drift += beyond
                if j > 0:
                    self._kick(state, total_force, first, kick * dt, part == STEPS)
                self._drift(state, total_force, first, drift * dt)
            if part == STEPS:
                state.step_and_count[2 * r + 1] = state.step_and_count[2 * r + 1] + ti.cast(steps, state.wide)
        self._show(state, total_force, first, beyond)
        self._copy(state, total_force, first, False)

    @ti.func
    def _looked_up(self, part, j):
        """Kick and drift number j of the opening or the closing sequence of the corrector."""
        kick, drift = ti.cast(0.0, float), ti.cast(0.0, float)
        opening, closing = ti.static(_correctors.opening(self.corrector)), ti.static(_correctors.closing(self.corrector))
        for c in ti.static(range(len(opening))):
            if j == c:
                kick = ti.select(part == BEGINS, opening[c][0], closing[c][0])
                drift = ti.select(part == BEGINS, opening[c][1], closing[c][1])
        return kick, drift

    @ti.func
    def _copy(self, state: Template, total_force: Template, first, keeps: Template):
        """Copy the own state, or restore it from the copy."""
        for i in range(first, first + total_force.particle_count):
            for own, kept in ti.static(self._fields_and_copies(state)):
                if ti.static(keeps):
                    kept[i] = own[i]
                else:
                    own[i] = kept[i]

    def _fields_and_copies(self, state: Any) -> list[tuple[Any, Any]]:
        return [(getattr(state, name), getattr(state, f"kept_{name}")) for name in self.VECTORS]

    # Coordinates

    def _given_center(self) -> int:
        return -1 if self.central is None else self.central

    @ti.func
    def _order(self, state: Template, total_force: Template, first):
        """Sort the bodies by the energies of their orbits about the central body, which comes first; an insertion sort."""
        n = ti.static(total_force.particle_count)
        center = first + ti.static(self._given_center())
        if ti.static(self._given_center() < 0):
            center = first
            for i in range(first, first + n):
                if state.mass[i] > state.mass[center]:
                    center = i
        for i in range(first, first + n):
            energy = -ti.cast(ti.math.inf, float)
            if i != center:
                mass, distance = state.mass[center] + state.mass[i], (state.position[i] - state.position[center]).norm()
                energy = 0.5 * (state.velocity[i] - state.velocity[center]).norm_sqr() - self._strength * mass / distance
            state.orbit_energy[i] = energy
            k = i
            while k > first and state.orbit_energy[first + state.order_inside_out[k - 1]] > energy:
                state.order_inside_out[k] = state.order_inside_out[k - 1]
                k -= 1
            state.order_inside_out[k] = i - first

    @ti.func
    def _take_over(self, state: Template, total_force: Template, first):
        """Transform the state to Jacobi's coordinates: r_k = x_k − C_(k−1), C_k = C_(k−1) + (m_k / M_k) r_k."""
        r = first // total_force.particle_count
        zero = ti.Vector.zero(float, state.dimensions)
        place, speed, total = zero, zero, ti.cast(0.0, float)
        for k in range(first, first + total_force.particle_count):
            i = first + state.order_inside_out[k]
            total += state.mass[i]
            state.attraction[k] = self._strength * state.mass[i]
            state.inner_attraction[k] = self._strength * total
            state.share[k] = state.mass[i] / total
            state.jacobi_position[k] = state.position[i] - place
            state.jacobi_velocity[k] = state.velocity[i] - speed
            place += state.share[k] * state.jacobi_position[k]
            speed += state.share[k] * state.jacobi_velocity[k]
            state.position_rest[k], state.velocity_rest[k] = zero, zero
        state.center_of_mass[2 * r], state.center_of_mass[2 * r + 1] = place, speed

    @ti.func
    def _show(self, state: Template, total_force: Template, first, beyond):
        """Transform back from Jacobi's coordinates; the centre of mass moves uniformly."""
        r = first // total_force.particle_count
        n = ti.static(total_force.particle_count)
        speed = state.center_of_mass[2 * r + 1]
        elapsed = ti.cast(state.step_and_count[2 * r] * (state.step_and_count[2 * r + 1] + beyond), float)
        place = state.center_of_mass[2 * r] + elapsed * speed
        for back in range(n):
            k = first + n - 1 - back
            i = first + state.order_inside_out[k]
            x, v = place, speed
            if k > first:
                place -= state.share[k] * state.jacobi_position[k]
                speed -= state.share[k] * state.jacobi_velocity[k]
                x, v = place + state.jacobi_position[k], speed + state.jacobi_velocity[k]
            if ti.static(state.has_fixed_axes):
                x, v = ti.select(state.free[i] != 0.0, x, state.position[i]), ti.select(state.free[i] != 0.0, v, 0.0)
            state.position[i] = x
            state.velocity[i] = v

    # A step

    @ti.func
    def _drift(self, state: Template, total_force: Template, first, duration):
        """Move every body along its orbit about all mass farther in; the sums are compensated."""
        for k in range(first + 1, first + total_force.particle_count):
            x, v = state.jacobi_position[k], state.jacobi_velocity[k]
            way, push, solved = kepler_changes(x, v, state.inner_attraction[k], duration)
            state.jacobi_position[k], state.position_rest[k] = compensated_sum(x, state.position_rest[k], way)
            state.jacobi_velocity[k], state.velocity_rest[k] = compensated_sum(v, state.velocity_rest[k], push)
            if not solved:
                r = first // total_force.particle_count
                state.unsolved_orbits[2 * r] = state.unsolved_orbits[2 * r] + 1
                state.unsolved_orbits[2 * r + 1] = state.order_inside_out[k]
                state.jacobi_position[k] = ti.Vector.zero(float, state.dimensions) * ti.math.nan  # so that the run ends here

    @ti.func
    def _kick(self, state: Template, total_force: Template, first, duration, in_step):
        """Kick by the gravity of all pairs but the two innermost bodies, less Kepler's attraction, which the drifts contain.

        With the lazy kernel a kick of a step is evaluated twice, the second time at the displaced places.
        """
        n = ti.static(total_force.particle_count)
        evaluations = 1
        if ti.static(self.kernel == "lazy"):
            for k in range(first, first + n):
                state.undisplaced[k] = state.jacobi_position[k]
            evaluations = ti.select(in_step, 2, 1)
        for evaluation in range(evaluations):
            self._find_accelerations(state, total_force, first)
            # Into Jacobi's coordinates: a_k less the mean acceleration of all mass farther in.
            mean = state.acceleration[first]
            for k in range(first + 1, first + n):
                a = state.acceleration[k] - mean
                mean += state.share[k] * a
                r = state.jacobi_position[k]
                if k > first + 1:
                    a += (state.inner_attraction[k] / (r.norm_sqr() * r.norm())) * r
                if evaluation == evaluations - 1:
                    v = state.jacobi_velocity[k]
                    state.jacobi_velocity[k], state.velocity_rest[k] = compensated_sum(v, state.velocity_rest[k], duration * a)
                else:
                    state.jacobi_position[k] = r + (duration * duration / 12.0) * a
        if ti.static(self.kernel == "lazy"):
            for k in range(first, first + n):
                state.jacobi_position[k] = state.undisplaced[k]

    @ti.func
    def _find_accelerations(self, state: Template, total_force: Template, first):
        """Accelerations by all pairs but the two innermost bodies, in the order from the centre outwards."""
        n = ti.static(total_force.particle_count)
        place = ti.Vector.zero(float, state.dimensions)
        for back in range(n - 1):
            k = first + n - 1 - back
            place -= state.share[k] * state.jacobi_position[k]
            state.place[k] = place + state.jacobi_position[k]
            state.acceleration[k] = ti.Vector.zero(float, state.dimensions)
        state.place[first] = place
        state.acceleration[first] = ti.Vector.zero(float, state.dimensions)
        if ti.static(n <= UNROLLED):
            self._pull_unrolled(state, total_force, first)
        else:
            self._pull(state, total_force, first)

    @ti.func
    def _pull(self, state: Template, total_force: Template, first):
        """Accelerations by all pairs but the innermost, at the places of the bodies.

        `+=` on a field would be an atomic: the same bits, and steps of twelve to sixteen bodies a tenth slower.
        """
        for i in range(first + 2, first + total_force.particle_count):
            pulled = ti.Vector.zero(float, state.dimensions)
            for j in range(first, i):
                d = state.place[j] - state.place[i]
                d *= 1.0 / (d.norm_sqr() * d.norm())
                pulled += state.attraction[j] * d
                state.acceleration[j] = state.acceleration[j] - state.attraction[i] * d
            state.acceleration[i] = state.acceleration[i] + pulled

    @ti.func
    def _pull_unrolled(self, state: Template, total_force: Template, first):
        """`_pull` for few bodies, in registers: the same bits, a third faster."""
        n, dimensions = ti.static(total_force.particle_count, state.dimensions)
        place, acceleration = ti.Matrix.zero(float, n, dimensions), ti.Matrix.zero(float, n, dimensions)
        for k in ti.static(range(n)):
            for c in ti.static(range(dimensions)):
                place[k, c] = state.place[first + k][c]
        for i in ti.static(range(2, n)):
            for j in ti.static(range(i)):
                d = ti.Vector.zero(float, dimensions)
                for c in ti.static(range(dimensions)):
                    d[c] = place[j, c] - place[i, c]
                d *= 1.0 / (d.norm_sqr() * d.norm())
                for c in ti.static(range(dimensions)):
                    acceleration[i, c] += state.attraction[first + j] * d[c]
                    acceleration[j, c] -= state.attraction[first + i] * d[c]
        for k in ti.static(range(n)):
            for c in ti.static(range(dimensions)):
                state.acceleration[first + k][c] = acceleration[k, c]
