"""Direct solution of Newton's systems: LDLᵀ of a banded matrix, which for a few particles is a dense one."""

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.ordering import bandwidth
from mpp_taichi.solvers._sums import dot
from mpp_taichi.solvers.newton_matrix import NewtonMatrix
from mpp_taichi.types import Template


@ti.data_oriented
class Banded:
    """Solve A δ = r by A = L D Lᵀ without pivoting, in one thread; O(n w²) for n unknowns of half-bandwidth w.

    The particles are in an order in which springs are short (ordering.py): a chain has w = 2·dimensions − 1 at any length. A
    pivot that is not positive means that A is not positive definite; the solver says so, and Newton uses a projected matrix.
    Source: Golub & Van Loan, Matrix Computations, §4.3.
    """

    def __init__(self, matrix: NewtonMatrix, order: np.ndarray, between: np.ndarray):
        """Bind the matrix; `order` gives each particle's place, `between` the ends of the springs."""
        self.matrix = matrix
        self.order = order
        self.width = (bandwidth(order, between) + 1) * matrix.dimensions - 1
        self.row_count = matrix.dimensions * matrix.total_force.particle_count
        self.stride = self.width + 1

    def fields(self) -> dict[str, tuple[str, int]]:
        """The band, one row after the other, the diagonal last in each; a column; the places of the particles."""
        return {
            "band": ("scalar", self.row_count * self.stride),
            "column": ("scalar", self.row_count),
            "place": ("index", len(self.order)),
        }

    @ti.func
    def assemble(self, state: Template, first, time, g):
        """Lower band of A; entry (r, c) is at r·stride + width − (r − c)."""
        dimensions = ti.static(self.matrix.dimensions)
        base = self.replica(first) * self.row_count * self.stride
        for k in range(base, base + self.row_count * self.stride):
            state.band[k] = 0.0
        for i in range(first, first + self.matrix.total_force.particle_count):
            block = self.matrix.diagonal(state, i, time, g) * ti.Matrix.identity(float, dimensions)
            row = state.place[i] * dimensions
            if ti.static(self.matrix.has_bonds):
                for h in range(state.spring_start[i - first], state.spring_start[i - first + 1]):
                    kept = self.matrix.offset(first) + h
                    direction = state.bond_direction[kept]
                    across = state.bond_across[kept]
                    spring = across * ti.Matrix.identity(float, dimensions)
                    spring += (state.bond_along[kept] - across) * direction.outer_product(direction)
                    block += spring
                    j = first + state.spring_neighbor[h]
                    column = state.place[j] * dimensions
                    if column < row:
                        for r, c in ti.static(ti.ndrange(dimensions, dimensions)):
                            free = ti.cast(1.0, float)
                            if ti.static(state.has_fixed_axes):
                                free = state.free[i][r] * state.free[j][c]
                            at = base + (row + r) * self.stride + self.width - (row + r - column - c)
                            state.band[at] = state.band[at] - free * spring[r, c]
            for r in ti.static(range(dimensions)):
                for c in ti.static(range(r + 1)):
                    value = block[r, c]
                    if ti.static(state.has_fixed_axes):
                        value *= state.free[i][r] * state.free[i][c]
                        if ti.static(r == c):
                            value += (1.0 - state.free[i][r]) * self.matrix.weight(state, i)
                    at = base + (row + r) * self.stride + self.width - (r - c)
                    state.band[at] = state.band[at] + value

    @ti.func
    def factorize(self, state: Template, first):
        """A → L below the diagonal, D on it; returns 1 when a pivot is not positive."""
        base = self.replica(first) * self.row_count * self.stride
        indefinite = 0
        for r in range(self.row_count):
            # Entry (r, c) is at `own + c`.
            own = base + r * self.stride + self.width - r
            lowest = ti.max(0, r - self.width)
            pivot = state.band[own + r]
            for c in range(lowest, r):
                other = base + c * self.stride + self.width - c
                value = state.band[own + c]
                for k in range(ti.max(lowest, c - self.width), c):
                    value -= state.band[own + k] * state.band[other + k]
                state.band[own + c] = value
            for c in range(lowest, r):
                value = state.band[own + c]
                scaled = value / state.band[base + c * self.stride + self.width]
                state.band[own + c] = scaled
                pivot -= value * scaled
            state.band[own + r] = pivot
            if not pivot > 0.0:
                indefinite = 1
        return indefinite

    @ti.func
    def substitute(self, state: Template, first):
        """δ = L⁻ᵀ D⁻¹ L⁻¹ r."""
        dimensions = ti.static(self.matrix.dimensions)
        base = self.replica(first) * self.row_count * self.stride
        at = self.replica(first) * self.row_count
        for i in range(first, first + self.matrix.total_force.particle_count):
            for k in ti.static(range(dimensions)):
                state.column[at + state.place[i] * dimensions + k] = state.right_side[i][k]
        for r in range(self.row_count):
            own = base + r * self.stride + self.width - r
            value = state.column[at + r]
            for c in range(ti.max(0, r - self.width), r):
                value -= state.band[own + c] * state.column[at + c]
            state.column[at + r] = value
        for r in range(self.row_count):
            state.column[at + r] /= state.band[base + r * self.stride + self.width]
        for back in range(self.row_count):
            r = self.row_count - 1 - back
            own = base + r * self.stride + self.width - r
            value = state.column[at + r]
            for c in range(ti.max(0, r - self.width), r):
                state.column[at + c] = state.column[at + c] - state.band[own + c] * value
        for i in range(first, first + self.matrix.total_force.particle_count):
            for k in ti.static(range(dimensions)):
                state.update[i][k] = state.column[at + state.place[i] * dimensions + k]

    @ti.func
    def solve_serial(self, state: Template, first, time, g):
        """Solve; returns (1, δ·r, 1 when the matrix is not positive definite)."""
        self.assemble(state, first, time, g)
        indefinite = self.factorize(state, first)
        slope = ti.cast(0.0, state.wide)
        if indefinite == 0:
            self.substitute(state, first)
            for i in range(first, first + self.matrix.total_force.particle_count):
                slope += dot(state, state.update[i], state.right_side[i])
        return 1, slope, indefinite

    def solve_parallel(self, state, time: float, g: float) -> tuple[int, float, bool]:
        """Solve for all particles in a launch of one thread; returns the same as `solve_serial`."""
        indefinite = bool(self._solve(state, time, g))
        return 1, float(state.term_total[0][0]), indefinite

    @ti.kernel
    def _solve(self, state: Template, time: float, g: float) -> ti.i32:
        result = 0
        ti.loop_config(serialize=True)
        for one in range(1):
            _iterations, slope, indefinite = self.solve_serial(state, 0, time, g)
            state.term_total[one] = ti.Vector([slope, ti.cast(0.0, state.wide)])
            result = indefinite
        return result

    @ti.func
    def replica(self, first):
        """Number of the replica."""
        return first // self.matrix.total_force.particle_count
