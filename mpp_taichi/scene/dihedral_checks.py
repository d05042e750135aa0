"""Checks of forces of torsion: where they have no meaning, and particles on a line, about which no angle has a value."""

from collections.abc import Iterator

import numpy as np

from mpp_taichi.scene.contacts import merges
from mpp_taichi.scene.faults import Faults
from mpp_taichi.scene.layout import ParticleLayout
from mpp_taichi.scene.spec import Location, SceneSpec
from mpp_taichi.snapshot import Snapshot

LEAST_SINE = 1e-6
"""Sine of the angle between two links below which three particles are on a line: places in f32 may be off by as much."""


def check_dihedrals(spec: SceneSpec, faults: Faults) -> None:
    """Refuse torsion in the plane, where particles merge and in a box that repeats."""
    for number, entry in enumerate(spec.forces):
        if not entry.flag("forces", "twists"):
            continue
        key = f"forces[{number}].{entry.name}"
        if spec.dimensions != 3:
            faults.add(entry.location, key, "a chain in the plane has no torsion, must be in a scene with dimensions: 3")
        if merges(spec):
            faults.add(entry.location, key, "cannot be where spheres merge: the chain would lose a particle")
        if any(wall.flag("walls", "repeats") for wall in spec.walls):
            faults.add(entry.location, key, "cannot be in a box that repeats: a chain would be cut at its faces")


def line_faults(spec: SceneSpec, snapshot: Snapshot, layout: ParticleLayout) -> Iterator[tuple[Location, str]]:
    """Three particles in a row on a line, or two at one place, at the start: the first for each force of torsion."""
    for number, entry in enumerate(spec.forces):
        if not entry.flag("forces", "twists"):
            continue
        rows = np.stack([np.arange(first, first + count) for first, count in entry.parameters["of"]], axis=1)
        ways = np.diff(snapshot.position[rows], axis=1)
        lengths = np.linalg.norm(ways, axis=2)
        across = np.linalg.norm(np.cross(ways[:, :-1], ways[:, 1:]), axis=2)
        straight = ~(across > LEAST_SINE * lengths[:, :-1] * lengths[:, 1:])
        if straight.any():
            row, bend = np.argwhere(straight)[0]
            names = ", ".join(layout.label(int(each)) for each in rows[row, bend : bend + 3])
            rule = "are on a line at the start, about which the chain has no dihedral angle; must have a bend"
            yield entry.location, f"forces[{number}].{entry.name}.of: {names} {rule}"
