"""Pressure of a fluid in a periodic box, from the forces between its particles."""

import numpy as np

from mpp_taichi.component import component
from mpp_taichi.quantities._base import Dimension, NoResultError, Quantity, RunSample, Setting
from mpp_taichi.scene.periodic_forces import acts_across_faces
from mpp_taichi.start.contact_setup import enclosure_of


@component
class VirialPressure(Quantity):
    """Pressure of particles with pair forces in a periodic box, P = (Σ m v² + Σ_pairs F_ij·(x_i − x_j)) / (d V).

    V is the volume of the box, an area in two dimensions; the unit is [energy / lengthᵈ]. Velocities are relative to the centre
    of mass. The force of a pair has its cutoff, and nothing is added for pairs beyond it. Collisions of hard spheres have a
    virial of their own, which the diagnostic `pressure` measures. Source: R. Clausius, Phil. Mag. 40 (1870) 122.
    """

    def begin(self, setting: Setting) -> None:
        """Measure the box.

        Raises:
            NoResultError: there is no box that repeats along every axis, or no pair force, or hard spheres collide.
        """
        spec = setting.spec
        box = enclosure_of(spec)
        if not acts_across_faces(spec) or not all(box.repeats[: spec.dimensions]):
            raise NoResultError("this pressure is measured in a periodic_box that repeats along every axis, with pair forces")
        if spec.contacts is not None:
            raise NoResultError("this pressure has no share of collisions: the diagnostic pressure has")
        self._dimensions, self._volume = spec.dimensions, float(np.prod(box.period[: spec.dimensions]))

    @property
    def dimension(self) -> Dimension:  # type: ignore[override]
        """Energy per volume, or per area."""
        return (2 - self._dimensions, -2, 1)

    def label(self, setting: Setting) -> str:
        """`pressure of the forces`."""
        return "pressure of the forces"

    def measure(self, sample: RunSample) -> float:
        """P."""
        now = sample.snapshot
        drift = now.mass @ now.velocity / now.mass.sum()
        kinetic = float(np.sum(now.mass[:, None] * (now.velocity - drift) ** 2))
        return (kinetic + sample.pair_virial) / (self._dimensions * self._volume)
