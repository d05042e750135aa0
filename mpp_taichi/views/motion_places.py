"""The places of a motion as a camera without a position needs them."""

import numpy as np

from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.views.appearance import DrawnPlaces


def chooses_its_place(spec: SceneSpec) -> bool:
    """Whether the camera of a scene follows from the motion: it has no position, and there are no walls to frame."""
    return spec.view.camera.position is None and not spec.walls


def places_of(snapshot: Snapshot, spec: SceneSpec) -> np.ndarray:
    """Positions and radii of all particles as they are drawn, (count, 4); NaN for a particle that has merged into another."""
    bodies = spec.view.bodies
    position = np.where(snapshot.present[:, None], DrawnPlaces(bodies).of(snapshot.position), np.nan)
    radius = np.array(snapshot.radius, dtype=float)
    for (first, group), body in bodies.items():
        radius[first : first + group] *= body.radius_scale
    return np.concatenate([position, radius[:, None]], axis=1)
