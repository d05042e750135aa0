"""Tipsy, binary: gas, dark matter and stars in floats of 32 bits, big-endian ("standard") or little-endian ("native").

Source: header and particles as N. Katz and T. Quinn's tipsy has them; nemo's tipsy(5), pkdgrav3's "File Formats".
"""

import logging
import math
import struct
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from mpp_taichi.errors import SceneError
from mpp_taichi.importers._title import title_of
from mpp_taichi.snapshot import Snapshot

SUFFIXES = (".tipsy", ".tip", ".std")
BINARY = True
HEADER = "d5I"  # time, nbodies, ndim, nsph, ndark, nstar; most writers pad it to 32 bytes
HEADER_SIZE, PADDED_SIZE, DIMENSIONS_AT = 28, 32, 12
MOST_BODIES = 1_000_000  # of a scene
COMMON = ("mass", "x", "y", "z", "vx", "vy", "vz")
KINDS = {
    "gas": (*COMMON, "rho", "temp", "eps", "metals", "phi"),
    "dark": (*COMMON, "eps", "phi"),
    "star": (*COMMON, "metals", "tform", "eps", "phi"),
}
COLORS = {"gas": (0.4, 0.6, 1.0), "dark": (0.6, 0.6, 0.6), "star": (1.0, 0.9, 0.5)}
TAKEN = (*COMMON, "eps")
NOT_NEGATIVE = ("mass", "eps")
G = 1.0
STEPS_PER_TIME, TIMES = 100, 10  # of the dynamical time: a first guess

log = logging.getLogger(__name__)


def recognises(data: bytes) -> bool:
    """Whether a header in either byte order has three dimensions."""
    return len(data) >= HEADER_SIZE and _byte_order(data) != ""


def read(data: bytes, source: str) -> dict[str, Any]:
    """The scene: a body of its kind's colour for each particle, gravity with G = 1 softened by eps, leapfrog.

    Steps are 1/100 of the dynamical time sqrt(R³ / G M), R the root-mean-square distance from the centre of mass. A scene has
    one softening and begins at the time 0: a warning is given for different eps, of which the largest is taken, and for
    another time. SceneError with the byte where the data is no tipsy file.
    """
    found = _read(data, source)
    state = found.state
    if state.particle_count > MOST_BODIES:
        raise SceneError(
            f"{source}: byte 8: a scene may list {MOST_BODIES:,} bodies, not {state.particle_count:,}; convert it to .npz"
        )
    _warn_of_loss(source, found.left_out | ({"time"} if state.time else set()))
    least, softening = float(found.softening.min()), float(found.softening.max())
    if least < softening:
        log.warning("%s: eps goes from %g to %g; the scene's one softening is %g", source, least, softening, softening)
    dt = _dynamical_time(state) / STEPS_PER_TIME
    columns = zip(state.mass.tolist(), state.position.tolist(), state.velocity.tolist(), state.color.tolist(), strict=True)
    bodies = [{"mass": mass, "position": x, "velocity": v, "color": color} for mass, x, v, color in columns]
    return {
        "title": title_of(source),
        "particles": [{"body": body} for body in bodies],
        "forces": [{"newtonian_gravity": {"strength": G, "softening": softening}}],
        "integrator": {"leapfrog": {"dt": dt}},
        "run": {"steps": TIMES * STEPS_PER_TIME},
    }


def particles(data: bytes, source: str) -> Snapshot:
    """Only the particles, at their time; eps is left out too. SceneError as for `read`."""
    found = _read(data, source)
    _warn_of_loss(source, found.left_out | ({"eps"} if found.softening.any() else set()))
    return found.state


@dataclass(frozen=True, eq=False)
class _Found:
    """The state, the softening of each particle [length], and the names of other data that is not 0."""

    state: Snapshot
    softening: np.ndarray
    left_out: set[str]


def _read(data: bytes, source: str) -> _Found:
    time, counts, order, start = _header(data, source)
    taken, colors, left_out = [], [], set()
    for (kind, fields), count in zip(KINDS.items(), counts, strict=True):
        table = np.frombuffer(data, order + "f4", count * len(fields), start).reshape(count, len(fields))
        columns = table[:, [fields.index(key) for key in TAKEN]].astype(float)
        bad = ~np.isfinite(columns)
        bad |= (columns < 0.0) & np.isin(TAKEN, NOT_NEGATIVE)
        if bad.any():
            row, column = np.argwhere(bad)[0].tolist()
            offset = start + 4 * (row * len(fields) + fields.index(TAKEN[column]))
            below = TAKEN[column] in NOT_NEGATIVE and columns[row, column] < 0.0
            wanted = "a number from 0 on" if below else "a finite number"
            raise _fault(
                source, offset, f"{TAKEN[column]} of {kind} particle {row} must be {wanted}, not {columns[row, column]:g}"
            )
        taken.append(columns)
        colors.append(np.tile(COLORS[kind], (count, 1)))
        left_out |= {key for index, key in enumerate(fields) if key not in TAKEN and table[:, index].any()}
        start += table.nbytes
    whole, count = np.concatenate(taken), sum(counts)
    state = Snapshot(
        mass=whole[:, 0],
        position=whole[:, 1:4],
        velocity=whole[:, 4:7],
        radius=np.zeros(count),
        charge=np.zeros(count),
        color=np.concatenate(colors),
        free=np.ones((count, 3), bool),
        name=("",) * count,
        time=time,
    )
    return _Found(state, whole[:, 7], left_out)


def _header(data: bytes, source: str) -> tuple[float, list[int], str, int]:
    """Time, counts of gas, dark matter and stars, byte order, and where the particles begin; nothing is allocated for them."""
    if len(data) < HEADER_SIZE:
        raise _fault(source, len(data), f"the file ends within its header of {HEADER_SIZE} bytes")
    order = _byte_order(data)
    if not order:
        raise _fault(source, DIMENSIONS_AT, f"ndim must be 3, in either byte order, not {data[12:16].hex(' ')}")
    time, total, _, *counts = struct.unpack_from(order + HEADER, data)
    if not math.isfinite(time):
        raise _fault(source, 0, f"time must be a finite number, not {time:g}")
    if total != sum(counts) or not total:
        gas, dark, star = counts
        raise _fault(source, 8, f"nbodies must be nsph + ndark + nstar and at least 1: {total} is not {gas} + {dark} + {star}")
    size = sum(4 * len(fields) * count for fields, count in zip(KINDS.values(), counts, strict=True))
    padded = len(data) != HEADER_SIZE + size or not any(data[HEADER_SIZE:PADDED_SIZE])  # a padded one, cut 4 bytes short
    start = PADDED_SIZE if padded else HEADER_SIZE
    if len(data) < start + size:
        raise _fault(source, len(data), f"the file ends within {_particle_at(len(data) - start, counts)}")
    if len(data) > start + size:
        raise _fault(source, start + size, f"{len(data) - start - size:,} bytes follow the last of {total:,} particles")
    return time, counts, order, start


def _particle_at(offset: int, counts: Iterable[int]) -> str:
    """The particle that has this byte."""
    for (kind, fields), count in zip(KINDS.items(), counts, strict=True):
        index, size = max(offset, 0) // (4 * len(fields)), 4 * len(fields) * count
        if offset < size:
            return f"{kind} particle {index:,} of {count:,}"
        offset -= size
    raise AssertionError("the byte is beyond all particles")


def _byte_order(data: bytes) -> str:
    """`>` or `<`, the order in which ndim is 3; empty where it is 3 in neither."""
    return next((order for order in "><" if struct.unpack_from(order + "I", data, DIMENSIONS_AT)[0] == 3), "")


def _dynamical_time(state: Snapshot) -> float:
    """T = sqrt(R³ / G M); 1 where the mass or the extent is 0."""
    mass = state.mass.sum()
    if not mass > 0.0:
        return 1.0
    away = state.position - state.mass @ state.position / mass
    spread = state.mass @ (away**2).sum(axis=1) / mass
    return math.sqrt(spread**1.5 / (G * mass)) if spread > 0.0 else 1.0


def _warn_of_loss(source: str, lost: set[str]) -> None:
    if lost:
        log.warning("%s: left out: %s", source, ", ".join(sorted(lost)))


def _fault(source: str, offset: int, message: str) -> SceneError:
    return SceneError(f"{source}: byte {offset:,}: {message}")
