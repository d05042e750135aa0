"""Inspection: the model of `inspect:`, panels that plot one quantity against another, or how a quantity is distributed."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Annotated, Any

from pydantic import BaseModel, create_model
from pydantic import Field as Describe
from pydantic_core import core_schema

from mpp_taichi import component
from mpp_taichi.scene.did_you_mean import choices
from mpp_taichi.scene.document import Node
from mpp_taichi.scene.faults import Faults, shown
from mpp_taichi.scene.fields import Context, Field, Flag, ListOf, Number, PerParticle, Text, Whole
from mpp_taichi.scene.parameters import STRICT
from mpp_taichi.scene.spec import ComponentSpec, PanelSpec

PANELS_ALLOWED = 12  # in a picture of 720 rows more could not be read
CURVES_ALLOWED = 8
THEORY_NAMES = ("t", "x")
"""The names that the expression `theory:` may use besides constants: time, and the quantity along x."""
DISTRIBUTIONS = ("maxwell_boltzmann",)
DISTRIBUTED = ("speed", "velocity")
"""Quantities whose distribution in a gas is known."""
DISTRIBUTABLE = "OfEach"
"""Base of quantities that every particle, or every spring, has for itself."""


class WordOrEntry:
    """An entry {quantity: {parameters}}, or only the word for a quantity without parameters."""

    def __init__(self, words: Sequence[str]) -> None:
        """Keep the words for the schema; an unknown word is found when the entry is checked."""
        self.words = tuple(words)

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        """Make a mapping of the word before it is checked."""
        return core_schema.no_info_before_validator_function(_as_entry, handler(source))

    def __get_pydantic_json_schema__(self, core: Any, handler: Any) -> dict[str, Any]:
        """A word, or a mapping."""
        return {"anyOf": [{"type": "string", "enum": list(self.words)}, handler(core)]}


def _as_entry(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: {} if keys is None else keys for name, keys in value.items()}
    return {value: {}} if isinstance(value, str) else value


def quantity_of(entry: Any, names: Sequence[str]) -> Any:
    """The type of a quantity: `entry`, or the name of a quantity that needs no parameters."""
    return Annotated[entry, WordOrEntry([name for name in names if _needs_nothing(name)])]


def _needs_nothing(name: str) -> bool:
    required = component.REQUIRED
    return all(each.default is not required or each.optional for each in component.declaration("quantities", name).parameters)


def panel_model(quantity: Any, quantities: Any) -> type[BaseModel]:
    """The model of one panel; `quantity` is the type of one quantity, `quantities` the type of one or more."""
    return create_model(
        "Panel",
        __config__=STRICT,
        __doc__="A panel: quantities `y` against `x`, or a `histogram` of a quantity that every particle has.",
        title=_key(Text(), "", "text above the panel"),
        x=(quantity | None, Describe(None, description="the quantity along x; absent: time")),
        y=(quantities | None, Describe(None, description="the quantity, or a list of quantities, along y")),
        histogram=(quantity | None, Describe(None, description="in place of y: the quantity whose distribution is drawn")),
        bins=_key(Whole(minimum=2, maximum=200), 30, "number of bins of the histogram"),
        after=_key(Number(minimum=0.0), None, "time from which a histogram adds up all samples; absent: one for each"),
        theory=_key(
            _Theory(),
            None,
            "formulas over t and x drawn below the curves; of a histogram: maxwell_boltzmann, or the density as a formula",
        ),
        logarithmic=_key(Flag(), False, "whether y is drawn on a logarithmic axis"),
    )


class _Theory(Field):
    """A formula, a list of formulas, or the name of a distribution; `build` checks which of them the panel needs."""

    formula = PerParticle(THEORY_NAMES)
    formulas = ListOf(formula, tuple(range(1, CURVES_ALLOWED + 1)), "formulas")

    def check(self, value: Any, context: Context) -> Any:
        """Read the formulas, unless it is the name of a distribution."""
        if isinstance(value, list):
            return self.formulas.check(value, context)
        return value if value in DISTRIBUTIONS else (self.formula.check(value, context),)

    def schema(self) -> dict[str, Any]:
        """The schema of a formula, or of a list of formulas."""
        return {"anyOf": [*self.formula.schema()["anyOf"], self.formulas.schema()]}


def _key(check: Field, default: Any, description: str) -> Any:
    return (Annotated[Any, check], Describe(default, description=description))


def named(scene: Any) -> set[str]:
    """The quantities that `inspect:` of a scene, as plain data, names; and time, the default along x."""
    found = {"time"}
    panels = scene.get("inspect")
    for panel in panels if isinstance(panels, list) else ():
        for key in ("x", "y", "histogram"):
            entries = panel.get(key) if isinstance(panel, dict) else None
            found |= words_of(entries if isinstance(entries, list) else [entries])
    return found


def words_of(entries: Iterable[Any]) -> set[Any]:
    """The names of quantities in entries that are words or mappings, as plain data."""
    found: set[Any] = set()
    for entry in entries:
        found |= {entry} if isinstance(entry, str) else set(entry) if isinstance(entry, dict) else set()
    return found


def build(validated: Sequence[Any], node: Node | None, faults: Faults) -> tuple[PanelSpec, ...]:
    """Panels from the checked `inspect:`; `node` gives their places."""
    if len(validated) > PANELS_ALLOWED and node is not None:
        faults.add(node.place, "inspect", f"{len(validated)} panels are too many, allowed: {PANELS_ALLOWED}")
    places = node.value if node is not None else ()
    return tuple(_panel(panel, place, number, faults) for number, (panel, place) in enumerate(zip(validated, places)))


def _panel(panel: Any, node: Node, number: int, faults: Faults) -> PanelSpec:
    time = ComponentSpec("time", {}, node.place)
    x = quantity_entry(panel.x, node.value["x"]) if panel.x is not None else time
    y_node = node.get("y")
    places = (y_node.value if isinstance(y_node.value, list) else [y_node]) if y_node is not None else []
    y = tuple(quantity_entry(each, place) for each, place in zip(panel.y or (), places))
    histogram = quantity_entry(panel.histogram, node.value["histogram"]) if panel.histogram is not None else None
    made = PanelSpec(panel.title, x, y, histogram, panel.bins, panel.after, panel.theory, panel.logarithmic, node.place)
    for key, message in _conflicts(made, panel.model_fields_set):
        place = node.get(key)
        path = f"inspect[{number}]" + (f".{key}" if key else "")
        faults.add(node.place if place is None else place.place, path, message)
    return made


def quantity_entry(entry: Any, node: Node) -> ComponentSpec:
    """A checked quantity as the specification holds it; `node` gives its place."""
    (name,) = entry.model_fields_set
    body = getattr(entry, name)
    child = node.get(name)
    parameters = {key: getattr(body, key) for key in type(body).model_fields}
    return ComponentSpec(name, parameters, node.location if child is None else child.place)


def _conflicts(panel: PanelSpec, given: set[str]) -> Iterator[tuple[str, str]]:
    """Pairs of keys that contradict each other, and the reason."""
    if panel.histogram is None:
        if not panel.y:
            yield "", "a panel needs y: the quantities to plot, or histogram: one whose distribution is drawn"
        if len(panel.y) > CURVES_ALLOWED:
            yield "y", f"{len(panel.y)} curves are too many to tell apart, allowed: {CURVES_ALLOWED}"
        for key in ("bins", "after"):
            if key in given:
                yield key, "belongs to a histogram, and this panel has none"
        if isinstance(panel.theory, str):
            yield "theory", f"{shown(panel.theory)} is the theory of a histogram; beside curves it is a formula over t and x"
        return
    for key in ("x", "y"):
        if key in given:
            yield key, "cannot be in a panel with a histogram: it has its own axes"
    name = panel.histogram.name
    if component.declaration("quantities", name).base != DISTRIBUTABLE:
        known = [
            each for each in component.names("quantities") if component.declaration("quantities", each).base == DISTRIBUTABLE
        ]
        yield "histogram", f"{name} is one number, and has no distribution{choices(name, known)}"
    if isinstance(panel.theory, tuple):
        if len(panel.theory) > 1:
            yield "theory", f"of a histogram it must be {' or '.join(DISTRIBUTIONS)}, or one formula, not {len(panel.theory)}"
    elif panel.theory is not None and name not in DISTRIBUTED:
        yield "theory", f"{panel.theory} is the distribution of {' or '.join(DISTRIBUTED)}, not of {name}"
