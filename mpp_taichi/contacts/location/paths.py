"""The paths of spheres within a step of an adaptive method, and how long two things on such paths cannot touch."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.types import Template
from mpp_taichi.walls import _geometry

ROUNDINGS = 8.0  # of a coordinate, that a place on a path may be wrong by
TIME_ROUNDING = 2.0**-52


@ti.data_oriented
class StepPaths:
    """The polynomials of a step, x_i(s) = Σ_m c_m s^m, s = 0 … 1 the share of it, and bounds of what they do over all of it.

    coefficient        c_m of sphere i at m · count + i [length]
    state.way          Σ m |c_m| ≥ |x′| [length]
    state.start_blur   what rounding of its start, and of times, makes of a place [length]
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
        """The step that the integrator is in."""
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
        """Where sphere i is [length], and its velocity in lengths per step."""
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
        """The same of the path of j as i sees it: what moves both alike is not in it."""
        result = 0.0
        for m in range(2, self.degree + 1):
            result += m * (m - 1) * (self.coefficient[m * self.count + j] - self.coefficient[m * self.count + i]).norm()
        return result

    @ti.func
    def bend_along(self, i, n):
        """The same of n·x."""
        result = 0.0
        for m in range(2, self.degree + 1):
            result += m * (m - 1) * ti.abs(self.coefficient[m * self.count + i].dot(n))
        return result

    @ti.func
    def blur(self, i, s):
        """What rounding of places and of the time makes of the place of sphere i [length]."""
        return self.state.start_blur[i] + self.rounding * self.state.way[i] * s

    @ti.func
    def wall_blur(self, surface: Template, i, s, time):
        """The same of its distance from a surface, which may move."""
        point = ti.Vector([surface.point[c] for c in ti.static(range(self.dimensions))], float)
        speed = _geometry.surface_velocity(surface, point).norm()
        extent = point.norm() + surface.radius + speed * ti.abs(time)
        return self.blur(i, s) + self.rounding * extent

    @ti.func
    def last_wait(self, gap, rate, bend):
        """The share in which what is left of a gap closes at a rate < 0, by the bound of `least_wait`."""
        rest = ti.max(gap, 0.0)
        return 2.0 * rest / (ti.sqrt(rate * rate + 2.0 * bend * rest) - rate)

    @ti.func
    def least_wait(self, gap, rate, bend, blur, slowest, s):
        """A share of the step for which two things certainly do not come to touch, at s: the gap is `gap` > 0, or touches.

        With gap″ ≥ −bend, gap(s + w) ≥ gap + rate w − bend w²/2, which is 0 at w = (rate + √(rate² + 2 bend gap)) / bend. So a
        search that waits so long again and again never goes beyond a contact, and comes to it as Newton's method does.
        Things that touch and open, or approach by less than can be told, are back after 2 rate / bend, or approach after
        rate / bend if they overlap.
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
