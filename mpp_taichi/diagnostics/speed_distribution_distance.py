"""How far the speeds of a gas are from those of Maxwell and Boltzmann."""

import numpy as np

from mpp_taichi.component import Particles, component, param
from mpp_taichi.diagnostics._base import Diagnostic, NoResultError
from mpp_taichi.diagnostics._gas import rows_of
from mpp_taichi.kinetic_theory.kolmogorov_smirnov import distance
from mpp_taichi.kinetic_theory.speeds import kinetic_temperature, speed_cumulative, speed_scale
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot


@component
class SpeedDistributionDistance(Diagnostic):
    """Kolmogorov and Smirnov's sup |F_n − F| between the speeds at the end and the distribution of their temperature.

    By chance it exceeds 1.36/√n once in twenty times, somewhat more seldom as the temperature is the measured one. Of particles
    that are free along every axis; where masses differ, each speed is compared with the distribution of its own mass.
    """

    of: Particles = param(None, optional=True, help="a group; absent: all particles")
    temperature: float = param(None, optional=True, above=0.0, unit="energy", help="k T; absent: as measured at the end")
    _value: float | None = None

    def begin(self, spec: SceneSpec, start: Snapshot) -> None:
        """Keep the dimensions, and which particles."""
        self._dimensions, self._rows = spec.dimensions, rows_of(self.of, start)
        if len(self._rows) < 2:
            raise NoResultError("fewer than two free particles have no distribution of speeds")

    def observe(self, time: float, snapshot: Snapshot) -> None:
        """Compare; the last look remains."""
        rows = self._rows[snapshot.present[self._rows]]
        velocity, mass = snapshot.velocity[rows], snapshot.mass[rows]
        if len(rows) < 2:
            raise NoResultError("fewer than two particles have not merged")
        measured = kinetic_temperature(velocity, mass, self._dimensions)
        temperature = measured if self.temperature is None else self.temperature
        if not temperature > 0.0:
            self._value = 1.0
            return
        speed = np.linalg.norm(velocity, axis=1)
        self._value = distance(speed_cumulative(speed, speed_scale(mass, temperature), self._dimensions))

    def result(self) -> float:
        """The distance at the last look."""
        if self._value is None:
            raise NoResultError("the run was never looked at")
        return self._value
