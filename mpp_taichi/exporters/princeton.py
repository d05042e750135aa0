"""Universe files of Princeton's N-body assignment, as its program prints the last state: five digits."""

import numpy as np

from mpp_taichi.exporters._source import Source
from mpp_taichi.importers.princeton import RADIUS

SUFFIXES = (".txt",)


def text(source: Source) -> str:
    """N, R and N rows `x y vx vy mass picture`; a picture is the body's name and `.gif`.

    R is the constant `universe_radius` of a scene, which the importer writes, else the distance of the farthest body.
    SceneError where a body leaves the plane, or a name has white space in it.
    """
    state = source.state
    if np.any(state.position[:, 2]) or np.any(state.velocity[:, 2]):
        raise source.refuse("a universe file is of the plane z = 0, and a particle is not in it")
    names = [name or f"body_{k}" for k, name in enumerate(state.name)]
    if spaced := [name for name in names if name.split() != [name]]:
        raise source.refuse(f"a universe file has no name with white space in it, like {spaced[0]!r}")
    constants = {} if source.spec is None else source.spec.constants
    radius = constants.get(RADIUS, np.abs(state.position).max() or 1.0)
    lines = [str(state.particle_count), f"{radius:.2e}"]
    for x, v, m, name in zip(state.position, state.velocity, state.mass, names, strict=True):
        numbers = "".join(f"{value:12.4e}" for value in (x[0], x[1], v[0], v[1], m))
        lines.append(f"{numbers} {name + '.gif':>16}")
    return "\n".join(lines) + "\n"
