"""How far a particle is from another, from a point, or from the centre of mass."""

import numpy as np

from mpp_taichi.component import Particles, Vector, component, param
from mpp_taichi.quantities._base import Look, NoResultError, OfEach, Setting, center_of, of_which, rows


@component
class Distance(OfEach):
    """Distance of a particle or a group's centre of mass from another, or from a point [length].

    Without `to` and `point` it is from the centre of mass of all particles. In a histogram it is that of each particle.
    """

    of: Particles = param(help="a particle or a group")
    to: Particles = param(None, optional=True, help="from which it is measured: a particle or a group")
    point: Vector = param(None, optional=True, unit="length", help="or a point")
    dimension = (1, 0, 0)

    def begin(self, setting: Setting) -> None:
        """See that there is one place to measure from."""
        if self.to is not None and self.point is not None:
            raise NoResultError("distance is either to: another particle or from a point:, not both")

    def label(self, setting: Setting) -> str:
        """Of what and to what."""
        if self.point is not None:
            end = "(" + ", ".join(f"{each:g}" for each in self.point[: setting.spec.dimensions]) + ")"
        else:
            end = setting.name_of(self.to) or "centre of mass"
        return f"{of_which('distance', setting.name_of(self.of))} to {end}"

    def measure(self, look: Look) -> float:
        """The distance."""
        return float(np.linalg.norm(center_of(look.snapshot.position, look.snapshot, self.of) - self._end(look)))

    def each(self, look: Look) -> np.ndarray:
        """The distances."""
        return np.linalg.norm(look.snapshot.position[rows(self.of)] - self._end(look), axis=1)

    def _end(self, look: Look) -> np.ndarray:
        snapshot = look.snapshot
        return np.array(self.point) if self.point is not None else center_of(snapshot.position, snapshot, self.to)
