"""Table columns: the model of `record: {table: {columns: […]}}`, quantities that the table of a run has in place of its own."""

from collections.abc import Mapping
from dataclasses import make_dataclass, replace
from typing import Annotated, Any

from pydantic import BaseModel, create_model
from pydantic import Field as Describe

from mpp_taichi.scene.document import Node
from mpp_taichi.scene.fields import Flag
from mpp_taichi.scene.inspection import quantity_entry, words_of
from mpp_taichi.scene.parameters import STRICT
from mpp_taichi.scene.spec import RecordSpec, TableSpec


def record_model(quantities: Any) -> type[RecordSpec]:
    """The model of `record:` with its table; `quantities` is the type of a list of them."""
    columns = Describe(min_length=1, description="quantities, each written as in inspect:; a column for each, in this order")
    units = Describe(default=False, description="whether the header of a CSV file names the unit of each column: `time [day]`")
    table: type[BaseModel] = create_model(
        "TableColumns",
        __config__=STRICT,
        __doc__="The columns of the table that `--diagnostics F` writes.",
        columns=(quantities, columns),
        units=(Annotated[Any, Flag()], units),
    )
    described = Describe(description="the columns of the table that --diagnostics writes; absent: energies, momenta and errors")
    found = make_dataclass(
        RecordSpec.__name__,
        [("table", Annotated[table | None, described], None)],
        bases=(RecordSpec,),
        frozen=True,
        namespace={"__doc__": RecordSpec.__doc__},
    )
    return found


def named(scene: Mapping[str, Any]) -> set[Any]:
    """The quantities that the table of a scene, as plain data, names."""
    record = scene.get("record")
    table = record.get("table") if isinstance(record, dict) else None
    columns = table.get("columns") if isinstance(table, dict) else None
    return words_of(columns) if isinstance(columns, list) else set()


def build(validated: Any, node: Node | None) -> RecordSpec:
    """The specification of `record:` from its checked model; `node` gives the places of the columns."""
    values = {name: getattr(validated, name) for name in RecordSpec.__dataclass_fields__}
    table = values.pop("table")
    plain = RecordSpec(**values)
    if table is None or node is None:
        return plain
    place = node.value["table"]
    columns = tuple(map(quantity_entry, table.columns, place.value["columns"].value))
    return replace(plain, table=TableSpec(columns, place.place, table.units))
