"""Constraints: the rigid rods of a phase and its bodies that are given functions of the time, as parts of its step."""

from typing import Any

import numpy as np

from mpp_taichi.device.backends import Device
from mpp_taichi.errors import BackendError, PrecisionError, StateError
from mpp_taichi.precision import carries_low_parts
from mpp_taichi.scene.changing_numbers import changes_of, with_changes
from mpp_taichi.scene.layout import layout_of
from mpp_taichi.scene.path_checks import paths_of
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.simulation import refusals
from mpp_taichi.snapshot import Snapshot

OFF_THE_PATH = 1e-4
"""Distance from a path, as a share of the largest coordinate, that the rounding of places and times to f32 cannot explain."""


def rods_of(spec: SceneSpec, start: Snapshot, device: Device) -> Any:
    """The solver that keeps the lengths of the rods; None for a scene without rods.

    Raises:
        UnsupportedError: the device is no CPU.
    """
    if not len(start.rods):
        return None
    from mpp_taichi.solvers.rod_projection import RodProjection  # only for scenes that have rods

    refusals.check_rods(spec, device)
    return RodProjection(start, spec.dimensions)


def given_functions_of(spec: SceneSpec, start: Snapshot, device: Device, *, plan: str, replica_count: int) -> tuple[Any, Any]:
    """The bodies on given paths, and the masses and charges that change; each None for a scene without them.

    Raises:
        PrecisionError: the precision has low parts, which such places and numbers lack, or the device lacks a function.
        BackendError: copies of the system are to run side by side.
    """
    side_by_side = plan == "replicas" or replica_count > 1
    paths, changes = _driven_bodies_of(spec, start, device), _changing_numbers_of(spec, start, device)
    if side_by_side and paths is not None:
        raise BackendError("the plan replicas has no bodies on a path; run one copy of the scene")
    if side_by_side and changes is not None:
        raise BackendError("the plan replicas has no masses and charges that change; run one copy of the scene")
    return paths, changes


def _driven_bodies_of(spec: SceneSpec, start: Snapshot, device: Device) -> Any:
    if not start.driven:
        return None
    from mpp_taichi.forces._driven_bodies import DrivenBodies  # only for scenes that have paths

    laws = paths_of(spec)
    if carries_low_parts(device.precision):
        raise PrecisionError(
            f"the places of bodies on a path have no low parts, so they cannot run in {device.precision}; use f64 or f32"
        )
    for name in (name for law in laws for name in law.functions):
        refusals.check_functions(f"a path calls {name}", device)
    return DrivenBodies(start.driven, laws)


def _changing_numbers_of(spec: SceneSpec, start: Snapshot, device: Device) -> Any:
    changes = changes_of(spec, start)
    if not changes:
        return None
    from mpp_taichi.forces._changing_numbers import ChangingNumbers  # only for scenes that have such numbers

    if carries_low_parts(device.precision):
        raise PrecisionError(
            f"masses and charges that change have no low parts, so they cannot run in {device.precision}; use f64 or f32"
        )
    for change in changes:
        for name in change.law.functions:
            refusals.check_functions(f"a {change.quantity}_factor calls {name}", device)
    return ChangingNumbers(changes, start)


def check_on_paths(spec: SceneSpec, start: Snapshot) -> None:
    """Refuse a state from which a run is to go on, where a body is not on its path, as after a change of the path.

    Raises:
        StateError: a body is farther from its path than rounding to f32 explains.
    """
    if not spec.driven_entries:
        return
    layout = layout_of(spec)
    for (number, _entry), law in zip(spec.driven_entries, paths_of(spec), strict=True):
        place, velocity = law.at(start.time)
        index = layout.starts[number]
        if index >= start.particle_count:  # of another scene, which `continuing` refuses
            return
        distance = float(np.linalg.norm(start.position[index] - place))
        scale = np.abs(place).max() + np.abs(velocity).max() * abs(start.time) + np.abs(start.position).max()
        if not distance <= OFF_THE_PATH * scale:
            where = f"at t = {start.time:g} the state has {layout.label(index)}"
            raise StateError(f"{where} {distance:.3g} from its path: the run that wrote the state had another path")


def moved_ahead(spec: SceneSpec, now: Snapshot, offset: float) -> Snapshot:
    """The particles a time `offset` [time] later, at x + v offset; bodies on paths are on their paths."""
    time = now.time + offset
    position, velocity = now.position + now.velocity * offset, now.velocity
    if now.driven and offset != 0.0:
        velocity = velocity.copy()
        for index, law in zip(now.driven, paths_of(spec), strict=True):
            position[index], velocity[index] = law.at(time)
    return with_changes(spec, now.moved(position=position, velocity=velocity, time=time, step=now.step))
