"""The model of a scene: its keys and their types, built for pydantic from the components' declarations.

Components are not imported. A scene is checked against a model that holds only the components it names; the JSON Schema is
written from the model that holds all of them.
"""

from collections.abc import Callable, Iterable, Mapping
from functools import cache, lru_cache
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, create_model
from pydantic import Field as Describe
from pydantic_core import PydanticCustomError

from mpp_taichi import component
from mpp_taichi.precision import PRECISIONS
from mpp_taichi.scene import expectations, fields, inspection, table_columns, units
from mpp_taichi.scene.contacts import contacts_model
from mpp_taichi.scene.fields import Context, Field, Number, OneOrMore, Ranged, Text, Whole, Wrong
from mpp_taichi.scene.own_functions import FunctionSpec
from mpp_taichi.scene.parameters import STRICT, parameter_fields
from mpp_taichi.scene.slider_model import slider_model
from mpp_taichi.scene.spec import EventSpec, ModesSpec, RunSpec, SpringTypeSpec, ViewSpec
from mpp_taichi.scene.sweep_model import named as named_in_sweep
from mpp_taichi.scene.sweep_model import sweep_model
from mpp_taichi.scene.target import Target

# Keys of a scene that hold components, and the kind of these components.
KIND_OF_KEY = {
    "particles": "generators",
    "springs": "networks",
    "forces": "forces",
    "walls": "walls",
    "integrator": "integrators",
    "expect": "diagnostics",
}
Selection = tuple[tuple[str, tuple[str, ...]], ...]  # kind → names of the components in the model


class Units(BaseModel):
    """Units that the scene's numbers are in; with them the constant G is known."""

    model_config = STRICT
    length: Annotated[str, Text(tuple(units.LENGTHS))]
    time: Annotated[str, Text(tuple(units.TIMES))]
    mass: Annotated[str, Text(tuple(units.GRAVITATIONAL_PARAMETERS))]


class ResolvedBefore(Ranged):
    """A constant; constants.py checks its value, in the order in which constants depend on each other."""

    def check(self, value: Any, context: Context) -> Any:
        """Return the value unchanged."""
        return value


class Bound(Field):
    """One number for all precisions, or a mapping of precisions to numbers."""

    def __init__(self, number: Number) -> None:
        """Keep the allowed range of the numbers."""
        self.number = number

    def check(self, value: Any, context: Context) -> dict[str, float]:
        """Fill in every precision; f32c, ds and df64 have the bound of f32 unless they are given their own."""
        if not isinstance(value, dict):
            return dict.fromkeys(PRECISIONS, self.number.check(value, context))
        if not {"f64", "f32"} <= set(value) <= set(PRECISIONS):
            raise Wrong("must be a number or {f64: number, f32: number}, with df64, f32c and ds where they differ from f32")
        bounds = {key: self.number.check(entry, context) for key, entry in value.items()}
        return dict.fromkeys(PRECISIONS, bounds["f32"]) | bounds

    def schema(self) -> dict[str, Any]:
        """A number, or a mapping of at least two."""
        number = self.number.schema()
        each = {"type": "object", "properties": dict.fromkeys(PRECISIONS, number), "required": ["f64", "f32"]}
        return {"anyOf": [*number["anyOf"], {**each, "additionalProperties": False}]}


_BOUND_FIELDS: dict[str, Any] = {
    "below": (Annotated[dict | None, Bound(Number())], Describe(None, description="bound of the absolute value")),
    "above": (Annotated[dict | None, Bound(Number())], Describe(None, description="lower bound")),
    "near": (Annotated[float | None, Number()], Describe(None, description="the value expected")),
    "within": (Annotated[dict | None, Bound(Number(minimum=0.0))], Describe(None, description="|value − near| / |near|")),
}


def scene_model(selection: Selection) -> type[BaseModel]:
    """The pydantic model of scenes that use the selected components."""
    return _scene_model(selection, tuple(component.extra_folders))


@lru_cache(maxsize=64)
def _scene_model(selection: Selection, extra_folders: tuple[Path, ...]) -> type[BaseModel]:
    del extra_folders  # only part of the cache key: files of the same names in other folders give other models
    chosen = dict(selection)
    expect = _expect_model(chosen["diagnostics"], chosen["quantities"])
    particles, springs, forces, walls, integrator = (
        _entries(kind, chosen[kind]) for kind in ("generators", "networks", "forces", "walls", "integrators")
    )
    contacts: Any = contacts_model(chosen["contacts"])
    sweep: Any = sweep_model(chosen["diagnostics"], chosen["quantities"], _bounds(), _measured)
    quantity = inspection.quantity_of(_entries("quantities", chosen["quantities"]), chosen["quantities"])
    panel = inspection.panel_model(quantity, _one_or_more(quantity))
    record = table_columns.record_model(_list_of(quantity))
    numbers = dict[str, Annotated[float, ResolvedBefore()]]
    types = dict[str, SpringTypeSpec]
    return create_model(
        "Scene",
        __config__=STRICT,
        __doc__="A scene: particles, what acts between them, how time goes on, and the quantities that are measured.",
        title=_key(Text(), "", "title of the window and the film"),
        description=_key(Text(), "", "what the scene shows, and what a reader can try"),
        extends=_key(Text(), None, "a scene in this folder that this scene completes; mappings are merged, lists are replaced"),
        units=(
            Units | None,
            Describe(
                None,
                description="units of all numbers, from which G follows; absent: the numbers are dimensionless",
            ),
        ),
        constants=(numbers | None, Describe(None, description="names for numbers, usable in expressions")),
        functions=(
            dict[str, FunctionSpec] | None,
            Describe(None, description="curves through points, by name, for formulas to call; absent: none"),
        ),
        dimensions=_key(Whole(minimum=2, maximum=3), 3, "2 for a scene in the x–y plane"),
        seed=_key(Whole(minimum=0, maximum=2**53), 0, "seed of all random numbers of the scene"),
        particles=(_list_of(particles), Describe(min_length=1, description="generators, in the order of the indices")),
        springs=(_list_of(springs), Describe([], description="springs and rods between particles")),
        spring_types=(
            types | None,
            Describe(None, description="parameters of a kind of springs, for entries with `type: name`"),
        ),
        spring_damping=_key(Text(("axial", "full")), "axial", "damping along the spring, or of the whole relative velocity"),
        forces=(_list_of(forces), Describe([], description="forces on the particles besides springs")),
        contacts=(
            contacts | None,
            Describe(None, description="contacts of particles that touch; absent: no contacts"),
        ),
        walls=(_list_of(walls), Describe([], description="walls that enclose the particles; they need contacts")),
        integrator=(
            integrator | None,
            Describe(None, description="the method that advances time; not needed where contacts are event_driven"),
        ),
        accuracy=_key(
            Target(),
            None,
            "the error allowed, of positions or of a quantity of expect:; integrator, step and precision are chosen for it",
        ),
        horizon=_key(
            fields.Flag(),
            None,
            "say until when positions are right to a thousandth of the system's size; absent: only with accuracy",
        ),
        move_to_center_of_mass=_key(fields.Flag(), False, "start with the centre of mass at rest at the origin"),
        run=(RunSpec, Describe(RunSpec(), description="length of the run")),
        timeline=(_list_of(EventSpec), Describe([], description="changes at given times; a list of {at, set}")),
        view=(ViewSpec, Describe(ViewSpec(), description="the picture: camera, colors and marks")),
        record=(record, Describe(record(), description="settings of a film, and the table of a run")),
        inspect=(_list_of(panel), Describe([], description="panels that plot quantities while the scene runs")),
        sliders=(_list_of(slider_model()), Describe([], description="parameters to be moved while the scene runs")),
        modes=(ModesSpec | None, Describe(None, description="modes of the springs that are followed while they swing")),
        expect=(expect | None, Describe(None, description="results of the physics that the run must have")),
        sweep=(sweep | None, Describe(None, description="copies of the scene with other values, for the verb sweep")),
    )


def all_components() -> Selection:
    """Every component a scene may name."""
    return tuple((kind, tuple(available(kind))) for kind in component.KINDS)


def available(kind: str) -> list[str]:
    """The names a scene may use; bond forces act through `springs:` and are not listed under `forces:`."""
    return [name for name in component.names(kind) if _is_listed(kind, name)]


def _is_listed(kind: str, name: str) -> bool:
    return component.declaration(kind, name).base != "BondForce"


def select(scene: Mapping[str, Any]) -> Selection:
    """The existing components that a scene, as plain data, names."""
    found = []
    in_sweep = named_in_sweep(scene)
    for key, kind in KIND_OF_KEY.items():
        entries = scene.get(key)
        entries = [entries] if isinstance(entries, dict) else entries if isinstance(entries, list) else []
        named = {name for entry in entries if isinstance(entry, dict) for name in entry}
        named |= in_sweep if kind == "diagnostics" else set()
        found.append((kind, tuple(name for name in sorted(named) if _exists(kind, name))))
    solver = contact_solver(scene)
    expected = scene.get("expect")
    expected_words = set(expected if isinstance(expected, dict) else ())
    words = inspection.named(scene) | table_columns.named(scene) | expected_words | in_sweep
    quantities = tuple(name for name in sorted(words, key=str) if _exists("quantities", name))
    return (*found, ("contacts", (solver,) if solver is not None else ()), ("quantities", quantities))


def _exists(kind: str, name: str) -> bool:
    """Whether a scene may use this name; only the file of this name is read."""
    return component.find_file(kind, name) is not None and _is_listed(kind, name)


def contact_solver(scene: Mapping[str, Any]) -> str | None:
    """The contact solver that a scene, as plain data, names, if it exists."""
    entry = scene.get("contacts")
    spheres = entry.get("hard_spheres") if isinstance(entry, dict) else None
    name = spheres.get("solver") if isinstance(spheres, dict) else None
    return name if isinstance(name, str) and _exists("contacts", name) else None


def _key(check: Field, default: Any, description: str) -> Any:
    return (Annotated[Any, check], Describe(default, description=description))


def _entries(kind: str, names: Iterable[str]) -> Any:
    """The type of a one-key mapping {component: {parameters}}."""
    members: dict[str, Any] = {}
    for name in names:
        declared = component.declaration(kind, name)
        summary = declared.summary.split("\n\n")[0]
        fields = parameter_fields(declared.parameters)
        body = create_model(definition_name(kind, declared), __config__=STRICT, __doc__=summary, **fields)
        members[name] = (_checked_before(body, _nothing_is_empty), Describe(None, description=summary))
    config = ConfigDict(**STRICT, json_schema_extra={"minProperties": 1, "maxProperties": 1})
    entry = create_model(f"{kind.capitalize()}Entry", __config__=config, __doc__=f"One of {kind}/.", **members)
    return _checked_before(entry, _only_one)


def definition_name(kind: str, declared: component.Declaration) -> str:
    """The name of a component's definition in the schema; it says the kind where an earlier kind has the same name."""
    earlier = component.KINDS[: component.KINDS.index(kind)]
    taken = any(component.find_file(other, declared.name) is not None for other in earlier)
    return f"{declared.class_name}Of{kind.capitalize()}" if taken else declared.class_name


def _checked_before(model: Any, check: Callable[[Any], Any]) -> Any:
    return Annotated[model, BeforeValidator(check)]


def _expect_model(diagnostics: Iterable[str], measured: Iterable[str]) -> Any:
    quantities: dict[str, Any] = {}
    bounds = _one_or_more(_bounds())
    for name, summary in expectations.SUMMARY_QUANTITIES.items():
        quantities[name] = (bounds, Describe(None, description=summary))
    for name in [*diagnostics, *(each for each in measured if expectations.kind_of(each) == "quantities")]:
        summary = component.declaration(str(expectations.kind_of(name)), name).summary.split("\n\n")[0]
        quantities[name] = (_one_or_more(_measured(name)), Describe(None, description=summary))
    return create_model("Expect", __config__=STRICT, **quantities)


@cache
def _bounds() -> Any:
    """The bounds of a quantity that has no keys of its own."""
    return create_model("Bounds", __config__=STRICT, **_BOUND_FIELDS)


def _measured(name: str) -> Any:
    """The keys of a quantity or diagnostic in `expect:` and `sweep:`: bounds, its parameters, and which value counts."""
    kind = str(expectations.kind_of(name))
    return _measured_from(kind, component.declaration(kind, name))


@lru_cache(maxsize=512)
def _measured_from(kind: str, declared: component.Declaration) -> Any:
    reduction = expectations.reduction_fields(declared.name) if kind == "quantities" else {}
    keys = {**_BOUND_FIELDS, **parameter_fields(declared.parameters), **reduction}
    return create_model(f"{declared.class_name}Bounds", __config__=STRICT, **keys)


def _one_or_more(body: Any) -> Any:
    return Annotated[_list_of(body), OneOrMore()]


def _list_of(item: Any) -> Any:
    return list[item]


def _nothing_is_empty(value: Any) -> Any:
    """`leapfrog:` with nothing after it is a component without parameters."""
    return {} if value is None else value


def _only_one(value: Any) -> Any:
    if isinstance(value, dict) and len(value) == 1:
        return value
    raise PydanticCustomError("not_one", "must be one component")
