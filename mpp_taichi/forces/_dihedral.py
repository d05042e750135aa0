"""Forces that depend on the dihedral angle of four particles in a row: how far a chain is twisted about its middle link.

With the links b₁ = x₂ − x₁, b₂ = x₃ − x₂, b₃ = x₄ − x₃ and the normals A = b₁ × b₂, B = b₂ × b₃ of both planes

    sin φ = |b₂| b₁·B / (|A| |B|)    cos φ = A·B / (|A| |B|)
    ∂φ/∂x₁ = −|b₂| A/A²              ∂φ/∂x₂ = |b₂| ((1 + p) A/A² + q B/B²)       p = b₁·b₂/b₂²
    ∂φ/∂x₄ =  |b₂| B/B²              ∂φ/∂x₃ = −|b₂| (p A/A² + (1 + q) B/B²)      q = b₃·b₂/b₂²

without a quotient by sin φ, so that φ = 0 and φ = π are places like others. Singular is a line of three particles, where A or B
is 0 and φ has no value: there the force is set to 0, and near by it is as 1/|A|. Forces and torques on the four add up to 0.
Source: Blondel & Karplus, J. Comput. Chem. 17 (1996) 1132.
"""

import taichi as ti

from mpp_taichi.arithmetic.force_numbers import root
from mpp_taichi.arithmetic.inverse_distance import inverse_root
from mpp_taichi.arithmetic.particle_update import separation, wide_position
from mpp_taichi.forces._base import ExternalForce
from mpp_taichi.types import Template


@ti.data_oriented
class DihedralForce(ExternalForce):
    """A force by a potential V(φ) of dihedral angles; a subclass gives V and V′ by the sine and the cosine of φ.

    `of` has four groups of one count. Each particle sums over the places that it has in a row, and computes the angle for each,
    so that the force needs no field and no order of threads.
    """

    of: tuple[tuple[int, int], ...]
    needs = frozenset({"mass"})
    twists = True

    @ti.func
    def slope(self, sine, cosine):
        """V′(φ)."""

    @ti.func
    def energy(self, sine, cosine):
        """V(φ)."""

    @ti.func
    def accelerate(self, state: Template, i, velocity, time):
        """−V′ ∂φ/∂x over the mass, summed over the places of the particle."""
        result = ti.Vector.zero(float, state.dimensions)
        own = i % state.particle_count
        first = i - own
        for place in ti.static(range(4)):
            row = own - self.of[place][0]
            if row >= 0 and row < self.of[place][1]:
                result -= self.slope_along(state, first, row, place)
        return result / state.mass[i]

    @ti.func
    def slope_along(self, state: Template, first, row, place: Template):
        """V′ ∂φ/∂x of one of the four particles in a row."""
        one, two, three, four = [first + self.of[each][0] + row for each in ti.static(range(4))]
        before, middle, after = separation(state, one, two), separation(state, two, three), separation(state, three, four)
        a, b = before.cross(middle), middle.cross(after)
        a_squared, b_squared, squared = a.dot(a), b.dot(b), middle.dot(middle)
        result = ti.Vector.zero(float, 3)
        if a_squared > 0.0 and b_squared > 0.0:
            length = root(squared)
            both = inverse_root(a_squared) * inverse_root(b_squared)
            factor = length * self.slope(length * before.dot(b) * both, a.dot(b) * both)
            if ti.static(place == 0):
                result = -(factor / a_squared) * a
            elif ti.static(place == 3):
                result = (factor / b_squared) * b
            else:
                p, q = before.dot(middle) / squared, after.dot(middle) / squared
                if ti.static(place == 1):
                    result = ((1.0 + p) * factor / a_squared) * a + (q * factor / b_squared) * b
                else:
                    result = -(p * factor / a_squared) * a - ((1.0 + q) * factor / b_squared) * b
        return result

    @ti.func
    def potential(self, state: Template, i, time):
        """V of the row whose first particle this is; 0 where an angle has no value."""
        result = ti.cast(0.0, state.wide)
        own = i % state.particle_count
        row = own - self.of[0][0]
        if row >= 0 and row < self.of[0][1]:
            places = [wide_position(state, i - own + self.of[each][0] + row) for each in ti.static(range(4))]
            before, middle, after = places[1] - places[0], places[2] - places[1], places[3] - places[2]
            a, b = before.cross(middle), middle.cross(after)
            if a.dot(a) > 0.0 and b.dot(b) > 0.0:
                both = inverse_root(a.dot(a)) * inverse_root(b.dot(b))
                sine = ti.sqrt(middle.dot(middle)) * before.dot(b) * both
                result = ti.cast(self.energy(sine, a.dot(b) * both), state.wide)
        return result
