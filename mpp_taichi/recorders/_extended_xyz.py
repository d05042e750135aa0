"""Extended XYZ, a format that ASE and OVITO read: particle count, a comment that names the columns, a line for each particle.

Source: the layout as ASE documents it, ase.io.extxyz.
"""

import json
from collections.abc import Iterator

import numpy as np

from mpp_taichi.snapshot import Snapshot
from mpp_taichi.walls._base import Enclosure

SPECIES = "X"
"""Readers take the first column for a chemical element; in ASE, X is an unknown element."""
COLUMNS = "species:S:1:pos:R:3:velo:R:3:mass:R:1:radius:R:1:charge:R:1"
UNNAMED = "-"


def frame_lines(snapshot: Snapshot, enclosure: Enclosure) -> Iterator[str]:
    """The lines of one frame, all digits of every number; particles that have merged into others are left out.

    A box that repeats is `Lattice`, edges along x, y, z with 0 where it does not repeat, and its lower corner `Origin`.
    Names, if there are any, are the last column: blanks as underscores, `-` for a particle without a name.
    """
    present, named = snapshot.present, any(snapshot.name)
    yield str(int(present.sum()))
    box = ""
    if any(enclosure.repeats):
        x, y, z = map(_text, enclosure.period)
        box = f'Lattice="{x} 0.0 0.0 0.0 {y} 0.0 0.0 0.0 {z}" Origin="{" ".join(map(_text, enclosure.origin))}" '
    periodic = " ".join("T" if repeats else "F" for repeats in enclosure.repeats)
    columns = COLUMNS + (":name:S:1" if named else "")
    yield f'{box}Properties={columns} Time={_text(snapshot.time)} Step={snapshot.step} pbc="{periodic}"'
    numbers = np.column_stack([snapshot.position, snapshot.velocity, snapshot.mass, snapshot.radius, snapshot.charge])
    for index in np.flatnonzero(present).tolist():
        name = f" {_word(snapshot.name[index])}" if named else ""
        yield f"{SPECIES} {' '.join(map(repr, numbers[index].tolist()))}{name}"


def _text(value: float) -> str:
    return repr(float(value))


def _word(name: str) -> str:
    """One word without control characters."""
    return json.dumps("_".join(name.split()), ensure_ascii=False)[1:-1] or UNNAMED
