"""The matrix of Newton's method for one implicit step, as blocks along the springs."""

import taichi as ti

from mpp_taichi.state.half_springs import own_entry
from mpp_taichi.types import Template


@ti.data_oriented
class NewtonMatrix:
    """A = W − b ∂F/∂x − g ∂F/∂v for displacements of the particles, W the masses; never assembled.

    A step asks for P = b a(x* + P, v* + (g/b) P), a displacement (see integrators/_implicit.py). Its residual, times the mass,
    is W (b a − P), whose derivative is −A. A contains the springs and the drag, but not the forces between all pairs: these are
    soft, and without them the iteration takes a few steps more but has the same accuracy.

    A central spring has the block S = β n nᵀ + α (1 − n nᵀ), so a half-spring keeps n, α and β: the product with a vector is a
    gather over the half-springs of a particle. Where springs are compressed α may be negative and A indefinite; `projected`
    replaces negative α and β by 0, which makes A positive definite and changes only the iterations, not the solution.
    """

    def __init__(self, total_force, dimensions: int, half_spring_count: int):
        """Bind the forces; the fields are in the state (see `fields`)."""
        self.total_force = total_force
        self.dimensions = dimensions
        self.half_spring_count = half_spring_count
        self.has_bonds = len(total_force.bonds) > 0

    def fields(self) -> dict[str, tuple[str, int]]:
        """Kind and count, for each replica, of the fields of the matrix."""
        found = {"inverse_block": ("matrix", self.total_force.particle_count)}
        if self.has_bonds:
            found["bond_direction"] = ("vector", self.half_spring_count)
            found["bond_along"] = found["bond_across"] = ("scalar", self.half_spring_count)
        return found

    @ti.func
    def weight(self, state: Template, i):
        """The mass, or 1 where no spring makes masses matter and for the massless."""
        result = ti.cast(1.0, float)
        if ti.static(hasattr(state, "mass")):
            if state.mass[i] != 0.0:
                result = ti.abs(state.mass[i])
        return result

    @ti.func
    def offset(self, first):
        """Index of the first half-spring of a replica."""
        return first // self.total_force.particle_count * self.half_spring_count

    @ti.func
    def linearize(self, state: Template, first, i, time, b, g, projected: int):
        """Row i of A at the present positions: keep the half-springs and the inverse of the diagonal block."""
        block = self.diagonal(state, i, time, g) * ti.Matrix.identity(float, self.dimensions)
        if ti.static(self.has_bonds):
            for h in range(state.spring_start[i - first], state.spring_start[i - first + 1]):
                j = first + state.spring_neighbor[h]
                separation = state.position[j] - state.position[i]
                length = ti.sqrt(separation.dot(separation))
                direction = ti.Vector.zero(float, self.dimensions)
                if length > 0.0:
                    direction = separation / length
                along = ti.cast(0.0, float)
                across = ti.cast(0.0, float)
                for bond in ti.static(self.total_force.bonds):
                    own = own_entry(state, first, h)
                    stiffness_along, stiffness_across = bond.stiffness(state, i, j, own, length)
                    damping_along, damping_across = bond.damping_rates(state, own)
                    if projected == 1:
                        stiffness_along = ti.max(stiffness_along, 0.0)
                        stiffness_across = ti.max(stiffness_across, 0.0)
                    along += b * stiffness_along + g * damping_along
                    across += b * stiffness_across + g * damping_across
                kept = self.offset(first) + h
                state.bond_direction[kept] = direction
                state.bond_along[kept] = along
                state.bond_across[kept] = across
                block += across * ti.Matrix.identity(float, self.dimensions)
                block += (along - across) * direction.outer_product(direction)
        if ti.static(state.has_fixed_axes):
            for r, c in ti.static(ti.ndrange(self.dimensions, self.dimensions)):
                block[r, c] *= state.free[i][r] * state.free[i][c]
            for r in ti.static(range(self.dimensions)):
                block[r, r] += (1.0 - state.free[i][r]) * self.weight(state, i)
        size = block.trace()  # in f32 the determinant of large numbers would be infinite
        inverse = (block / size).inverse() / size
        if ti.static(state.has_fixed_axes):
            for r, c in ti.static(ti.ndrange(self.dimensions, self.dimensions)):
                inverse[r, c] *= state.free[i][r] * state.free[i][c]
        state.inverse_block[i] = inverse

    @ti.func
    def diagonal(self, state: Template, i, time, g):
        """The part of the diagonal without springs."""
        weight = self.weight(state, i)
        result = weight
        for force in ti.static(self.total_force.external):
            result += weight * g * force.damping_rate(state, i, time)
        return result

    @ti.func
    def product(self, state: Template, first, i, time, g, x: Template):
        """Row i of A x; x is a vector field that is 0 on held axes."""
        result = self.diagonal(state, i, time, g) * x[i]
        if ti.static(self.has_bonds):
            for h in range(state.spring_start[i - first], state.spring_start[i - first + 1]):
                kept = self.offset(first) + h
                difference = x[i] - x[first + state.spring_neighbor[h]]
                direction = state.bond_direction[kept]
                across = state.bond_across[kept]
                result += across * difference + (state.bond_along[kept] - across) * direction.dot(difference) * direction
        if ti.static(state.has_fixed_axes):
            result *= state.free[i]
        return result
