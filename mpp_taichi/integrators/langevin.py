"""Langevin: particles in a bath of heat, which brakes them and pushes them at random."""

import math
from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.particle_update import drift_particle
from mpp_taichi.arithmetic.random_numbers import normals_for
from mpp_taichi.component import component, param
from mpp_taichi.errors import UnsupportedError
from mpp_taichi.integrators._splitting import Splitting
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.types import Template


@component
class Langevin(Splitting):
    """m dv/dt = F − γ m v + √(2 γ m kT) ξ(t): motion in a bath of the temperature T, by steps kick, drift, bath, drift, kick.

    The bath is a friction of the rate γ and a white noise ξ of variance 1, of such a strength that every particle comes to the
    kinetic energy kT/2 along each axis. Half a step after its begin each velocity becomes c v + √((1 − c²) kT/m) N with
    c = exp(−γ dt) and a normal number N, which is the exact solution without F; the rest of the step is velocity Verlet. Means
    over the canonical ensemble have errors of order dt², and positions in a harmonic potential have none. Stable on an
    oscillator for dt ω < 2. With γ = 0 the step is velocity Verlet.

    The numbers N are a function of the seed, of the particle and of the step: a run has the same bits however it is cut, and on
    any number of threads. They are computed in f32 in every precision. In a sweep each row has the same N, unless `seed` is
    swept. The energy that the bath gives is booked as `heat` in the energy balance. Contacts take place during both drifts.
    Refused: particles without mass, rigid rods, bodies on paths, merging spheres, precisions with low parts, quantities that
    need a tangent, accuracy studies, and negative steps, since heat does not flow backwards.
    Source: Leimkuhler & Matthews, Appl. Math. Res. Express 2013 (2013) 34, where the method is named BAOAB.
    """

    dt: float = param(above=0.0, unit="time", help="time step")
    temperature: float = param(minimum=0.0, unit="energy", help="k T, the temperature of the bath times Boltzmann's constant")
    friction: float = param(minimum=0.0, unit="time⁻¹", help="γ, the share of its momentum that a particle loses a time")
    seed: int = param(1, minimum=0, maximum=4294967295, help="number that chooses the noise")

    order = 2
    moves_forward_alone = True
    takes_limits = True
    draws_random = True
    symplectic = False
    time_reversible = False
    takes_low_parts = False
    takes_rods = False
    takes_paths = False
    takes_any_numbers = False
    needs = frozenset({"mass"})
    memory = ("acceleration", "noise_step", "heat_taken")
    _mixed_for: float | None = None  # the step for which the field `mixing` was filled
    drifts, kicks = (1.0,), (0.5, 0.5)

    def work_fields(self, total_force: Any, start: Snapshot, *, plan: str, on_cpu: bool) -> dict[str, tuple[str, int]]:
        """The number of the step and the heat taken of each particle; of each replica c and √((1 − c²) kT)."""
        count = start.particle_count
        return {"noise_step": ("index", count), "heat_taken": ("wide", count), "mixing": ("wide", 2)}

    def count_from(self, state: Any, step: int) -> None:
        """The next step has this number since the start of the run."""
        state.noise_step.fill(step % 2**31)

    def set_step(self, state: Any, dt: float) -> None:
        """Compute c = exp(−γ dt) and √((1 − c²) kT) for steps of dt.

        Raises:
            UnsupportedError: dt is negative.
        """
        if dt == self._mixed_for:
            return
        if dt < 0.0:
            raise UnsupportedError("langevin takes no steps backwards: heat does not flow back")
        spread = math.sqrt(-math.expm1(-2.0 * self.friction * dt) * self.temperature)
        state.mixing.from_numpy(np.tile((math.exp(-self.friction * dt), spread), state.replica_count))
        self._mixed_for = dt

    def heat(self, state: Any) -> float:
        """Energy that the bath has given to the particles of the first replica since the fields were made [energy]."""
        return math.fsum(state.heat_taken.to_numpy()[: state.particle_count])

    def loops(self, k: int, total_force: Any) -> int:
        """The loops of the kick, and another loop for both drifts and the bath between them."""
        return self.slope_count(total_force) + (1 if k == 0 else 0)

    @ti.func
    def stage(self, state: Template, total_force: Template, first, time: Template, dt: Template, k: Template):
        """Half a kick; after the first of the two kicks half a drift, the bath and half a drift."""
        node, kick, drift = ti.static(self.entries[k])
        sums = ti.static(self.sums(k, total_force))
        self.kick_and_drift(state, total_force, first, time + node * dt, k, kick * dt, 0.0, sums, False)
        if ti.static(drift != 0.0):
            for i in range(first, first + total_force.particle_count):
                drift_particle(state, i, 0.5 * dt, 0)
                self.meet_bath(state, i, i - first)
                drift_particle(state, i, 0.5 * dt, 0)

    @ti.func
    def meet_bath(self, state: Template, i, number):
        """v ← c v + √((1 − c²) kT/m) N for the particle i, which has this number in its replica; along held axes v stays 0."""
        normals = normals_for(number, state.noise_step[i], self.seed)
        state.noise_step[i] = state.noise_step[i] + 1
        place = 2 * (i // state.particle_count)
        mass = ti.cast(state.mass[i], state.wide)
        kept, spread = state.mixing[place], state.mixing[place + 1]
        if mass > 0.0:
            spread /= ti.sqrt(mass)
        change = ti.cast(0.0, state.wide)
        for k in ti.static(range(state.dimensions)):
            before = ti.cast(state.velocity[i][k], state.wide)
            after = kept * before + spread * ti.cast(normals[k], state.wide)
            if ti.static(state.has_fixed_axes):
                after *= ti.cast(state.free[i][k], state.wide)
            state.velocity[i][k] = ti.cast(after, float)
            now = ti.cast(state.velocity[i][k], state.wide)
            change += (now - before) * (now + before)
        state.heat_taken[i] = state.heat_taken[i] + 0.5 * mass * change
