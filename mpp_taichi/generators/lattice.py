"""A lattice of particles: a chain, a sheet or a block."""

import numpy as np

from mpp_taichi.component import Color, FormulaVector, Shape, Vector, component, param
from mpp_taichi.errors import PlacementError
from mpp_taichi.generators._base import Generator, GeneratorContext, Group, make_group
from mpp_taichi.scene.expressions import ExpressionError


@component
class Lattice(Generator):
    """Particles at equal distances along one, two or three axes; the first axis varies fastest in the index.

    u, v, w run from 0 to 1 along the axes (0 on an axis of one particle). Springs between them that are given no rest length
    are at rest without the displacement.
    """

    name: str = param("", help="for springs to refer to it")
    shape: Shape = param(help="particles along each axis, [8, 8] say")
    lower: Vector = param(unit="length", help="corner of the first particle")
    upper: Vector = param(unit="length", help="corner of the last particle")
    mass: float = param(1.0, unit="mass", help="of each particle")
    radius: float = param(0.0, unit="length")
    color: Color = param((0.9, 0.9, 0.9), help="red, green, blue in 0…1")
    fixed: str = param("none", choices=("none", "rim"), help="rim: the particles on the edge are held in place")
    displacement: FormulaVector = param((0, 0, 0), names=("u", "v", "w"), unit="length", help="from rest, at the start")

    def particle_count(self) -> int:
        """Product of the counts along the axes."""
        return self.shape[0] * self.shape[1] * self.shape[2]

    def generate(self, context: GeneratorContext) -> Group:
        """Place, then displace."""
        counts = self.shape
        axes = [np.arange(self.particle_count())]
        axes = [axes[0] % counts[0], axes[0] // counts[0] % counts[1], axes[0] // (counts[0] * counts[1])]
        fractions = [axis / max(count - 1, 1) for axis, count in zip(axes, counts, strict=True)]
        lower, upper = np.array(self.lower), np.array(self.upper)
        rest = lower + np.stack(fractions, axis=1) * (upper - lower)
        names = dict(zip(("u", "v", "w"), fractions, strict=True))
        try:
            shift = np.stack([formula(len(rest), **names) for formula in self.displacement], axis=1)
        except ExpressionError as error:
            raise PlacementError(f"displacement: {error}") from None
        return make_group(
            len(rest),
            position=rest + shift,
            rest_position=rest,
            mass=self.mass,
            radius=self.radius,
            color=self.color,
            free=~self._rim(axes)[:, None],
        )

    def _rim(self, axes: list[np.ndarray]) -> np.ndarray:
        """True for the particles that `fixed` holds: the ends of every axis that has more than one."""
        held = np.zeros(len(axes[0]), dtype=bool)
        for axis, count in zip(axes, self.shape, strict=True):
            if self.fixed == "rim" and count > 1:
                held |= (axis == 0) | (axis == count - 1)
        return held
