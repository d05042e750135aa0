"""Force solvers as a part of methods: `leapfrog` sums gravity pair by pair, `leapfrog+tree-1e-3` by a tree of that accuracy."""

from collections.abc import Sequence
from dataclasses import replace

from mpp_taichi import component
from mpp_taichi.scene.faults import Faults
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.scene.tree_checks import DEFAULT_ACCURACY, check_tree, tree_of
from mpp_taichi.snapshot import Snapshot

MARK = "+tree-"
ACCURACIES = (1e-2, 1e-3, 1e-4, 1e-5)
FEWEST_BODIES = 3000  # below, the direct sum is both exact and faster (docs/gravity.md)
MOST_BODIES = 100_000  # whose direct sums take some seconds, few enough for a reference


def split(name: str) -> tuple[str, float | None]:
    """Integrator and accuracy of the tree, None for the direct sum; ValueError where the text is no such accuracy."""
    integrator, mark, text = name.partition(MARK)
    if not mark:
        return name, None
    gravity = component.declaration("forces", component.marked("forces", "can_use_tree")[0])
    (limits,) = (parameter for parameter in gravity.parameters if parameter.name == "accuracy")
    least, most = limits.minimum or 0.0, limits.maximum or 1.0
    try:
        accuracy = float(text)
    except ValueError:
        accuracy = -1.0
    if not least <= accuracy <= most:
        raise ValueError(f"after {MARK} comes the accuracy of the tree, {least:g} to {most:g}, not {text!r}")
    return integrator, accuracy


def by_tree(name: str) -> bool:
    """Whether the method of this name sums gravity by a tree."""
    return split(name)[1] is not None


def joined(integrator: str, accuracy: float | None) -> str:
    """`leapfrog+tree-1e-3`; equal numbers always give the same text."""
    if accuracy is None:
        return integrator
    digits, _, power = f"{accuracy:.5e}".partition("e")
    return f"{integrator}{MARK}{float(digits):g}e{int(power)}"


def own_name(spec: SceneSpec) -> str:
    """The scene's own method."""
    tree = tree_of(spec)
    return joined(spec.integrator.name, None if tree is None else tree.parameters["accuracy"] or DEFAULT_ACCURACY)


def with_force_solver(spec: SceneSpec, accuracy: float | None) -> SceneSpec:
    """The scene with gravity summed by a tree of this accuracy, or directly."""
    chosen = {"solver": "direct" if accuracy is None else "tree", "accuracy": accuracy}
    forces = tuple(
        replace(force, parameters={**force.parameters, **chosen}) if force.flag("forces", "can_use_tree") else force
        for force in spec.forces
    )
    return replace(spec, forces=forces)


def variants(spec: SceneSpec, start: Snapshot, asked: Sequence[str]) -> list[str]:
    """Methods by a tree: the wanted methods, and for many particles the scene's own integrator with several accuracies."""
    names = [own_name(spec), *asked]
    if start.particle_count >= FEWEST_BODIES:
        names += [joined(spec.integrator.name, accuracy) for accuracy in ACCURACIES]
    return [name for name in dict.fromkeys(names) if by_tree(name)]


def allows_tree(spec: SceneSpec) -> bool:
    """Whether a scene that asks for a tree may have it."""
    faults = Faults()
    check_tree(spec, faults)
    return tree_of(spec) is not None and not faults.found
