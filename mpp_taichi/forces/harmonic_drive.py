"""A force that swings with time."""

import taichi as ti

from mpp_taichi.component import Particles, Vector, component, param
from mpp_taichi.forces._base import ExternalForce, is_among
from mpp_taichi.types import Template


@component
class HarmonicDrive(ExternalForce):
    """Driving force F(t) = F₀ sin(ω t + φ), the same on every particle, or only on the particles of `of`.

    The force depends only on time, so it has no potential: its work Σ F·v enters the energy balance. In f32 the phase is
    rounded to ω t 2⁻²⁴. Source: Landau & Lifshitz, Mechanics (1976), §22 and §26.
    """

    force: Vector = param(strength=True, slider=True, unit="force", help="amplitude F₀ of the force on each driven particle")
    angular_frequency: float = param(minimum=0.0, slider=True, unit="time⁻¹", help="angular frequency ω")
    phase: float = param(0.0, slider=True, unit="radian", help="phase φ; pi/2 makes a cosine")
    of: Particles = param(None, optional=True, help="the driven particle or group; absent: every particle")
    needs = frozenset({"mass"})
    has_derivatives = True
    conserves_energy = False
    depends_on_time = True
    takes_sine = True

    @property
    def drives_some(self) -> bool:
        """Whether there are particles that are not driven."""
        return self.of is not None

    @ti.func
    def accelerate(self, state: Template, i, velocity, time):
        """F₀ sin(ω t + φ) / m where particle i is driven."""
        return self.swing(state, i, ti.sin(self.angular_frequency * time + self.phase))

    @ti.func
    def derivatives(self, state: Template, i, time):
        """ω F₀ cos(ω t + φ) / m and −ω² F₀ sin(ω t + φ) / m."""
        angle = self.angular_frequency * time + self.phase
        first = self.swing(state, i, self.angular_frequency * ti.cos(angle))
        return first, self.swing(state, i, -self.angular_frequency * self.angular_frequency * ti.sin(angle))

    @ti.func
    def swing(self, state: Template, i, factor):
        """So many times F₀ / m where particle i is driven."""
        result = ti.Vector.zero(float, state.dimensions)
        if is_among(state, i, self.drives_some, self.of):
            amplitude = ti.Vector([self.force[k] for k in range(state.dimensions)], float)
            result = (factor / state.mass[i]) * amplitude
        return result

    @ti.func
    def potential(self, state: Template, i, time):
        """None."""
        return ti.cast(0.0, state.wide)
