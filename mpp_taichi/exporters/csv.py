"""A table with one row for each particle, with all digits; the generator `file` reads the table back."""

import csv
import io
from collections.abc import Sequence

from mpp_taichi.exporters._source import Source
from mpp_taichi.generators._table_cells import as_word

SUFFIXES = (".csv",)
SCALARS = ("mass", "radius", "charge")


def text(source: Source) -> str:
    """`name,mass,radius,charge,position_x,…,velocity_x,…,free_x,…,color_r,…`.

    A name that a program of tables would take for a formula begins with an apostrophe, as OWASP advises; `file` takes it away.
    """
    state = source.state
    columns: dict[str, Sequence[str]] = {"name": [as_word(name) for name in state.name]}
    columns |= {key: [repr(float(x)) for x in getattr(state, key)] for key in SCALARS}
    for key, letters in (("position", "xyz"), ("velocity", "xyz"), ("free", "xyz"), ("color", "rgb")):
        for axis, letter in enumerate(letters):
            values = getattr(state, key)[:, axis]
            columns[f"{key}_{letter}"] = [str(int(x)) if key == "free" else repr(float(x)) for x in values]
    stream = io.StringIO(newline="")
    csv.writer(stream, lineterminator="\n").writerows([columns, *zip(*columns.values(), strict=True)])
    return stream.getvalue()
