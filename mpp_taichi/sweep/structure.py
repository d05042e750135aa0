"""Structure: which members can share one compiled step and one launch, and which must be run one after the other."""

import hashlib
from collections.abc import Hashable

import numpy as np

from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.scene.tree_checks import tree_of
from mpp_taichi.snapshot import Snapshot

SHARED_ARRAYS = ("radius", "free", "color")
"""Arrays of particles that all replicas share; positions, velocities, masses and charges are their own."""


def key_of(spec: SceneSpec, start: Snapshot) -> Hashable:
    """All that is compiled into a step or stored once for all replicas: members with the same key can share a launch."""
    entries = [(kind, entry.name, _told(entry.parameters)) for kind, entry in _entries(spec)]
    arrays = [getattr(start, name) for name in SHARED_ARRAYS]
    arrays += [getattr(start.springs, name) for name in ("between", "stiffness", "damping", "rest_length")]
    arrays += [start.rods.between, start.rods.length, start.mass > 0.0]
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(str(array.shape).encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    measures = () if spec.sweep is None else tuple((each.quantity, _told(each.parameters)) for each in spec.sweep.measure)
    return (spec.dimensions, spec.spring_damping, _told(vars(spec.run)), tuple(entries), measures, digest.hexdigest())


def why_alone(spec: SceneSpec) -> str:
    """Why members of this scene are run one after the other, in processes; empty where they run side by side as replicas."""
    if spec.contacts is not None:
        return "collisions are resolved for one copy at a time"
    if spec.timeline:
        return "a timeline changes the step while it runs"
    if tree_of(spec) is not None:
        return "a tree is built by all threads for one copy"
    if spec.rigid_entries:
        return "rods are solved for one copy at a time"
    return ""


def _entries(spec: SceneSpec):
    yield "integrator", spec.integrator
    for kind in ("forces", "walls"):
        for entry in getattr(spec, kind):
            yield kind, entry


def _told(parameters) -> str:
    return repr(sorted(parameters.items(), key=lambda item: item[0]))
