"""Asked quantities: all quantities that the expectations, tables, panels and sweeps of a scene measure."""

from collections.abc import Iterator
from dataclasses import replace

from mpp_taichi import component
from mpp_taichi.scene.expectations import kind_of
from mpp_taichi.scene.spec import SceneSpec


def asked_quantities(spec: SceneSpec) -> set[str]:
    """Their names; diagnostics and the numbers of the summary are none of them."""
    return {name for name in _names(spec) if kind_of(name) == "quantities"}


def tangent_quantities(spec: SceneSpec) -> list[str]:
    """The names of the quantities among them that need the tangent of the step, in alphabetical order."""
    return [name for name in sorted(asked_quantities(spec)) if component.flag("quantities", name, "needs_tangent")]


def derivative_quantities(spec: SceneSpec) -> list[str]:
    """The names of those among them that need the derivative along all directions."""
    return [name for name in tangent_quantities(spec) if component.flag("quantities", name, "needs_derivative")]


def without_tangent(spec: SceneSpec) -> SceneSpec:
    """The scene without the quantities that need the tangent of the step; itself where it asks for none."""
    gone = set(tangent_quantities(spec))
    if not gone:
        return spec
    table, sweep, panels = spec.record.table, spec.sweep, []
    if table is not None:
        columns = tuple(each for each in table.columns if each.name not in gone)
        table = replace(table, columns=columns) if columns else None
    for panel in spec.inspect:
        curves = tuple(each for each in panel.y if each.name not in gone)
        if panel.x.name not in gone and (curves or panel.histogram is not None):
            panels.append(replace(panel, y=curves))
    if sweep is not None:
        kept = {key: tuple(each for each in getattr(sweep, key) if each.quantity not in gone) for key in ("measure", "stop")}
        sweep = replace(sweep, **kept)
    expect = tuple(each for each in spec.expect if each.quantity not in gone)
    return replace(spec, expect=expect, record=replace(spec.record, table=table), inspect=tuple(panels), sweep=sweep)


def _names(spec: SceneSpec) -> Iterator[str]:
    yield from (each.quantity for each in spec.expect)
    if spec.record.table is not None:
        yield from (each.name for each in spec.record.table.columns)
    for panel in spec.inspect:
        yield from (each.name for each in (panel.x, *panel.y, panel.histogram) if each is not None)
    if spec.sweep is not None:
        yield from (each.quantity for each in (*spec.sweep.measure, *spec.sweep.stop))
