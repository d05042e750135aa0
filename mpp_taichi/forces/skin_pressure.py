"""Pressure of a gas inside a closed skin in the plane."""

import taichi as ti

from mpp_taichi.arithmetic.gas_law import pressure_share, work_share
from mpp_taichi.arithmetic.particle_update import wide_position
from mpp_taichi.arithmetic.polygon_area import signed_area
from mpp_taichi.component import Particles, component, param
from mpp_taichi.forces._base import ExternalForce
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.types import Template


@component
class SkinPressure(ExternalForce):
    """Pressure inside a polygon of particles, F_i = ½ (p − p_out) (y_{i+1} − y_{i−1}, x_{i−1} − x_{i+1}), p = p₀ (A₀/A)^γ.

    The particles of the group, in their order, are the corners of a closed skin in the plane; the last is beside the first.
    A = ½ |Σ (x_i y_{i+1} − x_{i+1} y_i)| is the area inside, A₀ the area at the start of the scene, and γ the exponent: 0 for
    a constant pressure, 1 for a gas of constant temperature, 2 for an adiabatic gas of points in the plane. The sum of the
    forces and their torque are 0, and the energy is the work of the gas, −∫ (p − p_out) dA from A₀ on. A skin that crosses
    itself has the area of the formula. The scene must have `dimensions: 2`.
    Source: Landau & Lifshitz, Fluid Mechanics (1987), §2.
    """

    of: Particles = param(help="the group whose particles are the corners of the skin, in their order, three or more")
    pressure: float = param(strength=True, minimum=0.0, unit="force length⁻¹", help="pressure p₀ inside at the start")
    outside: float = param(0.0, minimum=0.0, unit="force length⁻¹", help="pressure p_out outside")
    exponent: float = param(1.0, minimum=0.0, help="exponent γ of the pressure in the area")
    name: str = param(None, optional=True, help="a name, which several of these forces in a scene need")
    needs = frozenset({"mass"})
    gathers = True
    encloses = True
    start_area = 1.0

    @property
    def has_functions(self) -> tuple[str, ...]:
        """A power of the area, unless it is a whole power."""
        return () if self.exponent in (0.0, 1.0) else ("pow",)

    @property
    def area_field(self) -> str:
        """The name of the field that has the area of each copy."""
        return f"skin_area_{self.of[0]}"

    def see(self, start: Snapshot) -> None:
        """Take the area at the start of the scene."""
        place = start.position[self.of[0] : self.of[0] + self.of[1], :2]
        self.start_area = abs(signed_area(place))

    def work_fields(self) -> dict[str, tuple[str, int]]:
        """The area."""
        return {self.area_field: ("wide", 1)}

    @ti.func
    def meet(self, state: Template, first, time):
        """Sum the area up, in one thread, before the forces are summed."""
        for _ in range(1):
            ti.static(getattr(state, self.area_field))[first // state.particle_count] = self.area(state, first)

    @ti.func
    def area(self, state: Template, first):
        """The area with its sign, above 0 where the corners go round from x to y, about the first corner."""
        begin = first + self.of[0]
        origin = wide_position(state, begin)
        result = ti.cast(0.0, state.wide)
        for k in range(1, self.of[1] - 1):
            one, other = wide_position(state, begin + k) - origin, wide_position(state, begin + k + 1) - origin
            result += 0.5 * (one[0] * other[1] - one[1] * other[0])
        return result

    @ti.func
    def accelerate(self, state: Template, i, velocity, time):
        """½ (p − p_out) times the normal between both neighbours, over the mass."""
        result = ti.Vector.zero(float, state.dimensions)
        first = i // state.particle_count * state.particle_count
        corner = i - first - self.of[0]
        if corner >= 0 and corner < self.of[1]:
            begin = first + self.of[0]
            before = state.position[begin + (corner + self.of[1] - 1) % self.of[1]]
            after = state.position[begin + (corner + 1) % self.of[1]]
            signed = ti.static(getattr(state, self.area_field))[first // state.particle_count]
            push = 0.5 * self.pressure_in(ti.cast(ti.abs(signed), float)) / state.mass[i]
            if signed < 0.0:
                push = -push
            result[0] = push * (after[1] - before[1])
            result[1] = push * (before[0] - after[0])
        return result

    @ti.func
    def pressure_in(self, area):
        """p₀ (A₀/A)^γ − p_out."""
        return self.pressure * pressure_share(self.exponent, self.start_area, area) - self.outside

    @ti.func
    def potential(self, state: Template, i, time):
        """−∫ (p − p_out) dA from A₀ to A, as the share of the first corner."""
        result = ti.cast(0.0, state.wide)
        first = i // state.particle_count * state.particle_count
        if i - first == self.of[0]:
            area = ti.abs(self.area(state, first))
            share = area / ti.cast(self.start_area, state.wide)
            work = work_share(state, self.exponent, share)
            outside = ti.cast(self.outside * self.start_area, state.wide) * (share - 1.0)
            result = outside - ti.cast(self.pressure * self.start_area, state.wide) * work
        return result
