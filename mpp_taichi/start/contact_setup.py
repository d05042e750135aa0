"""The spheres and walls of a scene in the form that contact solvers need. Host side; no Taichi."""

from dataclasses import dataclass, field, replace

import numpy as np

from mpp_taichi import component
from mpp_taichi.errors import PlacementError, SceneError
from mpp_taichi.scene.spec import ContactsSpec, SceneSpec
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.walls._base import Enclosure, check_surfaces, joined


@dataclass(frozen=True, eq=False)
class ContactSetup:
    """The spheres and walls of a scene in the form that contact solvers need.

    radius         (n,) [length]
    inverse_mass   (n, 3) [1 / mass]; 0 along an axis that is held, so a held sphere is infinitely heavy
    material       (n,) int32, index into `restitution`
    restitution    (m, m), symmetric: e of a contact between two materials, 0 … 1; NaN where the scene gives none of its own
    contact_time   t_c of the TC model [time]: a contact within it after the last one of either sphere is elastic; 0: off.
                   Source: Luding & McNamara, Granular Matter 1 (1998) 113.
    force_free     whether only the solver changes positions and velocities, any other change being followed by `prepare`
    names          the names of the spheres in the scene, "" for a sphere without a name
    gravity        uniform acceleration (3,) of a free flight [length / time²]; solvers that take steps ignore it
    """

    dimensions: int
    radius: np.ndarray
    inverse_mass: np.ndarray
    material: np.ndarray
    restitution: np.ndarray
    contact_time: float = 0.0
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    enclosure: Enclosure = field(default_factory=Enclosure)
    force_free: bool = False
    names: tuple[str, ...] = ()

    def with_bounces(self, restitution: float, contact_time: float) -> "ContactSetup":
        """The same setup with a solver's own parameters: its restitution where the scene gives none, and its contact time."""
        matrix = np.where(np.isnan(self.restitution), restitution, self.restitution)
        return replace(self, restitution=matrix, contact_time=contact_time)

    def label(self, i: int) -> str:
        """The text for sphere i in messages; −1 − w is surface w."""
        if i < 0:
            return self.enclosure.surfaces[-1 - i].label
        return f"particle {i} ({self.names[i]!r})" if i < len(self.names) and self.names[i] else f"particle {i}"

    @property
    def particle_count(self) -> int:
        """Number of spheres."""
        return len(self.radius)


def contact_setup(spec: SceneSpec, particles: Snapshot, *, force_free: bool = False) -> ContactSetup:
    """The setup for the contact solver of a scene; SceneError, located, for impossible walls."""
    assert spec.contacts is not None
    material, restitution = _materials(particles.particle_count, spec.contacts)
    with np.errstate(divide="ignore"):
        inverse = np.where(particles.free, 1.0 / particles.mass[:, None], 0.0)
    gravity = next((force.parameters["acceleration"] for force in spec.forces_with("is_uniform")), (0.0,) * 3)
    return ContactSetup(
        dimensions=spec.dimensions,
        radius=particles.radius,
        inverse_mass=inverse,
        material=material,
        restitution=restitution,
        gravity=gravity,
        enclosure=enclosure_of(spec),
        force_free=force_free,
        names=particles.name,
    )


def enclosure_of(spec: SceneSpec) -> Enclosure:
    """All walls of a scene; SceneError at an impossible wall."""
    made = Enclosure()
    for number, entry in enumerate(spec.walls):
        label = f"walls[{number}].{entry.name}"
        try:
            wall = component.build("walls", entry.name, entry.parameters).enclosure(spec.dimensions, label)
            check_surfaces(wall.surfaces)
            made = joined((made, wall))
        except PlacementError as error:
            raise SceneError(f"{entry.location}: {label}: {error}") from None
    return made


def _materials(count: int, contacts: ContactsSpec) -> tuple[np.ndarray, np.ndarray]:
    """A material for each particle, and the restitution of every two materials, NaN where the scene gives none.

    Particles of the same groups share a material.
    """
    groups = sorted({group for pair in contacts.pairs for group in pair.between})
    member = np.zeros((count, len(groups)), dtype=bool)
    for column, (first, length) in enumerate(groups):
        member[first : first + length, column] = True
    kinds, material = np.unique(member, axis=0, return_inverse=True) if groups else (member[:1], np.zeros(count, np.intp))
    restitution = np.full((len(kinds), len(kinds)), np.nan)
    for pair in contacts.pairs:  # a later pair of groups overrides an earlier one
        first, second = (np.flatnonzero(kinds[:, groups.index(group)]) for group in pair.between)
        restitution[np.ix_(first, second)] = pair.restitution
        restitution[np.ix_(second, first)] = pair.restitution
    return material.reshape(-1).astype(np.int32), restitution
