"""Estimate: the memory and the work of a scene, before anything is allocated."""

import math
from dataclasses import dataclass

from mpp_taichi.errors import CapacityError
from mpp_taichi.scene import timeline
from mpp_taichi.scene.available_memory import available_bytes
from mpp_taichi.scene.layout import build, layout_of
from mpp_taichi.scene.pair_forces import is_pair_force
from mpp_taichi.scene.periodic_forces import box_of_pair_forces
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.scene.tree_checks import VISITS_OF_A_TREE, tree_of
from mpp_taichi.wording.told_apart import told_apart

# Host memory taken while a scene is assembled, device fields included: upper bounds for the estimate.
BYTES_PER_PARTICLE = 600
BYTES_PER_SPRING = 400
BYTES_PER_PARTICLE_OF_A_TREE = 290

LARGEST_COUNT = 2**31 - 1  # an index is a signed 32-bit integer on every device
MOST_STEPS = 10**9


@dataclass(frozen=True)
class Estimate:
    """The memory and the work of a run.

    bytes                              host memory while the scene is assembled and copied to the device, an upper bound
    pair_interactions_per_evaluation   ordered pairs N (N − 1) that one evaluation of the pair forces visits; with a tree, about
                                       the number of nodes and bodies that it visits; in a periodic box about the number of
                                       pairs within the cutoff, at an even density
    steps                              None where the scene does not end by itself
    """

    particle_count: int
    spring_count: int
    bytes: int
    pair_interactions_per_evaluation: int
    steps: int | None


def estimate(spec: SceneSpec) -> Estimate:
    """Count particles, springs, pairs and steps without creating any of them."""
    layout = layout_of(spec)
    particles = layout.total
    springs = sum(build("networks", entry).spring_count(layout.lattice) for entry in spec.springs)
    has_pairs = any(is_pair_force(entry.name) for entry in spec.forces)
    by_tree = tree_of(spec) is not None
    pairs = particles * (particles - 1) if has_pairs else 0
    return Estimate(
        particle_count=particles,
        spring_count=springs,
        bytes=particles * (BYTES_PER_PARTICLE + (BYTES_PER_PARTICLE_OF_A_TREE if by_tree else 0))
        + springs * BYTES_PER_SPRING
        + sum(estimate(event.scene).bytes for event in spec.timeline),  # every phase stays, for a restart
        pair_interactions_per_evaluation=min(pairs, VISITS_OF_A_TREE * particles) if by_tree else _near(spec, pairs),
        steps=_steps(spec),
    )


def _near(spec: SceneSpec, pairs: int) -> int:
    """Of so many ordered pairs about the number within the cutoff, where pair forces act through the faces of a box."""
    box = box_of_pair_forces(spec)
    if box is None:
        return pairs
    volume = math.prod(box.parameters["upper"][k] - box.parameters["lower"][k] for k in range(spec.dimensions))
    reach = max(force.law.fixed_reach for force in spec.forces if is_pair_force(force.name))
    ball = math.pi * reach**2 if spec.dimensions == 2 else 4.0 / 3.0 * math.pi * reach**3
    return round(pairs * min(1.0, ball / volume))


def check_capacity(needed: Estimate) -> None:
    """Raise CapacityError, with the numbers, when the scene needs more memory than this machine has."""
    for count, what in ((needed.particle_count, "particles"), (needed.spring_count, "springs")):
        if count > LARGEST_COUNT:
            raise CapacityError(f"the scene has {_short(count)} {what}, allowed: {LARGEST_COUNT}")
    free = available_bytes()
    if free is not None and needed.bytes > free:
        needs, has = told_apart(needed.bytes / 2**30, free / 2**30, digits=3)
        raise CapacityError(
            f"the scene needs {needs} GiB for {needed.particle_count} particles and "
            f"{needed.spring_count} springs, and {has} GiB are available to this process"
        )
    if needed.steps is not None and needed.steps > MOST_STEPS:
        steps = _short(needed.steps)
        raise CapacityError(f"the run takes {steps} steps, allowed: {MOST_STEPS}; enlarge dt or shorten run.duration")


def _steps(spec: SceneSpec) -> int | None:
    if spec.run.steps is not None:
        return spec.run.steps
    step = spec.integrator.parameters.get("dt")
    if spec.run.duration is None or step is None:
        return None
    return timeline.step_count(spec, spec.run.duration)


def _short(count: int) -> str:
    return str(count) if count < 10**15 else f"{count:.3g}"
