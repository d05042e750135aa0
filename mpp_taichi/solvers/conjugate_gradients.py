"""Conjugate gradients with the inverse of the diagonal blocks as preconditioner; matrix-free."""

import taichi as ti

from mpp_taichi.solvers._sums import dot, read_total, reduce_terms, zero_pair
from mpp_taichi.solvers.newton_matrix import NewtonMatrix
from mpp_taichi.types import Template

FORCING = 1e-4  # factor by which the residual falls before the next iteration of Newton
ROUND_OFF_ROOM = 10  # iterations allowed per unknown; exact arithmetic needs one


@ti.data_oriented
class ConjugateGradients:
    """Solve A δ = r for symmetric positive definite A.

    Where it finds a direction of negative curvature, the solver says so, and Newton uses a projected matrix.

    Source: Hestenes & Stiefel, J. Res. Natl. Bur. Stand. 49 (1952) 409; the stopping rule belongs to an inexact Newton method,
    Dembo, Eisenstat & Steihaug, SIAM J. Numer. Anal. 19 (1982) 400.
    """

    def __init__(self, matrix: NewtonMatrix):
        """Bind the matrix."""
        self.matrix = matrix
        self.limit = ROUND_OFF_ROOM * matrix.dimensions * matrix.total_force.particle_count + 20

    def fields(self) -> dict[str, tuple[str, int]]:
        """Preconditioned residual, direction, product."""
        count = self.matrix.total_force.particle_count
        return {name: ("vector", count) for name in ("preconditioned", "direction", "product")}

    # The part of one particle in each sweep; the results are summed over the particles

    @ti.func
    def begin(self, state: Template, i):
        """δ = 0, z = B r, p = z; returns r·z."""
        state.residual[i] = state.right_side[i]
        z = state.inverse_block[i] @ state.residual[i]
        state.update[i] = ti.Vector.zero(float, state.dimensions)
        state.preconditioned[i] = z
        state.direction[i] = z
        return ti.Vector([dot(state, state.residual[i], z), ti.cast(0.0, state.wide)])

    @ti.func
    def multiply(self, state: Template, first, i, time, g):
        """q = A p; returns p·q."""
        q = self.matrix.product(state, first, i, time, g, state.direction)
        state.product[i] = q
        return ti.Vector([dot(state, state.direction[i], q), ti.cast(0.0, state.wide)])

    @ti.func
    def advance(self, state: Template, i, step):
        """δ += step·p, r −= step·q, z = B r; returns r·z."""
        state.update[i] = state.update[i] + step * state.direction[i]
        r = state.residual[i] - step * state.product[i]
        state.residual[i] = r
        z = state.inverse_block[i] @ r
        state.preconditioned[i] = z
        return ti.Vector([dot(state, r, z), ti.cast(0.0, state.wide)])

    @ti.func
    def turn(self, state: Template, i, share):
        """p = z + share·p."""
        state.direction[i] = state.preconditioned[i] + share * state.direction[i]

    # One thread

    @ti.func
    def solve_serial(self, state: Template, first, time, g):
        """Solve; returns (iterations, δ·r at the start, 1 when the matrix turned out not to be positive definite)."""
        end = first + self.matrix.total_force.particle_count
        now = zero_pair(state)
        for i in range(first, end):
            now += self.begin(state, i)
        squared = now[0]
        goal = squared * (FORCING * FORCING)
        slope = ti.cast(0.0, state.wide)
        indefinite = 0
        if not squared >= 0.0:
            indefinite = 1
        iterations = 0
        while squared > goal and indefinite == 0 and iterations < self.limit:
            curvature = zero_pair(state)
            for i in range(first, end):
                curvature += self.multiply(state, first, i, time, g)
            if not curvature[0] > 0.0:
                indefinite = 1
            else:
                step = squared / curvature[0]
                slope += step * squared
                after = zero_pair(state)
                for i in range(first, end):
                    after += self.advance(state, i, ti.cast(step, float))
                share = ti.cast(after[0] / squared, float)
                for i in range(first, end):
                    self.turn(state, i, share)
                squared = after[0]
                if not squared >= 0.0:
                    indefinite = 1
                iterations += 1
        return iterations, slope, indefinite

    # All particles at once

    def solve_parallel(self, state, time: float, g: float) -> tuple[int, float, bool]:
        """Solve with a launch for each sweep; returns the same as `solve_serial`."""
        self._begin(state)
        squared = read_total(state)[0]
        goal, slope, iterations = squared * FORCING**2, 0.0, 0
        while squared > goal and iterations < self.limit:
            self._multiply(state, time, g)
            curvature = read_total(state)[0]
            if not curvature > 0.0:
                return iterations, slope, True
            step = squared / curvature
            slope += step * squared
            self._advance(state, step)
            after = read_total(state)[0]
            self._turn(state, after / squared)
            squared = after
            iterations += 1
        return iterations, slope, not squared >= 0.0

    @ti.kernel
    def _begin(self, state: Template):
        for i in range(state.particle_count):
            state.terms[i] = self.begin(state, i)
        reduce_terms(state)

    @ti.kernel
    def _multiply(self, state: Template, time: float, g: float):
        for i in range(state.particle_count):
            state.terms[i] = self.multiply(state, 0, i, time, g)
        reduce_terms(state)

    @ti.kernel
    def _advance(self, state: Template, step: float):
        for i in range(state.particle_count):
            state.terms[i] = self.advance(state, i, step)
        reduce_terms(state)

    @ti.kernel
    def _turn(self, state: Template, share: float):
        for i in range(state.particle_count):
            self.turn(state, i, share)
