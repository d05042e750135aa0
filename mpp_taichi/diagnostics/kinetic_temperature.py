"""Temperature of a gas, from its velocities."""

import numpy as np

from mpp_taichi.component import Particles, component, param
from mpp_taichi.diagnostics._at_end import AtEnd
from mpp_taichi.diagnostics._base import NoResultError
from mpp_taichi.diagnostics._gas import rows_of
from mpp_taichi.kinetic_theory.speeds import kinetic_temperature
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot


@component
class KineticTemperature(AtEnd):
    """k T = Σ m v² / (d N) at the end of the run [energy], of particles that are free along every axis."""

    of: Particles = param(None, optional=True, help="a particle or a group; absent: all")
    drift: bool = param(False, help="whether v is against the common motion; d N then becomes d (N − 1)")

    def begin(self, spec: SceneSpec, start: Snapshot) -> None:
        """Keep the dimensions, and which particles."""
        self._dimensions, self._rows = spec.dimensions, rows_of(self.of, start)
        if len(self._rows) < 1 + self.drift:
            raise NoResultError("there are too few free particles for a temperature")

    def measure(self, snapshot: Snapshot) -> float:
        """k T."""
        rows = self._rows[snapshot.present[self._rows]]
        velocity, mass = snapshot.velocity[rows], snapshot.mass[rows]
        if len(rows) < 1 + self.drift:
            raise NoResultError("too few particles have not merged for a temperature")
        return float(np.float64(kinetic_temperature(velocity, mass, self._dimensions, drift=self.drift)))
