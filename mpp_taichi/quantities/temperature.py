"""Temperature of a gas."""

import math

from mpp_taichi import component as components
from mpp_taichi.component import Particles, component, param
from mpp_taichi.diagnostics._base import NoResultError
from mpp_taichi.diagnostics.kinetic_temperature import KineticTemperature
from mpp_taichi.quantities._base import ENERGY, Look, Quantity, Setting, of_which


@component
class Temperature(Quantity):
    """Kinetic temperature k T = Σ m v² / (d N) [energy] of particles that are free along every axis."""

    of: Particles = param(None, optional=True, help="a particle or a group; absent: all")
    drift: bool = param(False, help="whether v is against the common motion; d N then becomes d (N − 1)")
    dimension = ENERGY

    def begin(self, setting: Setting) -> None:
        """Find the particles."""
        self._meter: KineticTemperature = components.build(
            "diagnostics", "kinetic_temperature", {"of": self.of, "drift": self.drift}
        )
        self._meter.begin(setting.spec, setting.start)

    def label(self, setting: Setting) -> str:
        """Of what."""
        return of_which("temperature k T", setting.name_of(self.of))

    def measure(self, look: Look) -> float:
        """k T; NaN where too few have not merged."""
        try:
            return self._meter.measure(look.snapshot)
        except NoResultError:
            return math.nan
