"""Checks of a view: the bodies that it names become indices, and contradictory keys become faults."""

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any

from mpp_taichi.scene.body_view_checks import Finder, check_body, check_picture
from mpp_taichi.scene.body_view_spec import BodyViewSpec
from mpp_taichi.scene.did_you_mean import allowed
from mpp_taichi.scene.document import Node
from mpp_taichi.scene.faults import Faults
from mpp_taichi.scene.layout import ParticleLayout
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.scene.view_spec import ArrowsSpec, GroupColorsSpec, ViewSpec


def resolve_view(view: ViewSpec, layout: ParticleLayout, finder: Finder) -> ViewSpec:
    """The view with every name an index."""
    bodies: dict[Any, BodyViewSpec] = {}
    lit = bool(view.light) or any(body.light is not None for body in view.bodies.values())
    for name, body in view.bodies.items():
        path = ("view", "bodies", name)
        key = finder.group(name, path)
        primary = finder.group(body.around, (*path, "around")) if body.around is not None else None
        check_body(body, path, finder, lit=lit)
        if key is None:
            continue
        if key in bodies:
            finder.fault(path, "is drawn by another entry already")
        bodies[key] = replace(body, around=primary[0] if primary is not None else None)
    if view.sky is not None:
        check_picture(view.sky.file, ("view", "sky", "file"), finder)
    if _circle(bodies):
        finder.fault(("view", "bodies"), "bodies are drawn around one another in a circle, must end at a body around none")
    changed: dict[str, Any] = {"bodies": bodies}
    if view.color_by is not None and view.color_by.group is not None:
        groups = _groups(view.color_by.group, layout, finder)
        changed["color_by"] = replace(view.color_by, group=replace(view.color_by.group, of=groups))
    changed["arrows"] = tuple(
        _arrows_of(arrows, ("view", "arrows", number), finder) for number, arrows in enumerate(view.arrows)
    )
    for number, light in enumerate(view.light):
        if not any(light.direction):
            finder.fault(("view", "light", number, "direction"), "must not be [0, 0, 0]")
    changed["labels"] = _labels(view.labels, layout, finder)
    return replace(view, **changed)


def _labels(labels: Any, layout: ParticleLayout, finder: Finder) -> Any:
    """True, or (name, first index, count) of each body or group that is named in the picture."""
    if isinstance(labels, bool):
        return labels or ()
    found = []
    for number, each in enumerate(labels):
        if (group := finder.group(each, ("view", "labels", number))) is not None:
            name = layout.entries[layout.entry_of(group[0])].parameters.get("name") if isinstance(each, int) else None
            found.append((str(name or each), *group))
    return tuple(found)


def _arrows_of(arrows: ArrowsSpec, path: tuple[Any, ...], finder: Finder) -> ArrowsSpec:
    """The arrows with every name an index."""
    key, other = ("scale", "time") if arrows.quantity == "velocity" else ("time", "scale")
    if getattr(arrows, key) is not None:
        finder.fault((*path, key), f"is not for arrows of {arrows.quantity}: their length is said by {other}")
    if arrows.of is None:
        return arrows
    found = [finder.group(each, (*path, "of", number)) for number, each in enumerate(arrows.of)]
    return replace(arrows, of=tuple(each for each in found if each is not None))


def _groups(colors: GroupColorsSpec, layout: ParticleLayout, finder: Finder) -> tuple[tuple[str, int, int], ...]:
    """(name, first index, count) of the groups that get different colours."""
    if colors.of is None:
        labels = [entry.parameters.get("name") or f"{entry.name} {number}" for number, entry in enumerate(layout.entries)]
        return tuple(zip(labels, layout.starts, layout.counts, strict=True))
    found = [(str(each), finder.group(each, ("view", "color_by", "group", "of", n))) for n, each in enumerate(colors.of)]
    return tuple((label, *group) for label, group in found if group is not None)


def _circle(bodies: Mapping[tuple[int, int], BodyViewSpec]) -> bool:
    """Whether the bodies named by `around`, one after the other, lead back to the first."""
    moved = [(range(first, first + count), body.around) for (first, count), body in bodies.items() if body.around is not None]
    around = {index: primary for indices, primary in moved for index in indices}
    for index in set(around.values()):
        following, seen = around.get(index), {index}
        while following is not None:
            if following in seen:
                return True
            seen.add(following)
            following = around.get(following)
    return False


def check_view(spec: SceneSpec, tree: Node, faults: Faults) -> None:
    """Add a fault for every contradiction between keys of the view."""
    view, node = spec.view, tree.get("view")
    if node is None:
        return
    _check_camera(view, node, faults)
    for key in ("color_by", "spring_color_by"):
        if (chosen := getattr(view, key)) is not None:
            _check_colors(chosen, key, node.value[key], faults)
    if view.sky is not None and view.sky.stars and view.sky.file:
        faults.add(node.value["sky"].location, "view.sky", "has stars and a file, must have one of them")


def _check_camera(view: ViewSpec, tree: Node, faults: Faults) -> None:
    camera, node = view.camera, tree.get("camera")
    if node is None:
        return
    if camera.position is not None and camera.position == camera.look_at:
        faults.add(node.location, "view.camera", "position and look_at must be different points")
    if camera.up is not None and not any(camera.up):
        faults.add(node.location, "view.camera.up", "must not be [0, 0, 0]")


def _check_colors(chosen: Any, key: str, node: Node, faults: Faults) -> None:
    names = [each.name for each in fields(chosen)]
    given = [name for name in names if getattr(chosen, name) is not None]
    if len(given) != 1:
        faults.add(node.location, f"view.{key}", f"must be one quantity, not {len(given)}, {allowed(names)}")
    for name in given:
        scale = getattr(chosen, name)
        low_high = getattr(scale, "range", None)
        if low_high is None:
            continue
        if not low_high[0] < low_high[1]:
            faults.add(node.value[name].value["range"].location, f"view.{key}.{name}.range", "must go from low to high")
        if scale.logarithmic and not low_high[0] > 0.0:
            faults.add(node.value[name].value["range"].location, f"view.{key}.{name}.range", "must be above 0 for a logarithm")
