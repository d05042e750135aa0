"""A lattice of particles: a chain, a rope, a sheet or a block."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from mpp_taichi.component import Axes, Color, FormulaVector, Shape, Vector, component, param
from mpp_taichi.errors import PlacementError
from mpp_taichi.generators._base import Generator, GeneratorContext, Group, make_group
from mpp_taichi.scene.expressions import ExpressionError


@component
class Lattice(Generator):
    """Particles at equal distances along one, two or three axes; the first axis varies fastest in the index.

    u, v, w run from 0 to 1 along the axes (0 on an axis of one particle): mode (r, s) of a sheet whose rim is held is the
    displacement sin(r * pi * u) * sin(s * pi * v). Springs without a given rest length are at rest where the particles
    have no displacement and no scatter.

    `fixed` says which particles are held. rim: the particles at the ends of every axis. first or last: the particles at one end
    of the first axis (a cantilever's column, a rope's end). ends: the particles at both ends of the first axis. corners: the
    particles at the ends of all axes at once. upper_corners: the corners at the upper end of the last axis, from which a cloth
    hangs.
    """

    name: str = param("", help="name of the lattice, by which springs refer to it")
    shape: Shape = param(help="numbers of particles along the axes, for example [8, 8]")
    lower: Vector = param(unit="length", help="position of the first particle, a corner of the lattice")
    upper: Vector = param(unit="length", help="position of the last particle, the opposite corner")
    mass: float = param(1.0, minimum=0.0, unit="mass", help="mass of each particle")
    radius: float = param(0.0, minimum=0.0, unit="length")
    charge: float = param(0.0, unit="charge", help="charge of each particle")
    color: Color = param((0.9, 0.9, 0.9), help="red, green, blue in 0…1")
    fixed: str = param(
        "none",
        choices=("none", "rim", "first", "last", "ends", "corners", "upper_corners"),
        help="the particles that are held in place",
    )
    free: Axes = param((True, True, True), help="of the other particles: false for an axis along which they are held")
    displacement: FormulaVector = param(
        (0, 0, 0), names=("u", "v", "w"), unit="length", help="displacement from rest at the start"
    )
    scatter: Vector = param(
        (0, 0, 0), minimum=0.0, unit="length", help="largest random displacement of particles that are not held"
    )
    velocity: FormulaVector = param((0, 0, 0), names=("u", "v", "w"), unit="length time⁻¹", help="velocity at the start")

    def particle_count(self) -> int:
        """Product of the counts along the axes."""
        return self.shape[0] * self.shape[1] * self.shape[2]

    def generate(self, context: GeneratorContext) -> Group:
        """Place, then displace."""
        counts = self.shape
        row = np.arange(self.particle_count())
        axes = [row % counts[0], row // counts[0] % counts[1], row // (counts[0] * counts[1])]
        fractions = [axis / max(count - 1, 1) for axis, count in zip(axes, counts, strict=True)]
        lower, upper = np.array(self.lower), np.array(self.upper)
        rest = lower + np.stack(fractions, axis=1) * (upper - lower)
        free = np.array(self.free) & ~self._held(axes)[:, None]
        random = context.random.uniform(-1.0, 1.0, rest.shape) * np.array(self.scatter)
        return make_group(
            len(rest),
            position=rest + self._values("displacement", self.displacement, fractions) + np.where(free, random, 0.0),
            rest_position=rest,
            velocity=self._values("velocity", self.velocity, fractions),
            mass=self.mass,
            radius=self.radius,
            charge=self.charge,
            color=self.color,
            free=free,
        )

    def _values(self, key: str, formulas: Sequence[Any], fractions: Sequence[np.ndarray]) -> np.ndarray:
        """Three formulas over u, v, w for every particle."""
        names = dict(zip(("u", "v", "w"), fractions, strict=True))
        try:
            return np.stack([formula(len(fractions[0]), **names) for formula in formulas], axis=1)
        except ExpressionError as error:
            raise PlacementError(f"{key}: {error}") from None

    def _held(self, axes: Sequence[np.ndarray]) -> np.ndarray:
        """True for the particles that `fixed` holds; an axis of one particle has no ends."""
        first = [axis == 0 for axis in axes]
        last = [axis == count - 1 for axis, count in zip(axes, self.shape, strict=True)]
        either = [a | b for a, b in zip(first, last, strict=True)]
        long = [axis for axis, count in enumerate(self.shape) if count > 1]
        everything, nothing = np.ones(len(axes[0]), dtype=bool), np.zeros(len(axes[0]), dtype=bool)
        corners = np.logical_and.reduce([everything, *(either[axis] for axis in long)])
        held = {
            "none": nothing,
            "rim": np.logical_or.reduce([nothing, *(either[axis] for axis in long)]),
            "first": first[0],
            "last": last[0],
            "ends": either[0],
            "corners": corners,
            "upper_corners": corners & (last[long[-1]] if long else everything),
        }
        return held[self.fixed]
