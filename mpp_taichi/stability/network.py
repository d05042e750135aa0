"""Network: the largest frequency and damping rate of the springs and the drag of a scene, as placed and in any arrangement."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mpp_taichi.scene.layout import build, layout_of
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.stability.operator import damping_bonds, row_sum_bound, stiffness_bonds
from mpp_taichi.stability.spectrum import LargestEigenvalue


@dataclass(frozen=True)
class Rates:
    """An oscillation: angular frequency ω [1/time] and damping rate γ [1/time] of x" = −ω² x − γ x′."""

    frequency: float
    damping: float


def drag_of(spec: SceneSpec) -> float:
    """The coefficient of the scene's linear drag [mass / time]."""
    return sum(float(force.parameters["coefficient"]) for force in spec.forces_with("is_linear_drag"))


class SpringNetwork:
    """Springs and linear drag of a scene, linearised where the particles are.

    Forces between pairs of particles and uniform fields are left out: they hardly stiffen a network of springs.
    """

    def __init__(self, spec: SceneSpec, snapshot: Snapshot) -> None:
        """Keep the scene and the state; every rate is computed when it is first asked for."""
        if spec.bonds:
            from mpp_taichi.scene.formula_checks import with_bonds  # only where a formula stands in the scene

            snapshot = with_bonds(spec, snapshot)
        self.spec, self.snapshot = spec, snapshot
        self.drag = drag_of(spec)
        self.swings = bool(snapshot.springs.stiffness.any())
        self._decays = bool(snapshot.springs.damping.any()) or self.drag > 0.0

    @cached_property
    def stiffness(self) -> LargestEigenvalue:
        """Largest ω² of the network as it is placed, and its mode."""
        return LargestEigenvalue(stiffness_bonds(self.snapshot, self.spec.dimensions))

    @cached_property
    def damping(self) -> LargestEigenvalue:
        """Largest γ of the network as it is placed, and its mode."""
        bonds = damping_bonds(self.snapshot, self.spec.dimensions, mode=self.spec.spring_damping, drag=self.drag)
        return LargestEigenvalue(bonds)

    @property
    def is_still(self) -> bool:
        """Whether no spring and no drag limits a step."""
        return not (self.swings or self._decays)

    @property
    def converged(self) -> bool:
        """Whether the iterations have converged; otherwise the bounds are used instead of the eigenvalues."""
        return (not self.swings or self.stiffness.converged) and (not self._decays or self.damping.converged)

    @cached_property
    def frequency(self) -> float:
        """Largest angular frequency as placed, with the error of the iteration added, or else the bound [1/time]."""
        if not self.swings:
            return 0.0
        found = math.sqrt(max(self.stiffness.upper, 0.0))
        return min(found, self.frequency_bound) if self.stiffness.converged else self.frequency_bound

    @cached_property
    def frequency_bound(self) -> float:
        """Upper bound of the frequencies in every arrangement of the same particles and springs [1/time]."""
        springs = self.snapshot.springs
        return math.sqrt(row_sum_bound(self.snapshot, self.spec.dimensions, np.abs(springs.stiffness))) if self.swings else 0.0

    @cached_property
    def damping_bound(self) -> float:
        """Upper bound of the damping rates in every arrangement [1/time]."""
        if not self._decays:
            return 0.0
        return row_sum_bound(self.snapshot, self.spec.dimensions, self.snapshot.springs.damping, self.drag)

    @cached_property
    def placed(self) -> list[Rates]:
        """The two oscillations that may limit a step: the fastest one, and the most damped one.

        The second rate of each is the Rayleigh quotient of its mode: exact where damping and stiffness share their modes.
        """
        if not self.converged:
            return self.anywhere
        rates = []
        if self.swings:
            damping = self._quotient(self.damping, self.stiffness) if self._decays else 0.0
            rates.append(Rates(self.frequency, max(damping, 0.0)))
        if self._decays:
            square = self._quotient(self.stiffness, self.damping) if self.swings else 0.0
            rates.append(Rates(math.sqrt(max(square, 0.0)), min(self.damping.upper, self.damping_bound)))
        return rates

    @property
    def anywhere(self) -> list[Rates]:
        """Oscillations at least as hard on a step as any that these springs can make in any arrangement."""
        frequency, damping = self.frequency_bound, self.damping_bound
        corners = {(frequency, 0.0), (0.0, damping), (frequency, damping)} - {(0.0, 0.0)}
        return [Rates(*corner) for corner in sorted(corners)]

    def stiffest_spring(self) -> int | None:
        """The spring that holds most of the energy of the fastest mode; None without springs that swing."""
        if not self.swings:
            return None
        if self.stiffness.converged:
            weights = self.stiffness.bonds.shares(self.stiffness.vector)
        else:
            mass = np.where(self.snapshot.mass > 0.0, self.snapshot.mass, np.inf)
            weights = self.snapshot.springs.stiffness / mass[self.snapshot.springs.between].min(axis=1)
        return int(np.argmax(weights >= weights.max() * (1.0 - 1e-6)))  # the first of equals

    def describe_spring(self, index: int) -> str:
        """`the spring between particle 0 (pivot) and particle 1 (upper), D = 5000 (springs[0].link, scene.yaml:21:5)`."""
        layout = layout_of(self.spec)
        springs, first = self.snapshot.springs, 0
        ends = " and ".join(layout.label(int(end)) for end in springs.between[index])
        place = ""
        for number, entry in enumerate(self.spec.springs):
            first += build("networks", entry).spring_count(layout.lattice)
            if index < first:
                place = f" (springs[{number}].{entry.name}, {entry.location})"
                break
        return f"the spring between {ends}, D = {springs.stiffness[index]:.6g}{place}"

    @staticmethod
    def _quotient(of: LargestEigenvalue, at: LargestEigenvalue) -> float:
        return float(at.vector @ of.bonds.product(at.vector))
