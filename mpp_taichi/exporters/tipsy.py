"""Tipsy, standard binary: big-endian, floats of 32 bits, every particle as a particle of dark matter.

Source: header and particles as N. Katz and T. Quinn's tipsy has them; nemo's tipsy(5), pkdgrav3's "File Formats".
"""

import struct
from pathlib import Path

import numpy as np

from mpp_taichi.exporters._source import Source

SUFFIXES = (".tipsy", ".std")
HEADER = struct.Struct(">d6I")  # time, nbodies, ndim, nsph, ndark, nstar, pad
DARK = ("mass", "x", "y", "z", "vx", "vy", "vz", "eps", "phi")


def write(source: Source, path: Path) -> None:
    """Masses are multiplied by the scene's constant of gravitation, because programs that read the format have G = 1.

    eps is the scene's softening, phi 0: potentials are not computed. A sphere that has merged into another sphere is left out.
    SceneError for a number that a float of 32 bits cannot hold, or gravity that repels.
    """
    state = source.state
    gravity = (
        {} if source.spec is None else next((f.parameters for f in source.spec.forces if f.name == "newtonian_gravity"), {})
    )
    strength, softening = gravity.get("strength", 1.0), gravity.get("softening", 0.0)
    if strength < 0.0:
        raise source.refuse(f"tipsy has gravity that attracts, and its strength is {strength:g}")
    columns = np.zeros((state.particle_count, len(DARK)))
    columns[:, 0] = state.mass * (strength or 1.0)
    columns[:, 1:4], columns[:, 4:7], columns[:, 7] = state.position, state.velocity, softening
    columns = columns[state.present]
    with np.errstate(over="ignore", under="ignore"):
        rounded = columns.astype(">f4")
    lost = np.argwhere(~np.isfinite(rounded) | ((rounded == 0.0) != (columns == 0.0)))
    if len(lost):
        row, column = lost[0]
        number = np.flatnonzero(state.present)[row]
        raise source.refuse(f"{DARK[column]} of particle {number}, {columns[row, column]:g}, is beyond the floats of tipsy")
    count = len(columns)
    path.write_bytes(HEADER.pack(state.time, count, 3, 0, count, 0, 0) + rounded.tobytes())
