"""Bonds over a whole step, for methods that conserve the energy."""

from typing import Any

import taichi as ti

from mpp_taichi.forces._base import BondForce
from mpp_taichi.types import Template


@ti.data_oriented
class StepBond(BondForce):
    """A bond whose force and stiffness hold over a whole step."""

    def __init__(self, bond: Any):
        """Bind the bond."""
        self.bond = bond
        self.needs = bond.needs
        self.conserves_energy = bond.conserves_energy
        self.depends_on_velocity = bond.depends_on_velocity

    @ti.func
    def force(self, state: Template, i, j, h):
        """The bond's `step_force`."""
        return self.bond.step_force(state, i, j, h)

    @ti.func
    def stiffness(self, state: Template, i, j, h, length):
        """The bond's `step_stiffness`."""
        return self.bond.step_stiffness(state, i, j, h, length)

    @ti.func
    def damping_rates(self, state: Template, h):
        """The damping rates of the bond."""
        return self.bond.damping_rates(state, h)
