"""The distance of the speeds of a gas from the distribution of Maxwell and Boltzmann."""

import numpy as np

from mpp_taichi.component import Particles, component, param
from mpp_taichi.kinetic_theory.kolmogorov_smirnov import distance
from mpp_taichi.kinetic_theory.speeds import kinetic_temperature, speed_cumulative, speed_scale
from mpp_taichi.quantities._base import NoResultError, Quantity, RunSample, Setting, of_which
from mpp_taichi.quantities._particles import free_rows


@component
class SpeedDistributionDistance(Quantity):
    """Kolmogorov and Smirnov's sup |F_n − F| between the speeds and the distribution of their temperature.

    By chance it exceeds 1.36/√n once in twenty times, somewhat more seldom as the temperature is the measured one. Of particles
    that are free along every axis; where masses differ, each speed is compared with the distribution of its own mass.
    """

    of: Particles = param(None, optional=True, help="a group; absent: all particles")
    temperature: float = param(
        None, optional=True, above=0.0, unit="energy", help="k T of the distribution; absent: the temperature at the sample"
    )

    def begin(self, setting: Setting) -> None:
        """Keep the dimensions, and which particles."""
        self._dimensions, self._rows = setting.spec.dimensions, free_rows(self.of, setting.start)
        if len(self._rows) < 2:
            raise NoResultError("fewer than two free particles have no distribution of speeds")

    def label(self, setting: Setting) -> str:
        """`distance from the Maxwell–Boltzmann distribution of gas`."""
        return of_which("distance from the Maxwell–Boltzmann distribution", setting.name_of(self.of))

    def measure(self, sample: RunSample) -> float:
        """The distance; 1 where nothing moves."""
        rows = self._rows[sample.snapshot.present[self._rows]]
        velocity, mass = sample.snapshot.velocity[rows], sample.snapshot.mass[rows]
        if len(rows) < 2:
            raise NoResultError("fewer than two particles have not merged")
        measured = kinetic_temperature(velocity, mass, self._dimensions)
        temperature = measured if self.temperature is None else self.temperature
        if not temperature > 0.0:
            return 1.0
        speed = np.linalg.norm(velocity, axis=1)
        return distance(speed_cumulative(speed, speed_scale(mass, temperature), self._dimensions))
