"""Cross checks: pairs of keys of a scene that are each valid but contradict each other."""

from mpp_taichi.scene.contacts import check_contacts
from mpp_taichi.scene.dihedral_checks import check_dihedrals
from mpp_taichi.scene.document import Node
from mpp_taichi.scene.faults import Faults
from mpp_taichi.scene.integrator_checks import check_integrator
from mpp_taichi.scene.path_checks import check_changing_numbers, check_paths
from mpp_taichi.scene.periodic_forces import check_periodic_forces
from mpp_taichi.scene.relativity_checks import check_relativity
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.scene.tree_checks import check_tree
from mpp_taichi.scene.view_checks import check_view
from mpp_taichi.scene.wall_motions import check_wall_motions
from mpp_taichi.scene.wanted import wanted_entries


def check_together(spec: SceneSpec, tree: Node, faults: Faults) -> None:
    """Add a fault for every contradiction between keys."""
    _check_run(spec, tree, faults)
    check_view(spec, tree, faults)
    _check_expect(spec, faults)
    _check_accuracy(spec, tree, faults)
    check_contacts(spec, tree, faults)
    check_integrator(spec, faults)
    check_paths(spec, tree, faults)
    check_changing_numbers(spec, tree, faults)
    check_wall_motions(spec, tree, faults)
    check_tree(spec, faults)
    check_periodic_forces(spec, faults)
    check_dihedrals(spec, faults)
    check_relativity(spec, faults)
    names = [entry.label for entry in spec.forces]
    for number, entry in enumerate(spec.forces):
        if entry.label in names[:number]:
            cure = "; give each a name: of its own" if "name" in entry.parameters else ""
            faults.add(entry.location, f"forces[{number}]", f"{entry.label} is in the list already, allowed: once{cure}")
        if entry.parameters.get("between") is not None and entry.parameters.get("solver", "direct") != "direct":
            told = "a tree sums gravity between all bodies, allowed: solver: direct"
            faults.add(entry.location, f"forces[{number}].{entry.name}.between", told)
        if not any(entry.parameters.get("direction", (1.0,))):
            faults.add(entry.location, f"forces[{number}].{entry.name}.direction", "must not be [0, 0, 0]")


def _check_run(spec: SceneSpec, tree: Node, faults: Faults) -> None:
    run = tree.get("run")
    if run is not None and spec.run.duration is not None and spec.run.steps is not None:
        faults.add(run.value["steps"].place, "run", "has both duration and steps, must have one of them")
    step = spec.integrator.parameters.get("dt")
    if step is not None and spec.run.duration is not None and step > spec.run.duration:
        key = f"integrator.{spec.integrator.name}.dt"
        place = tree.value["integrator"].value[spec.integrator.name].value["dt"].location
        longest = f"must be at most run.duration = {spec.run.duration:g}"
        faults.add(place, key, f"a step of {step:g} is longer than the run, {longest}")


def _check_accuracy(spec: SceneSpec, tree: Node, faults: Faults) -> None:
    if spec.accuracy is None:
        return
    place = tree.value["accuracy"].place
    if spec.run.duration is None:
        faults.add(place, "accuracy", "needs run.duration: the step is to be chosen")
    if spec.accuracy.of is not None:
        try:
            wanted_entries(spec, spec.accuracy.of)
        except ValueError as error:
            faults.add(tree.value["accuracy"].value["of"].location, "accuracy.of", str(error))


def _check_expect(spec: SceneSpec, faults: Faults) -> None:
    for each in spec.expect:
        key = f"expect.{each.quantity}"
        if each.below is None and each.above is None and each.near is None:
            faults.add(each.location, key, "says nothing, must have below, above, or near with within")
        if (each.near is None) != (each.within is None):
            faults.add(each.location, key, "near and within belong together: |value − near| ≤ within · |near|")
        if each.near == 0.0:
            faults.add(each.location, key, "within is relative, so near must not be 0; write below: instead")
