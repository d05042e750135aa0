"""The time between two samples of a method that takes no equal steps, where a scene gives neither it nor its own duration."""

from mpp_taichi import component
from mpp_taichi.scene.document import Node, from_python


def is_open(tree: Node) -> bool:
    """Whether the scene leaves the time between samples open: no `dt`, no `run.duration`, and a method that needs no step.

    A scene with a timeline needs it, since its later phases begin with the interval of the scene.
    """
    run, timeline = tree.get("run"), tree.get("timeline")
    if timeline is not None or _given(run, "duration") or _given(run, "steps"):
        return False
    name, parameters = _method(tree)
    if name is None or component.find_file("integrators", name) is None:
        return False
    dt = next((each for each in component.declaration("integrators", name).parameters if each.name == "dt"), None)
    return dt is not None and dt.optional and not _given(parameters, "dt")


def with_interval(tree: Node, interval: float) -> Node:
    """The tree of a scene that leaves it open, with an interval."""
    name, parameters = _method(tree)
    assert name is not None
    place = tree.location if parameters is None else parameters.location
    kept = dict(parameters.value) if parameters is not None and isinstance(parameters.value, dict) else {}
    made = from_python({name: {}}, place)
    inside = Node({**kept, "dt": from_python(interval, place)}, place, place)
    return tree.with_value({**tree.value, "integrator": made.with_value({name: inside})})


def _method(tree: Node) -> tuple[str | None, Node | None]:
    """The name of the method and its parameters; of a contact solver that flies, the method has the name of the solver."""
    node = tree.get("integrator")
    if node is not None:
        if isinstance(node.value, str):  # the mere name of a method
            return node.value, None
        if not isinstance(node.value, dict) or len(node.value) != 1:
            return None, None
        return next(iter(node.value.items()))
    contacts = tree.get("contacts")
    spheres = None if contacts is None else contacts.get("hard_spheres")
    solver = None if spheres is None else spheres.get("solver")
    name = solver.value if solver is not None else None
    if not isinstance(name, str) or component.find_file("contacts", name) is None:
        return None, None
    return (name, None) if component.flag("contacts", name, "flies") else (None, None)


def _given(node: Node | None, key: str) -> bool:
    found = None if node is None else node.get(key)
    return found is not None and found.value is not None
