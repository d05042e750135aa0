"""Time-stepped hard spheres that may rest on each other: piles and columns."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.component import component, param
from mpp_taichi.contacts._base import ContactReport, ContactSetup, ContactSolver
from mpp_taichi.contacts.rest.plans import ParallelPlan, SerialPlan
from mpp_taichi.contacts.rest.slow_groups import Squeeze
from mpp_taichi.contacts.rest.step import LOST, MISSED, PAIRS, PUSHED, VIRIAL, WALLS, RestingStep
from mpp_taichi.device.fast_taichi.quick_compilation import quick_compilation
from mpp_taichi.device.fast_taichi.serial_loops import on_cpu

SHORTER = "try a smaller dt"
SERIAL_COUNT = 512  # spheres up to which one thread does a drift in one launch; for more each loop has a launch


@component
class Resting(ContactSolver):
    """Impacts with restitution, and then no approach beyond a contact's gap: velocity-level complementarity, for piles.

    A drift by h first reflects all impacts together: contacts that are hit within it faster than `resting_speed`,
    v' = v + (1 + e) M⁻¹ Nᵀ λ with the λ ≥ 0 that would just end their approach. Then it finds the velocities closest to
    these, in the metric of the kinetic energy, with 0 ≤ λ ⟂ gap/h + n·(v_i − v_j) ≥ 0 for all near spheres and surfaces, so
    that resting spheres stay where they are. Both are projections, which never add kinetic energy. Spheres move by h times
    these velocities; spheres with an impact move with the old velocity until the impact and with the new velocity after it,
    again corrected so that at the end of the drift no two spheres overlap by more than `tolerance` of the smaller radius. In
    one group of impacts with different restitutions the least restitution holds for all.

    First order in h: a shock passes through touching spheres in one projection (for a cradle take `simultaneous`), and the
    height of a bounce varies by about one step's fall. Elastic contacts never rest. Give the integrator steps in which spheres
    move by less than a radius; spheres that overlap at the start are pushed apart in one drift. With drifts on both sides of a
    kick (leapfrog), velocities at the end of a step are the velocities after the contacts, 0 for resting spheres.

    Groups of spheres whose contacts are not solved in 2,000 iterations, as in regular packings, wedges and columns under heavy
    spheres, are solved on the host by Newton's method, in f64. Only where a sphere has too little room, between held spheres or
    walls, is there no solution: up to 1e-3 of a radius it is then pressed into the spheres and walls around it, and the run
    ends where more is missing.

    With a `compliance` c a contact yields: 0 ≤ λ ⟂ gap/h + n·(v_i − v_j) + (c/h²) λ ≥ 0, an elastic spring of stiffness 1/c
    that pushes and never pulls, by implicit Euler, which damps it; at rest spheres overlap by c times the force between them.
    Forces in packings without friction are badly conditioned, and the forces of spheres that yield a little are found in far
    fewer iterations. Impacts do not yield. In a drift without a kick before it, no force would hold the springs down, so use
    symplectic_euler with a compliance.
    Sources: Moreau, in Nonsmooth Mechanics and Applications (1988) 1; Stewart & Trinkle, Int. J. Numer. Methods Eng. 39 (1996)
    2673; with compliance, Lacoursière, Ghosts and Machines (thesis, Umeå 2007).
    """

    restitution: float = param(
        1.0, minimum=0.0, maximum=1.0, help="e, relative speed after the contact over the speed before; 1: elastic"
    )
    contact_time: float = param(0.0, minimum=0.0, unit="time", help="not used: no cascade of contacts occurs in a drift")
    resting_speed: float = param(
        None,
        optional=True,
        minimum=0.0,
        unit="length / time",
        help="slower approaches do not rebound; absent: four times the speed that gravity gives in a drift",
    )
    tolerance: float = param(
        None,
        optional=True,
        above=0.0,
        help="allowed overlap, or gap under load, relative to the smaller radius; absent: 1e-12, with many spheres 1e-10",
    )

    compliance: float = param(
        0.0, minimum=0.0, unit="length force⁻¹", help="c, overlap [length] per force on a resting contact; 0: hard"
    )

    drifts = True
    order = 1

    def bind(self, setup: ContactSetup, state: Any, *, parallel: bool | None = None) -> None:
        """Allocate for the spheres of `setup`, whose positions and velocities are fields of `state`."""
        self.setup = setup.with_bounces(self.restitution, self.contact_time)
        self.particle_count = setup.particle_count
        self.gravity = float(np.linalg.norm(setup.gravity))
        if parallel is None:
            parallel = setup.particle_count > SERIAL_COUNT or not on_cpu()
        self.step = RestingStep(self.setup, self._tolerance(parallel), state.wide, self.compliance)
        self.plan: Any = ParallelPlan(self.step, setup, state) if parallel else SerialPlan(self.step)
        self.iterations = 0
        self._trouble: list[str] = []  # since the last report, and in it
        self._told: list[str] = []
        self._before, self._met = ContactReport(), (0, 0)  # what was collected so far
        self._kicked = False

    def _tolerance(self, parallel: bool) -> float:
        """The tolerance that is given, else a tight one for few spheres; at least 1e-5 in f32.

        In f32 a position a hundred radii away is known to 1e-5 of a radius.
        """
        chosen = self.tolerance if self.tolerance is not None else 1e-10 if parallel else 1e-12
        return max(chosen, 1e-5) if ti.lang.impl.current_cfg().default_fp == ti.f32 else chosen

    def destroy(self) -> None:
        """Give the memory back."""
        self.plan.destroy()
        self.step.destroy()

    def prepare(self, time: float) -> None:
        """Forget velocities and impulses of the last drift."""
        self._kicked = False
        self.step.forget()

    def drift(self, state: Any, time: float, h: float) -> None:
        """Move all spheres by h [time], with impacts and resting contacts."""
        resting_speed = 4.0 * self.gravity * h if self.resting_speed is None else self.resting_speed
        with quick_compilation():
            drifted = self.plan.drift(state, time, h, resting_speed, self._kicked)
        self._kicked = drifted.changed
        self.iterations += drifted.iterations
        for squeeze in drifted.squeezes:
            self._trouble.append(self._squeezed(squeeze, state))
        if drifted.crowded:
            self._trouble.append(f"spheres could meet {drifted.crowded} times in a step; {SHORTER}")
        if drifted.hurried:
            self._trouble.append(f"overlapping spheres are driven apart faster than their contacts can be found; {SHORTER}")

    def _squeezed(self, squeeze: Squeeze, state: Any) -> str:
        """What squeezes a sphere, where, and what helps."""
        label, place = self.setup.label, state.position.to_numpy()[squeeze.sphere]
        names = [label(other) for other in squeeze.others]
        around = " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
        where = ", ".join(f"{x:.4g}" for x in place)
        return (
            f"{label(squeeze.sphere)} at [{where}] has too little room between {around}: {squeeze.overlap:.2g} of a radius is "
            "missing; give it more room, or let contacts yield: contacts.hard_spheres.compliance"
        )

    def sum_fields(self) -> tuple[Any, ...]:
        """Counts, virial, energies and impulses on surfaces of each chunk of spheres."""
        return self.step.sum_fields

    def collect(self) -> ContactReport:
        """Counts since the last call."""
        sums = sum(field.to_numpy().astype(np.float64).sum(axis=0) for field in self.step.sum_fields)
        overlap = float(self.step.overlap.to_numpy().max())
        self.step.overlap.fill(0)
        self._told, self._trouble = self._trouble, []
        pairs, walls = round(sums[PAIRS]), round(sums[WALLS])
        now = ContactReport(
            pair_count=pairs - self._met[0],
            wall_count=walls - self._met[1],
            virial=float(sums[VIRIAL]),
            wall_impulse=tuple(float(x) for x in sums[PUSHED:]),
            dissipated_energy=float(sums[LOST]),
            missed_energy=float(sums[MISSED]),
            largest_overlap=overlap,
            unresolved=len(self._told),
        )
        since, self._before, self._met = now.sums_since(self._before), now, (pairs, walls)
        return since

    def failure(self, count: int) -> str:
        """The first contact without a solution that the last report counts, and a remedy."""
        return self._told[0]
