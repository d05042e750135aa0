"""Pressure of a gas inside a closed skin in space."""

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.closed_skin import MOST_NEIGHBORS, enclosed_volume, rings
from mpp_taichi.arithmetic.gas_law import pressure_share, work_share
from mpp_taichi.arithmetic.particle_update import wide_position
from mpp_taichi.component import Particles, component, param
from mpp_taichi.forces._base import ExternalForce
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.types import Template


@component
class ShellPressure(ExternalForce):
    """Pressure inside a closed skin of triangles, F_i = (p − p_out) ∂V/∂x_i, p = p₀ (V₀/V)^γ.

    The particles of the group are the corners of a geodesic sphere, as the generator `shell` makes them, 10 ν² + 2 in number,
    or the four corners of a tetrahedron. They may be anywhere; only their order says which of them are neighbours.
    ∂V/∂x_i = Σ (x_j − x_i) × (x_k − x_i)/6 over the triangles i j k around the corner. V = |Σ x_i·∂V/∂x_i|/3 is the volume
    inside, V₀ the volume at the start of the scene, and γ the exponent: 0 for a constant pressure, 1 for a gas of constant
    temperature, 5/3 for an adiabatic gas of points. The sum of the forces and their torque are 0, and the energy is the work of
    the gas, −∫ (p − p_out) dV from V₀ on. A skin that crosses itself has the volume of the formula. The scene must have three
    dimensions.
    Source: Landau & Lifshitz, Fluid Mechanics (1987), §2.
    """

    of: Particles = param(help="the group whose particles are the corners of the skin, made by `shell`, or four particles")
    pressure: float = param(strength=True, minimum=0.0, unit="force length⁻²", help="pressure p₀ inside at the start")
    outside: float = param(0.0, minimum=0.0, unit="force length⁻²", help="pressure p_out outside")
    exponent: float = param(1.0, minimum=0.0, help="exponent γ of the pressure in the volume")
    name: str = param(None, optional=True, help="a name, which several of these forces in a scene need")
    needs = frozenset({"mass"})
    gathers = True
    encloses_volume = True
    start_volume = 1.0

    @property
    def has_functions(self) -> tuple[str, ...]:
        """A power of the volume, unless it is a whole power."""
        return () if self.exponent in (0.0, 1.0) else ("pow",)

    @property
    def volume_field(self) -> str:
        """The name of the field that has the volume of each copy."""
        return f"shell_volume_{self.of[0]}"

    def see(self, start: Snapshot) -> None:
        """Take the volume at the start of the scene, and put the neighbours of each corner on the device."""
        first, count = self.of
        self.start_volume = abs(enclosed_volume(start.position[first : first + count]))
        self.ring = ti.field(ti.i32, count * MOST_NEIGHBORS)
        self.ring.from_numpy(rings(count).ravel().astype(np.int32))

    def work_fields(self) -> dict[str, tuple[str, int]]:
        """The volume."""
        return {self.volume_field: ("wide", 1)}

    @ti.func
    def meet(self, state: Template, first, time):
        """Sum the volume up, in one thread, before the forces are summed."""
        for _ in range(1):
            ti.static(getattr(state, self.volume_field))[first // state.particle_count] = self.volume(state, first)

    @ti.func
    def volume(self, state: Template, first):
        """The volume with its sign, above 0 where the triangles are seen from outside against the clock."""
        result = ti.cast(0.0, state.wide)
        if ti.static(state.dimensions == 3):
            begin = first + self.of[0]
            origin = wide_position(state, begin)
            for corner in range(1, self.of[1]):
                place = wide_position(state, begin + corner)
                slope = ti.Vector.zero(state.wide, 3)
                one = wide_position(state, begin + self.ring[MOST_NEIGHBORS * corner + MOST_NEIGHBORS - 1]) - place
                for k in range(MOST_NEIGHBORS):
                    other = wide_position(state, begin + self.ring[MOST_NEIGHBORS * corner + k]) - place
                    slope += one.cross(other)
                    one = other
                result += slope.dot(place - origin)
        return result / 18.0

    @ti.func
    def accelerate(self, state: Template, i, velocity, time):
        """(p − p_out) times the slope of the volume, over the mass."""
        result = ti.Vector.zero(float, state.dimensions)
        if ti.static(state.dimensions == 3):
            first = i // state.particle_count * state.particle_count
            corner = i - first - self.of[0]
            if corner >= 0 and corner < self.of[1]:
                begin = first + self.of[0]
                signed = ti.static(getattr(state, self.volume_field))[first // state.particle_count]
                push = self.pressure_in(ti.cast(ti.abs(signed), float)) / (6.0 * state.mass[i])
                if signed < 0.0:
                    push = -push
                place = state.position[i]
                one = state.position[begin + self.ring[MOST_NEIGHBORS * corner + MOST_NEIGHBORS - 1]] - place
                for k in range(MOST_NEIGHBORS):
                    other = state.position[begin + self.ring[MOST_NEIGHBORS * corner + k]] - place
                    result[0] += push * (one[1] * other[2] - one[2] * other[1])
                    result[1] += push * (one[2] * other[0] - one[0] * other[2])
                    result[2] += push * (one[0] * other[1] - one[1] * other[0])
                    one = other
        return result

    @ti.func
    def pressure_in(self, volume):
        """p₀ (V₀/V)^γ − p_out."""
        return self.pressure * pressure_share(self.exponent, self.start_volume, volume) - self.outside

    @ti.func
    def potential(self, state: Template, i, time):
        """−∫ (p − p_out) dV from V₀ to V, as the share of the first corner."""
        result = ti.cast(0.0, state.wide)
        first = i // state.particle_count * state.particle_count
        if ti.static(state.dimensions == 3):
            if i - first == self.of[0]:
                start = ti.cast(self.start_volume, state.wide)
                share = ti.abs(self.volume(state, first)) / start
                work = work_share(state, self.exponent, share)
                outside = ti.cast(self.outside, state.wide) * start * (share - 1.0)
                result = outside - ti.cast(self.pressure, state.wide) * start * work
        return result
