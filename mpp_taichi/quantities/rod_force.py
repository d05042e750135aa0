"""The force along a rod."""

import numpy as np

from mpp_taichi.component import Pair, component, param
from mpp_taichi.quantities._base import NoResultError, Quantity, RunSample, Setting
from mpp_taichi.scene.path_checks import paths_of
from mpp_taichi.snapshot import Snapshot


@component
class RodForce(Quantity):
    """Force along the rod between two particles [force]: above 0 where the rod pulls, below 0 where it pushes.

    The forces of all rods together keep the second derivative of each length at 0: (G M⁻¹ Gᵀ) T = n·(a_j − a_i) + u²/L for each
    rod, with its direction n, the accelerations a of its ends by all other forces, or x″ of an end on a given path, and the
    velocity u of its ends across it.
    """

    between: Pair = param(help="the particles at its ends")
    dimension = (1, -2, 1)

    def begin(self, setting: Setting) -> None:
        """Find the rod.

        Raises:
            NoResultError: there is no such rod.
        """
        found = np.flatnonzero((np.sort(setting.start.rods.between, axis=1) == sorted(self.between)).all(axis=1))
        if len(found) == 0:
            first, second = map(setting.name_of, self.between)
            raise NoResultError(f"there is no rod between {first} and {second}")
        self._rod = int(found[0])
        self._laws = paths_of(setting.spec)

    def label(self, setting: Setting) -> str:
        """`force of rod pivot–upper`."""
        return f"force of rod {setting.name_of(self.between[0])}–{setting.name_of(self.between[1])}"

    def measure(self, sample: RunSample) -> float:
        """The force, of a system of equations for all rods."""
        now, rods = sample.snapshot, sample.snapshot.rods
        count, (first, second) = len(rods), rods.between.T
        separation = now.position[second] - now.position[first]
        direction = separation / np.linalg.norm(separation, axis=1)[:, None]
        closing = now.velocity[second] - now.velocity[first]
        across = closing - np.einsum("rk,rk->r", closing, direction)[:, None] * direction
        rows = np.zeros((count, now.particle_count, 3))
        rows[np.arange(count), first] = -direction
        rows[np.arange(count), second] += direction
        driven = np.einsum("rik,ik->r", rows, self._driven_accelerations(now)) if now.driven else 0.0
        rows *= now.free
        inverse_mass = 1.0 / np.where(now.mass > 0.0, now.mass, np.inf)
        matrix = np.einsum("rik,i,sik->rs", rows, inverse_mass, rows)
        parting = np.einsum("rik,ik->r", rows, sample.acceleration) + np.einsum("rk,rk->r", across, across) / rods.length
        return float(np.linalg.solve(matrix, parting + driven)[self._rod])

    def _driven_accelerations(self, now: Snapshot) -> np.ndarray:
        """The accelerations x″ of bodies on given paths, and 0 for all others."""
        found = np.zeros_like(now.position)
        for index, law in zip(now.driven, self._laws, strict=True):
            found[index] = law.acceleration_at(now.time)
        return found
