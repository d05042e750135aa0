"""The paths of spheres within a step of an adaptive method, and for how long no contact is possible on them."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.types import Template

ROUNDINGS = 8.0  # of a coordinate, by which a position on a path may be wrong
TIME_ROUNDING = 2.0**-52


@ti.data_oriented
class StepPaths:
    """The polynomials of a step, x_i(s) = Σ_m c_m s^m, s = 0 … 1 the share of the step, and bounds over the whole step.

    coefficient        c_m of sphere i at m · count + i [length]
    state.way          Σ m |c_m| ≥ |x′| [length]
    state.start_blur   error of a position by the rounding of its start and of times [length]
    """

    BOUNDS = ("way", "start_blur")

    def __init__(self, state: Any, degree: int) -> None:
        """Allocate for the spheres of a State that has the BOUNDS."""
        self.state, self.degree = state, degree
        self.count, self.dimensions = state.particle_count, state.dimensions
        real = np.float32 if ti.lang.impl.current_cfg().default_fp == ti.f32 else np.float64
        self.epsilon = float(np.finfo(real).eps)
        self.rounding = ROUNDINGS * self.epsilon
        self.coefficient = ti.Vector.field(self.dimensions, float)
        builder = ti.FieldsBuilder()
        builder.dense(ti.i, (degree + 1) * self.count).place(self.coefficient)
        self._tree: Any = builder.finalize()

    def destroy(self) -> None:
        """Give the memory back."""
        self._tree.destroy()

    @ti.func
    def take(self, state: Template, total_force: Template, integrator: Template):
        """Take the paths of the present step of the integrator."""
        integrator.write_paths(state, total_force, self.coefficient)
        begin, h = state.clock[0], state.clock[1]
        lag = ti.cast(TIME_ROUNDING * ti.max(ti.abs(begin), ti.abs(begin + h)) / h, float)
        for i in range(self.count):
            way = 0.0
            for m in range(1, self.degree + 1):
                way += m * self.coefficient[m * self.count + i].norm()
            self.state.way[i] = way
            self.state.start_blur[i] = self.rounding * self.coefficient[i].norm() + way * lag

    @ti.func
    def place(self, i, s):
        """Position of sphere i at the share s [length], and its derivative with s [length]."""
        x = self.coefficient[self.degree * self.count + i]
        v = ti.Vector.zero(float, self.dimensions)
        for back in range(self.degree):
            v = v * s + x
            x = x * s + self.coefficient[(self.degree - 1 - back) * self.count + i]
        return x, v

    @ti.func
    def bend(self, i):
        """Σ m (m − 1) |c_m| ≥ |x″| [length]."""
        result = 0.0
        for m in range(2, self.degree + 1):
            result += m * (m - 1) * self.coefficient[m * self.count + i].norm()
        return result

    @ti.func
    def bend_between(self, i, j):
        """Bound of |x″| for the path of j relative to i, without their common motion."""
        result = 0.0
        for m in range(2, self.degree + 1):
            result += m * (m - 1) * (self.coefficient[m * self.count + j] - self.coefficient[m * self.count + i]).norm()
        return result

    @ti.func
    def bend_along(self, i, n):
        """Bound of |n·x″| for sphere i."""
        result = 0.0
        for m in range(2, self.degree + 1):
            result += m * (m - 1) * ti.abs(self.coefficient[m * self.count + i].dot(n))
        return result

    @ti.func
    def blur(self, i, s):
        """Error of the position of sphere i at the share s, by the rounding of positions and of the time [length]."""
        return self.state.start_blur[i] + self.rounding * self.state.way[i] * s

    @ti.func
    def wall_blur(self, walls: Template, k: Template, i, s, time):
        """Error of the distance of sphere i from surface k, which may move."""
        speed = walls.velocity(k, ti.Vector.zero(float, self.dimensions), time).norm()
        extent = walls.extent(k, self.dimensions) + speed * ti.abs(time)
        return self.blur(i, s) + self.rounding * extent

    @ti.func
    def last_wait(self, gap, rate, bend):
        """The share of a step in which a gap closes at a rate < 0, by the bound of `least_wait`."""
        rest = ti.max(gap, 0.0)
        return 2.0 * rest / (ti.sqrt(rate * rate + 2.0 * bend * rest) - rate)

    @ti.func
    def least_wait(self, gap, rate, bend, blur, slowest, s):
        """A share of the step, from s on, within which a gap certainly does not close.

        With gap″ ≥ −bend, gap(s + w) ≥ gap + rate w − bend w²/2, which is 0 at w = (rate + √(rate² + 2 bend gap)) / bend. A
        search that waits so long again and again never goes beyond a contact, and converges to it as Newton's method does. A
        gap that is closed within its blur, and opens or closes by less than `slowest`, is closed again after 2 rate / bend at
        the earliest; if it is an overlap, it closes further after rate / bend at the earliest.
        """
        result = ti.math.inf
        if gap > blur:
            root = ti.sqrt(rate * rate + 2.0 * bend * gap)
            if rate < 0.0:
                result = 2.0 * gap / (root - rate)
            elif bend > 0.0:
                result = (rate + root) / bend
        elif bend > 0.0:
            twice = 2.0 if rate > 0.0 and gap >= -blur else 1.0
            result = (twice * rate + 2.0 * slowest) / bend
        return ti.max(result, 4.0 * self.epsilon * s)
