"""Specific energy: kinetic plus potential energy per mass of particles without a mass, or with next to none."""

from dataclasses import dataclass

import numpy as np

from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot

PAIRS_AT_ONCE = 2**20
LIGHT = 2.0**-24
"""Share of the largest mass below which a mass, and its energy in the total energy, are lost in the rounding of an f32."""


def light_particles(spec: SceneSpec, snapshot: Snapshot) -> np.ndarray:
    """Numbers of the particles that can move and are massless or, where gravity alone acts, too light for the total energy."""
    with_mass = spec.contacts is not None or len(snapshot.springs) > 0
    others = [each for each in spec.forces if each not in (*spec.forces_with("gravitates"), *spec.forces_with("is_uniform"))]
    limit = 0.0 if with_mass or others else LIGHT * snapshot.mass.max(initial=0.0)
    return np.flatnonzero((snapshot.mass <= limit) & snapshot.free.any(axis=1) & snapshot.present)


@dataclass(frozen=True, eq=False)
class SpecificEnergies:
    """Energies per mass [length² / time²], each (2, n): in the frame of the scene, and in the frame of the attractor.

    The attractor of a particle is the body that pulls it most; in its frame only the attractor's potential counts.

    attractor   index of the attractor, (n,); −1 where no body has a mass
    """

    kinetic: np.ndarray
    potential: np.ndarray
    attractor: np.ndarray

    @property
    def energy(self) -> np.ndarray:
        """Kinetic plus potential energy."""
        return self.kinetic + self.potential


class SpecificEnergyMeter:
    """Measures the `light_particles`, in the field of the other bodies. The forces are gravity and uniform gravity."""

    def __init__(self, spec: SceneSpec, snapshot: Snapshot) -> None:
        """Find the light particles and the bodies that attract them."""
        self.rows = light_particles(spec, snapshot)
        heavy = snapshot.mass > 0.0
        heavy[self.rows] = False
        gravities = [force.parameters for force in spec.forces_with("gravitates")]
        gravity = gravities[-1] if gravities else {"strength": 0.0, "softening": 0.0}
        self.bodies = np.flatnonzero(heavy) if gravity["strength"] else np.zeros(0, int)
        self.weight = gravity["strength"] * snapshot.mass[self.bodies]
        self.softening = gravity["softening"]
        fields = [force.parameters["acceleration"] for force in spec.forces_with("is_uniform")]
        self.uniform = np.array(fields[-1] if fields else (0.0, 0.0, 0.0), float)

    def measure(self, snapshot: Snapshot) -> SpecificEnergies:
        """Specific energies of a snapshot."""
        position, velocity = snapshot.position[self.rows], snapshot.velocity[self.rows]
        kinetic = np.tile(0.5 * np.einsum("ij,ij->i", velocity, velocity), (2, 1))
        potential = np.tile(-position @ self.uniform, (2, 1))
        attractor = np.full(len(self.rows), -1)
        if not len(self.bodies):
            return SpecificEnergies(kinetic, potential, attractor)
        places, speeds = snapshot.position[self.bodies], snapshot.velocity[self.bodies]
        size = max(1, PAIRS_AT_ONCE // len(self.bodies))
        for first in range(0, len(self.rows), size):
            some = slice(first, first + size)
            separation = places - position[some, None]
            inverse = 1.0 / np.sqrt(np.einsum("ijk,ijk->ij", separation, separation) + self.softening**2)
            strongest = np.argmax(np.abs(self.weight) * inverse**2, axis=1)
            relative = velocity[some] - speeds[strongest]
            kinetic[1, some] = 0.5 * np.einsum("ij,ij->i", relative, relative)
            potential[0, some] -= inverse @ self.weight
            potential[1, some] = -self.weight[strongest] * inverse[np.arange(len(strongest)), strongest]
            attractor[some] = self.bodies[strongest]
        return SpecificEnergies(kinetic, potential, attractor)
