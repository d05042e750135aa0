"""Pressure of a gas of hard spheres."""

import numpy as np

from mpp_taichi.component import component, param
from mpp_taichi.contacts._report import ContactReport
from mpp_taichi.diagnostics._gas import OfContacts, box_of
from mpp_taichi.quantities._base import NoResultError, RunSample, Setting
from mpp_taichi.start.contact_setup import enclosure_of


@component
class Pressure(OfContacts):
    """Pressure in a box whose walls are across the axes, or that repeats [energy / lengthᵈ].

    walls    momentum given to all walls, per time and area. The area is that which the centres reach, the box less a radius
             at each wall, as is the volume below: only with them do both ways agree, and an ideal gas has P V = N k T.
    virial   d P V = ⟨Σ m v²⟩ + Σ Δp · r / t, over collisions of pairs, from both sides of the virial theorem of Clausius.

    Spheres of different radii count with their mean; between walls this is exact only for equal spheres.
    """

    by: str = param("virial", choices=("virial", "walls"), help="method of measurement")
    after: float = param(0.0, minimum=0.0, unit="time", help="time of the first sample")

    def prepare(self, setting: Setting) -> None:
        """Measure the box."""
        spec, start = setting.spec, setting.start
        lower, upper = box_of(spec)
        repeats = np.array(enclosure_of(spec).repeats[: spec.dimensions])
        if self.by == "walls" and repeats.any():
            raise NoResultError("a box that repeats has no walls all around, measure the pressure by: virial")
        inner = upper - lower - np.where(repeats, 0.0, 2.0 * float(start.radius.mean()))
        self._volume = float(np.prod(inner))
        self._area = float(np.sum(2.0 * self._volume / inner))
        self._kinetic: list[float] = []

    def counted(self, report: ContactReport) -> float:
        """Momentum of walls, or virial of pairs."""
        return sum(report.wall_impulse) if self.by == "walls" else report.virial

    def take(self, sample: RunSample) -> None:
        """Keep Σ m v²."""
        self._kinetic.append(float(np.sum(sample.snapshot.mass[:, None] * sample.snapshot.velocity**2)))

    def result(self) -> float:
        """P."""
        if self.by == "walls":
            return self._total.rate() / self._area
        return (float(np.mean(self._kinetic)) + self._total.rate()) / (self._dimensions * self._volume)

    def standard_error(self) -> float:
        """The standard error of the contacts' part, by ten blocks."""
        return self._total.standard_error() / (self._area if self.by == "walls" else self._dimensions * self._volume)
