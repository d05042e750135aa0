"""Sweep model: the block `sweep:` of a scene: the keys that vary, the quantities that are measured, when a member ends."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, create_model
from pydantic import Field as Describe

from mpp_taichi import component
from mpp_taichi.scene import expectations
from mpp_taichi.scene.document import Node
from mpp_taichi.scene.faults import Faults, shown
from mpp_taichi.scene.fields import Context, Field, Flag, Number, Text, Whole, Wrong, calculate
from mpp_taichi.scene.inspection import WordOrEntry
from mpp_taichi.scene.parameters import STRICT
from mpp_taichi.scene.spec import Expectation
from mpp_taichi.scene.sweep_spec import AxisSpec, SampleSpec, SweepSpec

MOST_VALUES = 10_000_000  # of one key
MOST_MEMBERS = 10_000_000
OF_EVERY_MEMBER = {
    "end_time": "time at which the member ended: at the end of the run, at a condition of stop:, or where it broke down",
    "time": "the same as end_time",
    "steps": "steps done",
    "relative_energy_error_max": expectations.SUMMARY_QUANTITIES["relative_energy_error_max"],
}
"""Quantities without a component that a sweep measures."""
SCALES = ("linear", "logarithmic")
_COUNT = Whole(minimum=1, maximum=MOST_VALUES)
_RANGE: Mapping[str, Field] = {
    "from": Number(),
    "to": Number(),
    "count": _COUNT,
    "scale": Text(SCALES),
    "endpoint": Flag(),
}


class _Values(Field):
    """The values of a key: a list, or {from, to, count}."""

    def check(self, value: Any, context: Context) -> dict[str, Any]:
        """A list as it is, with its expressions calculated; a range with its defaults."""
        if isinstance(value, list):
            if not value:
                raise Wrong("is an empty list; it needs at least one value")
            return {"values": tuple(_value(each, context, number) for number, each in enumerate(value))}
        if not isinstance(value, dict):
            raise Wrong(f"must be a list of values or {{from: …, to: …, count: …}}, not {shown(value)}")
        for key in value:
            if key not in _RANGE:
                raise Wrong(f"unknown key {shown(key)}, allowed: {', '.join(_RANGE)}", path=(key,))
        for key in ("from", "to"):
            if key not in value:
                raise Wrong(f"missing key {shown(key)}")
        found: dict[str, Any] = {}
        for key, given in value.items():
            try:
                found[key] = _RANGE[key].check(given, context)
            except Wrong as wrong:
                inner = Wrong("")
                inner.parts = [((key, *path), offset, message) for path, offset, message in wrong.parts]
                raise inner from None
        if found.get("scale") == "logarithmic" and not (found["from"] > 0.0 and found["to"] > 0.0):
            raise Wrong("a logarithmic range has no values at or below 0")
        return {"low": found.pop("from"), "high": found.pop("to"), **found}

    def schema(self) -> dict[str, Any]:
        """An array, or an object."""
        properties = {key: each.schema() for key, each in _RANGE.items()}
        ranged = {"type": "object", "properties": properties, "required": ["from", "to"], "additionalProperties": False}
        return {"anyOf": [{"type": "array", "minItems": 1}, ranged]}


def _value(value: Any, context: Context, number: int) -> Any:
    """A number where the text is an expression of one, else the value itself: a word, say the name of a method."""
    if isinstance(value, (list, dict)) or value is None:
        raise Wrong(f"must be a number or a word, not {shown(value)}", path=(number,))
    if not isinstance(value, str):
        return value
    try:
        return calculate(value, context)
    except Wrong:
        return value


class _Sample(Field):
    """`sobol: 4096`, or {sobol: 4096, seed: 1}."""

    def check(self, value: Any, context: Context) -> SampleSpec:
        """One of the kinds, with a count."""
        kinds = [key for key in ("random", "sobol") if isinstance(value, dict) and key in value]
        if len(kinds) != 1 or not set(value) <= {kinds[0], "seed"}:
            raise Wrong(f"must be {{random: count}} or {{sobol: count}}, with seed: if wanted, not {shown(value)}")
        count = _COUNT.check(value[kinds[0]], context)
        return SampleSpec(kinds[0], count, Whole(minimum=0, maximum=2**53).check(value.get("seed", 0), context))

    def schema(self) -> dict[str, Any]:
        """An object of one kind and a seed."""
        keys = {"random": _COUNT.schema(), "sobol": _COUNT.schema(), "seed": Whole(minimum=0).schema()}
        return {"type": "object", "properties": keys, "additionalProperties": False}


def sweep_model(
    diagnostics: Iterable[str], quantities: Iterable[str], bounds: Any, body_of: Callable[[str], Any]
) -> type[BaseModel]:
    """The model of `sweep:` for these diagnostics and quantities.

    `bounds` is the model of the bounds in `expect:`, `body_of` gives the model of a quantity there, of which both are made.
    """
    members: dict[str, Any] = {}
    for name, summary in OF_EVERY_MEMBER.items():
        members[name] = (bounds | None, Describe(None, description=summary))
    for name in dict.fromkeys([*diagnostics, *quantities]):
        kind = expectations.kind_of(name)
        if kind is None or name in OF_EVERY_MEMBER:
            continue
        summary = component.declaration(kind, name).summary.split("\n\n")[0]
        members[name] = (body_of(name) | None, Describe(None, description=summary))
    config = ConfigDict(**STRICT, json_schema_extra={"minProperties": 1, "maxProperties": 1})
    entry = create_model("Measure", __config__=config, __doc__="A quantity of a member.", **members)
    named: Any = Annotated[entry, WordOrEntry(list(members))]
    return create_model(
        "Sweep",
        __config__=STRICT,
        __doc__="Copies of the scene in which some keys have other values, for the verb sweep.",
        vary=(
            dict[str, Annotated[Any, _Values()]],
            Describe(description="path of a key, as --set takes it: a list of values or {from, to, count}", min_length=1),
        ),
        combine=_key(
            Text(("crossed", "zipped")), "crossed", "every value of a key with every value of the others, or in pairs"
        ),
        sample=_key(
            _Sample(), None, "draw values between from and to in place of a grid: {random: n} or {sobol: n}, with seed"
        ),
        refine=_key(
            Number(minimum=0.0, maximum=1.0),
            None,
            "run a coarse grid, and refine it where neighbours differ in their status, or by more than this share of the range",
        ),
        measure=(list[named], Describe([], description="results of a member; absent: the quantities of expect:")),
        stop=(list[named], Describe([], description="a member ends when one of these quantities leaves its bounds")),
    )


def _key(check: Field, default: Any, description: str) -> Any:
    return (Annotated[Any, check], Describe(default, description=description))


def named(scene: Mapping[str, Any]) -> set[Any]:
    """The quantities that `sweep:` of a scene, as plain data, names."""
    block = scene.get("sweep")
    found: set[Any] = set()
    for key in ("measure", "stop"):
        entries = block.get(key) if isinstance(block, dict) else None
        for entry in entries if isinstance(entries, list) else ():
            found |= {entry} if isinstance(entry, str) else set(entry) if isinstance(entry, dict) else set()
    return found


def build(validated: Any, node: Node | None, expected: tuple[Expectation, ...], faults: Faults) -> SweepSpec | None:
    """The specification of `sweep:` from its checked model; without `measure:` a sweep measures what the scene expects."""
    if validated is None or node is None:
        return None
    place = node.value["vary"]
    axes = tuple(AxisSpec(path, **each) for path, each in validated.vary.items())
    measure = tuple(_measures(validated.measure, node.get("measure"), "measure", faults))
    stop = tuple(_measures(validated.stop, node.get("stop"), "stop", faults))
    for each in stop:
        if each.below is None and each.above is None and each.near is None:
            key = f"sweep.stop.{each.quantity}"
            faults.add(each.location, key, "needs the bounds, below, above or near, that it must not leave")
    spec = SweepSpec(
        axes, validated.combine, validated.sample, measure or _measurable(expected), stop, validated.refine, node.place
    )
    if spec.refine is not None and (spec.sample is not None or spec.combine == "zipped"):
        faults.add(node.value["refine"].place, "sweep.refine", "refines a grid, in which every value meets every value")
    for axis in axes:
        for message in _axis_faults(axis, spec):
            faults.add(place.value[axis.path].place, f"sweep.vary.{axis.path}", message)
    if not faults.found and not spec.measure:
        faults.add(node.place, "sweep", "needs measure:, since the scene expects nothing that a sweep can measure")
    return spec


def _measurable(expected: tuple[Expectation, ...]) -> tuple[Expectation, ...]:
    """The quantities of `expect:` that a sweep measures, without their bounds, which hold for the scene as it is written."""
    return tuple(
        Expectation(each.quantity, each.parameters, None, None, None, None, each.location)
        for each in expected
        if expectations.kind_of(each.quantity) is not None or each.quantity in OF_EVERY_MEMBER
    )


def _measures(validated: Any, node: Node | None, key: str, faults: Faults) -> Iterator[Expectation]:
    for number, entry in enumerate(validated):
        assert node is not None
        (name,) = entry.model_fields_set
        place = node.value[number]
        inner = place.get(name) or place
        body = getattr(entry, name)
        values = {each: getattr(body, each) for each in type(body).model_fields}
        bounds = {each: values.pop(each) for each in expectations.BOUNDS}
        for wrong, message in expectations.conflicts(name, values):
            faults.add(inner.place, f"sweep.{key}[{number}].{name}.{wrong}", message)
        yield Expectation(name, values, location=place.place, **bounds)


def _axis_faults(axis: AxisSpec, spec: SweepSpec) -> Iterator[str]:
    if spec.sample is not None:
        if axis.values is not None:
            yield "needs from: and to:, since sample: draws its values between them"
        elif axis.count is not None:
            yield "has no count: of its own, since sample: says how many members there are"
        return
    if axis.values is None and axis.count is None:
        yield "needs count:, the number of values"
    if spec.combine == "zipped" and length(axis) != length(spec.axes[0]):
        yield f"has {length(axis):,} values and {spec.axes[0].path} has {length(spec.axes[0]):,}; zipped lists are equally long"


def length(axis: AxisSpec) -> int:
    """The number of values of a key."""
    return len(axis.values) if axis.values is not None else axis.count or 1
