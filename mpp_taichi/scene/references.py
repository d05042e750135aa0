"""References: the particles and lattices that a scene names, found once all particles are counted."""

from dataclasses import replace
from typing import Any

from mpp_taichi.component import Declaration, declaration
from mpp_taichi.errors import PlacementError
from mpp_taichi.scene.did_you_mean import choices
from mpp_taichi.scene.document import Node
from mpp_taichi.scene.expectations import kind_of
from mpp_taichi.scene.faults import Faults, shown
from mpp_taichi.scene.four_in_row import checked_four, four_of_chain
from mpp_taichi.scene.layout import ParticleLayout, build, particle_layout, singles
from mpp_taichi.scene.messages import key_text
from mpp_taichi.scene.model import KIND_OF_KEY
from mpp_taichi.scene.spec import ComponentSpec, Expectation, PairSpec, PanelSpec, SceneSpec
from mpp_taichi.scene.view_checks import resolve_view

_NAMING = ("Particle", "Particles", "Groups", "Pair", "FourInRow", "ModeNumbers")
"""Types of parameters that name particles or a lattice."""


def resolve(spec: SceneSpec, tree: Node, faults: Faults) -> SceneSpec:
    """The scene with an index for every Particle; a name without a particle becomes a fault."""

    def count(entry: ComponentSpec) -> int:
        try:
            return 1 if entry.name in single else build("generators", entry).particle_count()
        except PlacementError as error:
            faults.add(entry.location, entry.name, str(error))
            return 1

    single = singles(spec.particles)
    layout = particle_layout(spec.particles, count)
    _check_names(spec, tree, faults)
    finder = _Finder(layout, tree, faults)
    changed: dict[str, Any] = {
        key: tuple(
            finder.entry(each, KIND_OF_KEY[key], (key, number, each.name)) for number, each in enumerate(getattr(spec, key))
        )
        for key in ("particles", "springs", "forces", "walls")
    }
    changed["integrator"] = finder.entry(spec.integrator, "integrators", ("integrator", spec.integrator.name))
    if spec.contacts is not None:
        pairs = tuple(finder.pair(number, pair) for number, pair in enumerate(spec.contacts.pairs))
        changed["contacts"] = replace(spec.contacts, pairs=pairs)
    changed["expect"] = tuple(
        replace(each, parameters=finder.parameters(each.parameters, _measured(each.quantity), ("expect", each.quantity)))
        for each in spec.expect
    )
    if spec.sweep is not None:
        found = {key: finder.measured(getattr(spec.sweep, key), key) for key in ("measure", "stop")}
        changed["sweep"] = replace(spec.sweep, **found)
    if spec.record.table is not None:
        table, path = spec.record.table, ("record", "table", "columns")
        columns = (finder.entry(each, "quantities", (*path, number, each.name)) for number, each in enumerate(table.columns))
        changed["record"] = replace(spec.record, table=replace(table, columns=tuple(columns)))
    changed["view"] = resolve_view(spec.view, layout, finder)
    changed["inspect"] = tuple(finder.panel(number, each) for number, each in enumerate(spec.inspect))
    if spec.modes is not None:
        shown_modes = {("show", number): numbers for number, numbers in enumerate(spec.modes.show)}
        finder.modes(spec.modes.of, shown_modes, ("modes",))
    for number, each in enumerate(changed["springs"]):
        if each.parameters.get("of", "") is None:  # a group that is not there, which is a fault by now
            continue
        try:
            build("networks", each).spring_count(layout.lattice)
        except PlacementError as error:
            place = (tree.value["springs"].value[number].value[each.name].get("of") or tree).location
            faults.add(place, f"springs[{number}].{each.name}", str(error))
    return replace(spec, **changed)


def _measured(quantity: str) -> Declaration | None:
    kind = kind_of(quantity)
    return None if kind is None else declaration(kind, quantity)


class _Finder:
    """Finds particles, and keeps the places in the scene that name them."""

    def __init__(self, layout: ParticleLayout, tree: Node, faults: Faults) -> None:
        self.layout, self.tree, self.faults = layout, tree, faults
        self._naming: dict[tuple[str, str], list[str]] = {}

    def entry(self, entry: ComponentSpec, kind: str, path: tuple[Any, ...]) -> ComponentSpec:
        """The entry with indices for the particles that it names; the entry itself where it names none."""
        naming = self._naming.get((kind, entry.name))
        if naming is None:
            naming = [each.name for each in declaration(kind, entry.name).parameters if each.type in _NAMING]
            self._naming[kind, entry.name] = naming
        if all(entry.parameters[key] is None for key in naming):
            return entry
        return replace(entry, parameters=self.parameters(entry.parameters, declaration(kind, entry.name), path))

    def measured(self, entries: tuple[Expectation, ...], key: str) -> tuple[Expectation, ...]:
        """The measures of a sweep with indices for the particles that they name."""
        path = ("sweep", key)
        return tuple(
            replace(each, parameters=self.parameters(each.parameters, _measured(each.quantity), (*path, number, each.quantity)))
            for number, each in enumerate(entries)
        )

    def parameters(self, given: dict[str, Any], declared: Declaration | None, path: tuple[Any, ...]) -> dict[str, Any]:
        found = dict(given)
        for parameter in declared.parameters if declared else ():
            value = given.get(parameter.name)
            if parameter.type == "Particle" and value is not None:
                found[parameter.name] = self._find(value, (*path, parameter.name))
            elif parameter.type == "Particles" and value is not None:
                found[parameter.name] = self.group(value, (*path, parameter.name))
            elif parameter.type == "Groups" and value is not None:
                ends = tuple(self.group(each, (*path, parameter.name, end)) for end, each in enumerate(value))
                if ends[0] is not None and ends[0] == ends[1] and ends[0][1] == 1:
                    told = f"both are {self.layout.label(ends[0][0])}, which makes no pair, must be two particles or groups"
                    self.fault((*path, parameter.name, 1), told)
                found[parameter.name] = ends
            elif parameter.type == "Pair" and value is not None:
                places = [(*path, parameter.name, end) for end in (0, 1)]
                pair = tuple(self._find(end, place) for end, place in zip(value, places, strict=True))
                if pair[0] is not None and pair[0] == pair[1]:
                    self.fault(places[1], f"both ends are {self.layout.label(pair[0])}, must be two different particles")
                found[parameter.name] = pair
            elif parameter.type == "FourInRow" and value is not None:
                found[parameter.name] = self.four(value, (*path, parameter.name))
            elif parameter.type == "ModeNumbers":
                self.modes(given["of"], {(parameter.name,): value}, path)
        return found

    def pair(self, number: int, pair: PairSpec) -> PairSpec:
        """The pair with the indices of its groups."""
        path = ("contacts", "hard_spheres", "pairs", number, "between")
        first, second = (self.group(each, (*path, end)) for end, each in enumerate(pair.between))
        return replace(pair, between=(first, second))

    def panel(self, number: int, panel: PanelSpec) -> PanelSpec:
        """The panel with the indices of the particles of its quantities."""
        x, *y = (
            self.entry(each, "quantities", ("inspect", number, *place, each.name))
            for place, each in ((("x",), panel.x), *((("y", index), each) for index, each in enumerate(panel.y)))
        )
        histogram = panel.histogram
        if histogram is not None:
            histogram = self.entry(histogram, "quantities", ("inspect", number, "histogram", histogram.name))
        return replace(panel, x=x, y=tuple(y), histogram=histogram)

    def modes(self, name: str | None, modes: dict[tuple[Any, ...], Any], path: tuple[Any, ...]) -> None:
        """Check that `of` below the path names a lattice, and that this lattice has the modes given below the path."""
        if name is not None and name not in self.layout.lattices:
            self.fault((*path, "of"), f"no lattice is called {shown(name)}{choices(name, self.layout.lattices)}")
            return
        for place, numbers in modes.items():
            try:
                self.layout.check_mode(name, numbers)
            except PlacementError as error:
                self.fault((*path, *place), str(error))

    def _find(self, reference: int | str, path: tuple[Any, ...]) -> int | None:
        try:
            return self.layout.find(reference)
        except PlacementError as error:
            self.fault(path, str(error))
            return None

    def group(self, reference: int | str, path: tuple[Any, ...]) -> tuple[int, int] | None:
        """First index and count of a group, or of one particle; a fault where no such particle exists."""
        group = self.layout.group(reference)
        if group is not None:
            return group
        index = self._find(reference, path)
        return None if index is None else (index, 1)

    def four(self, value: Any, path: tuple[Any, ...]) -> tuple[tuple[int, int], ...] | None:
        """Four groups of one size; a fault where they are none."""
        try:
            if not isinstance(value, tuple):
                chain = self.group(value, path)
                return None if chain is None else four_of_chain(chain)
            named = [self.group(each, (*path, place)) for place, each in enumerate(value)]
            found = tuple(each for each in named if each is not None)
            return checked_four(found) if len(found) == len(named) else None
        except PlacementError as error:
            self.fault(path, str(error))
            return None

    def fault(self, path: tuple[Any, ...], message: str) -> None:
        """Add a fault at a path of the scene."""
        walked = list(self.tree.along(path))
        self.faults.add(walked[-1][1].location if walked else self.tree.location, key_text(_as_written(path, walked)), message)


def _as_written(path: tuple[Any, ...], walked: list[tuple[Any, Node]]) -> list[Any]:
    """A path without the index of a list that the scene gives as a single entry."""
    there = iter([*(key for key, _ in walked), None])
    ahead = next(there)
    found = []
    for step in path:
        if step == ahead:
            ahead = next(there)
        elif isinstance(step, int):
            continue
        found.append(step)
    return found


def _check_names(spec: SceneSpec, tree: Node, faults: Faults) -> None:
    """Refuse a name that two entries have, or that could be read as an index or as `group[number]`."""
    first: dict[str, int] = {}
    for number, entry in enumerate(spec.particles):
        name = entry.parameters.get("name")
        if not name:
            continue
        told = ""
        if name in first:
            told = f"{shown(name)} is the name of particles[{first[name]}] already"
        elif "[" in name or name.isdigit():
            told = f"{shown(name)} cannot be a name, allowed: text without [ that is no number"
        if told:
            place = tree.value["particles"].value[number].value[entry.name].value["name"].location
            faults.add(place, f"particles[{number}].{entry.name}.name", told)
        first.setdefault(name, number)
