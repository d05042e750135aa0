"""Integrator: owns one whole step, written once and run by every execution plan."""

import taichi as ti

from mpp_taichi.types import Template


@ti.data_oriented
class Integrator:
    """What every integrator declares.

    order            of the global error in dt
    symplectic       keeps the energy of a conservative system bounded for ever
    time_reversible  a step of −dt undoes a step of dt, to round-off
    scratch_count    how many vector fields it needs from State
    evaluations      of the velocity-independent force per step
    """

    order = 0
    symplectic = False
    time_reversible = False
    evaluations = 0

    def scratch_count(self, velocity_dependent: bool) -> int:
        """Vector fields beyond position, velocity and acceleration."""
        raise TypeError(f"{type(self).__name__} does not say what it needs")

    @ti.func
    def prepare(self, state: Template, total_force: Template, first, time, shape: Template):
        """Compute what the first step expects to find; run once when the state was set from outside."""

    @ti.func
    def step(self, state: Template, total_force: Template, first, time, dt, shape: Template):
        """Advance the particles first … first + particle_count − 1 from `time` to `time + dt`."""
