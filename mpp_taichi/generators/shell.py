"""A shell: particles all over a sphere, at the corners of a geodesic sphere."""

from mpp_taichi.arithmetic.closed_skin import MOST_DIVISIONS, corner_count, directions
from mpp_taichi.component import Color, FormulaVector, Vector, component, param
from mpp_taichi.errors import PlacementError
from mpp_taichi.generators._base import Generator, GeneratorContext, Group, make_group
from mpp_taichi.scene.expressions import ExpressionError


@component
class Shell(Generator):
    """Particles at the corners of a geodesic sphere: an icosahedron whose faces are divided, 10 ν² + 2 particles.

    Twelve particles have five neighbours, all others six. `shell_links` makes springs between neighbours, and `shell_pressure`
    a gas inside. In `displacement` and `velocity` X, Y and Z are the direction from the centre to a particle, of length 1:
    `[0.1*X, 0.1*Y, 0.1*Z]` is a shell that is larger by 0.1 than at rest.
    Source: J. D. Clinton, Advanced Structural Geometry Studies (1971), class I.
    """

    name: str = param("", help="name of the shell; its particles are addressed as name[0], name[1], …")
    divisions: int = param(minimum=1, maximum=64, help="parts ν into which each edge of the icosahedron is divided")
    circumradius: float = param(1.0, above=0.0, unit="length", help="radius of the sphere")
    center: Vector = param((0, 0, 0), unit="length", help="centre of the sphere")
    mass: float = param(1.0, minimum=0.0, unit="mass", help="mass of each particle")
    radius: float = param(0.0, minimum=0.0, unit="length", help="radius of each particle, for contacts and the picture")
    color: Color = param((0.9, 0.9, 0.9), help="red, green, blue in 0…1")
    displacement: FormulaVector = param(
        (0, 0, 0), names=("X", "Y", "Z"), unit="length", help="displacement from rest at the start"
    )
    velocity: FormulaVector = param((0, 0, 0), names=("X", "Y", "Z"), unit="length time⁻¹", help="velocity at the start")

    def particle_count(self) -> int:
        """10 ν² + 2."""
        return corner_count(min(self.divisions, MOST_DIVISIONS))

    def generate(self, context: GeneratorContext) -> Group:
        """Place, then displace."""
        if context.dimensions != 3:
            raise PlacementError("a shell is in space, must be in a scene with three dimensions")
        outward = directions(self.divisions)
        rest = self.circumradius * outward + self.center
        names = dict(zip("XYZ", outward.T, strict=True))
        found = {}
        for key in ("displacement", "velocity"):
            try:
                columns = [formula(len(rest), **names) for formula in getattr(self, key)]
            except ExpressionError as error:
                raise PlacementError(f"{key}: {error}") from None
            found[key] = [list(row) for row in zip(*columns, strict=True)]
        return make_group(
            len(rest),
            position=rest + found["displacement"],
            rest_position=rest,
            velocity=found["velocity"],
            mass=self.mass,
            radius=self.radius,
            color=self.color,
        )
