"""A spring network linearised at its placement: its stiffness, as a matrix and as a product."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mpp_taichi.snapshot import Snapshot

REST_ROUNDING = 8.0  # roundings of a coordinate by which a spring's placed length may miss the rest length it was given


@dataclass(frozen=True, eq=False)
class LinearNetwork:
    """The springs of a scene at a placement, for small displacements u from it.

    A spring h of stiffness D, rest length L and placed length l along the unit vector n pulls with D (l − L) n, and a small
    change Δu of its separation changes that by K_h Δu,

        K_h = D [n nᵀ + (1 − L/l)(I − n nᵀ)] = D n nᵀ + (T/l)(I − n nᵀ),  tension T = D (l − L).

    The stiffness is the second derivative of the springs' energy: at a placement where the forces do not balance, the network
    moves by itself, and the linearisation holds only near this placement. A spring whose ends coincide has K_h = D I if its
    rest length is 0; otherwise it has no direction, and therefore no stiffness.

    position          the placement, shape (particle_count, d) with d = dimensions
    mass              shape (particle_count,)
    free              axes of linked particles that may move, shape (particle_count, d); particles without a spring have none
    between           ends of the springs, shape (spring_count, 2)
    direction         n, shape (spring_count, d)
    length            l, shape (spring_count,)
    axial, lateral    D and T/l [force length⁻¹], shape (spring_count,)
    """

    position: np.ndarray
    mass: np.ndarray
    free: np.ndarray
    between: np.ndarray
    direction: np.ndarray
    length: np.ndarray
    axial: np.ndarray
    lateral: np.ndarray

    @property
    def freedom_count(self) -> int:
        """The number of axes of particles that the springs can move."""
        return int(np.count_nonzero(self.free))

    @cached_property
    def freedoms(self) -> np.ndarray:
        """Index of every freedom into a flattened (particle_count, d) array, shape (freedom_count,)."""
        return np.flatnonzero(self.free)

    @cached_property
    def freedom_masses(self) -> np.ndarray:
        """Mass that each freedom moves, shape (freedom_count,)."""
        return np.repeat(self.mass, self.free.shape[1])[self.freedoms]

    def expand(self, columns: np.ndarray) -> np.ndarray:
        """Displacements of all particles, (particle_count, d, …), from displacements of the freedoms, (freedom_count, …)."""
        full = np.zeros((self.free.size, *columns.shape[1:]))
        full[self.freedoms] = columns
        return full.reshape(*self.free.shape, *columns.shape[1:])

    def blocks(self, axial: np.ndarray, lateral: np.ndarray) -> np.ndarray:
        """K_h of every spring for the given stiffnesses along and across, shape (spring_count, d, d)."""
        along = self.direction[:, :, None] * self.direction[:, None, :]
        return axial[:, None, None] * along + lateral[:, None, None] * (np.eye(self.free.shape[1]) - along)

    def assemble(self, blocks: np.ndarray) -> np.ndarray:
        """The matrix over the freedoms that has these blocks, shape (freedom_count, freedom_count)."""
        number = np.where(self.free, np.cumsum(self.free).reshape(self.free.shape) - 1, -1)
        matrix = np.zeros((self.freedom_count, self.freedom_count))
        for first in (0, 1):
            for second in (0, 1):
                rows, columns = np.broadcast_arrays(
                    number[self.between[:, first]][:, :, None], number[self.between[:, second]][:, None, :]
                )
                moving = (rows >= 0) & (columns >= 0)
                np.add.at(matrix, (rows[moving], columns[moving]), (1 if first == second else -1) * blocks[moving])
        return matrix

    @cached_property
    def stiffness_matrix(self) -> np.ndarray:
        """K over the freedoms, shape (freedom_count, freedom_count)."""
        return self.assemble(self.blocks(self.axial, self.lateral))

    def pull(self, displacement: np.ndarray) -> np.ndarray:
        """K u [force] without the matrix, both of shape (particle_count, d); on held axes the force on the support."""
        change = displacement[self.between[:, 1]] - displacement[self.between[:, 0]]
        along = np.einsum("sd,sd->s", self.direction, change)
        force = self.lateral[:, None] * change + ((self.axial - self.lateral) * along)[:, None] * self.direction
        total = np.zeros_like(displacement)
        for axis in range(displacement.shape[1]):  # bincount adds in the order of the springs, as add.at does, but faster
            for end, sign in ((0, -1.0), (1, 1.0)):
                total[:, axis] += sign * np.bincount(self.between[:, end], force[:, axis], minlength=len(displacement))
        return total

    def potential_energy(self, displacement: np.ndarray) -> float:
        """½ uᵀ K u: the energy of the springs relative to the placement, to second order in u."""
        return 0.5 * float(np.einsum("id,id->", displacement, self.pull(displacement)))

    def kinetic_energy(self, velocity: np.ndarray) -> float:
        """½ Σ m v² of the freedoms."""
        moving = np.where(self.free, velocity, 0.0)
        return 0.5 * float(np.einsum("i,id,id->", self.mass, moving, moving))

    def mean_square_frequency(self, motion: np.ndarray) -> float:
        """Rayleigh's quotient uᵀ K u / uᵀ M u [time⁻²]: ω² of a mode, the mean of a mixture of modes; 0 where nothing moves."""
        moving = np.where(self.free, motion, 0.0)
        inertia = float(np.einsum("i,id,id->", self.mass, moving, moving))
        return 2.0 * self.potential_energy(moving) / inertia if inertia > 0.0 else 0.0


def linearise(placed: Snapshot, *, dimensions: int) -> LinearNetwork:
    """The springs of a snapshot about its positions.

    A spring as long as its rest length, to the rounding of its ends' coordinates, is taken to have no tension: otherwise
    rounding would stiffen or buckle a slack network.
    """
    springs = placed.springs
    position = placed.position[:, :dimensions]
    separation = position[springs.between[:, 1]] - position[springs.between[:, 0]]
    length = np.sqrt(np.sum(separation**2, axis=1))
    apart = length > 0.0
    safe = np.where(apart, length, 1.0)
    rounding = REST_ROUNDING * np.finfo(float).eps * (np.abs(position[springs.between]).max(axis=(1, 2), initial=0.0) + length)
    slack = np.abs(length - springs.rest_length) <= rounding
    lateral = np.where(slack | ~apart, 0.0, springs.stiffness * (length - springs.rest_length) / safe)
    isotropic = ~apart & (springs.rest_length == 0.0)
    linked = np.zeros(placed.particle_count, dtype=bool)
    linked[springs.between.ravel()] = True
    return LinearNetwork(
        position=position,
        mass=placed.mass,
        free=placed.free[:, :dimensions] & linked[:, None],
        between=springs.between.astype(np.int64),
        direction=separation / safe[:, None],
        length=length,
        axial=np.where(apart | isotropic, springs.stiffness, 0.0),
        lateral=np.where(isotropic, springs.stiffness, lateral),
    )
