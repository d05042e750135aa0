"""Time-stepped hard spheres that may rest on each other: piles and columns."""

import numpy as np
from typing import Any

import taichi as ti

from mpp_taichi.component import component, param
from mpp_taichi.contacts._base import ContactReport, ContactSetup
from mpp_taichi.contacts._resting_step import LOST, PAIRS, PUSHED, ROOM, VIRIAL, WALLS, RestingStep
from mpp_taichi.types import Template

SERIAL_COUNT = 512  # up to here one thread does a drift in one launch; more spheres are worth a launch for each loop
TRIES = 12  # rows that were too narrow are built again, twice as wide


@ti.data_oriented
@component
class Resting:
    """Impacts with restitution, and then no approach beyond a contact's gap: velocity-level complementarity, for piles.

    A drift by h first reflects what is hit faster than `resting_speed` within it, all such contacts together,
    v' = v + (1 + e) M⁻¹ Nᵀ λ with the λ ≥ 0 that would just end their approach. Then it finds the velocities closest to
    these, in the metric of the kinetic energy, with 0 ≤ λ ⟂ gap/h + n·(v_i − v_j) ≥ 0 for everything near, and moves with
    them. Two spheres so never overlap by more than `tolerance` radii, what lies stays where it is, and no drift gains energy:
    both are projections. In one group of impacts with unlike restitutions the least holds for all.

    First order in h: an impact acts at the start of its drift, with the normal and the velocities it has at the instant of
    contact, and a shock passes through touching spheres in one projection (for a cradle take `simultaneous`). Elastic contacts
    never rest. Give the integrator steps in which spheres move by less than a radius. With drifts on both sides of a kick,
    velocities at the end of a step are those after the contacts, 0 for what rests.
    Sources: Moreau, in Nonsmooth Mechanics and Applications (1988) 1; Stewart & Trinkle, Int. J. Numer. Methods Eng. 39 (1996)
    2673.
    """

    restitution: float = param(1.0, minimum=0.0, maximum=1.0, help="e, relative speed after over before; 1: elastic")
    contact_time: float = param(0.0, minimum=0.0, unit="time", help="not needed here: nothing collapses in a drift")
    resting_speed: float = param(
        None,
        optional=True,
        minimum=0.0,
        unit="length / time",
        help="slower approaches do not rebound; absent: four times what gravity gives in a drift",
    )
    tolerance: float = param(1e-10, above=0.0, help="allowed overlap, or opening under load, relative to the smaller radius")

    def bind(self, setup: ContactSetup, state: Any) -> None:
        """Allocate for the spheres of `setup`, whose positions and velocities are fields of `state`."""
        self.particle_count = setup.particle_count
        self.gravity = float(np.linalg.norm(setup.gravity))
        single = ti.lang.impl.current_cfg().default_fp == ti.f32
        # In f32 a radius itself is known to 1e-7, and a coordinate of a hundred radii to 1e-5 of one.
        self.step = RestingStep(setup, max(self.tolerance, 1e-5) if single else self.tolerance, state.wide)
        self.largest_iterations = 0
        self.iterations = 0
        self._unresolved = 0
        self._kicked = False

    def destroy(self) -> None:
        """Give the memory back."""
        self.step.destroy()

    def drift(self, state: Any, time: float, h: float) -> None:
        """Move all spheres by h [time], with impacts and resting contacts."""
        resting_speed = 4.0 * self.gravity * h if self.resting_speed is None else self.resting_speed
        kicked, iterations, unresolved = self._drift_serial(state, time, h, resting_speed, int(self._kicked))
        self._kicked = kicked == 1
        self._unresolved += int(unresolved)
        self.iterations += int(iterations)

    def collect(self) -> ContactReport:
        """What was counted since it was last asked."""
        sums = self.step.sums.to_numpy().sum(axis=0)
        overlap = float(self.step.overlap.to_numpy().max())
        self.step.sums.fill(0)
        self.step.overlap.fill(0)
        unresolved, self._unresolved = self._unresolved, 0
        return ContactReport(
            pair_count=round(sums[PAIRS]),
            wall_count=round(sums[WALLS]),
            virial=float(sums[VIRIAL]),
            wall_impulse=tuple(float(x) for x in sums[PUSHED:]),
            dissipated_energy=float(sums[LOST]),
            largest_overlap=overlap,
            unresolved=unresolved,
        )

    @ti.kernel
    def _drift_serial(self, state: Template, time: float, h: float, resting_speed: float, kicked: int) -> ti.types.vector(3, int):
        result = ti.Vector([0, 0, 0])
        ti.loop_config(serialize=True)
        for _ in range(1):
            if kicked == 1:
                self.step.rows.remember()
            self.step.measure(state.velocity)
            bound = ROOM * ti.cast(self.step.solver.total[0][0], float)
            result[0] = 1 if self.step.solver.total[0][1] > 0.0 else 0
            tries = 0
            while tries < TRIES:
                tries += 1
                self.step.begin_rows()
                self.step.add_all_pairs(state, 2.0 * h * bound, time, h, 0)
                self.step.rows.number()
                if self.step.rows.start[self.particle_count] > self.step.rows.capacity:
                    result[2] += self.step.rows.start[self.particle_count]
                    self.step.rows.clear()
                self.step.begin_rows()
                self.step.add_all_pairs(state, 2.0 * h * bound, time, h, 1 + result[0])
                self.step.find_impacts(state, time, h, resting_speed)
                hit = self.step.solver.total[0][0] > 0.0
                phase = 0 if hit else 1
                while phase < 2:
                    if phase == 0:
                        self.step.begin_impacts(state)
                        if ti.static(self.step.mixed):
                            spreading = 1
                            while spreading == 1:
                                self.step.spread_restitution()
                                spreading = 1 if self.step.solver.total[0][0] > 0.0 else 0
                    else:
                        self.step.begin_rest(state, h, ti.cast(hit, ti.i32))
                    self.step.solver.prepare(1 - phase)
                    outcome = self.step.solver.solve_serial(h)
                    result[1] += outcome[0]
                    result[2] += outcome[1]
                    if phase == 0:
                        self.step.end_impacts()
                    phase += 1
                self.step.measure(self.step.solver.velocity)
                fastest = ti.cast(self.step.solver.total[0][0], float)
                if fastest <= bound:
                    tries = TRIES + 1
                else:
                    bound = 2.0 * fastest
            if tries == TRIES:
                result[2] += 1
            self.step.move(state, h)
        return result
