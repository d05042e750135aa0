"""Snapshot: the one form in which particles cross between host and device, file and memory, Taichi and OpenCL."""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from mpp_taichi.atomic_file import whole_file
from mpp_taichi.errors import OutputError, StateError

FORMAT_VERSION = 1
MERGED_ARRAYS = ("mass", "radius", "charge", "free", "merged_into")
"""The properties of a particle that merging changes, beside its place and velocity."""
MASS_ROUNDING = 1e-5  # of the whole mass, as sums in f32 over many mergers leave it
ROD_ROUNDING = 1e-6
"""Relative difference of two lengths that are the same length, rounded to single precision."""
PARTICLE_ARRAYS = ("position", "velocity", "mass", "radius", "charge", "color", "free")
_COLUMNS = {"position": (3,), "velocity": (3,), "color": (3,), "free": (3,), "between": (2,)}
SPRING_ARRAYS = ("between", "stiffness", "damping", "rest_length", "color")
SPRING_LIMITS = {"breaking_length": math.inf, "yield_stretch": math.inf, "broke_at": math.inf}
"""The arrays that only springs with limits have, and the value of a spring without a limit."""
ROD_ARRAYS = ("between", "length", "color")
_COMOVING_ARRAYS = ("origin", "drift", "elapsed", "position", "velocity")


@dataclass(frozen=True, eq=False)
class Springs:
    """Springs as arrays, one entry per spring.

    between      indices (i, j) of the two ends, shape (spring_count, 2)
    stiffness    D [force / length];  damping c [force / velocity];  rest_length [length], each (spring_count,)
    color        red, green, blue in 0…1, shape (spring_count, 3)

    Only where some spring breaks or yields, else None, each (spring_count,):
    breaking_length   length at which a spring breaks, infinite where it does not [length]
    yield_stretch     stretch |l − L| beyond which the rest length L follows, infinite where it does not [length]
    broke_at          time at which a spring broke, infinite while it is whole [time]
    """

    between: np.ndarray = field(default_factory=lambda: np.zeros((0, 2), np.int32))
    stiffness: np.ndarray = field(default_factory=lambda: np.zeros(0))
    damping: np.ndarray = field(default_factory=lambda: np.zeros(0))
    rest_length: np.ndarray = field(default_factory=lambda: np.zeros(0))
    color: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    breaking_length: np.ndarray | None = None
    yield_stretch: np.ndarray | None = None
    broke_at: np.ndarray | None = None

    def __len__(self) -> int:
        """Count the springs."""
        return len(self.between)

    @property
    def have_limits(self) -> bool:
        """Whether some springs may break or yield."""
        return self.broke_at is not None

    @property
    def breaking_times(self) -> np.ndarray:
        """Times at which the broken springs broke, in their order [time]."""
        return np.zeros(0) if self.broke_at is None else self.broke_at[np.isfinite(self.broke_at)]

    @property
    def whole(self) -> np.ndarray:
        """False for a broken spring, shape (spring_count,)."""
        return np.ones(len(self), bool) if self.broke_at is None else np.isinf(self.broke_at)

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        """The arrays that there are, by name."""
        return {each.name: getattr(self, each.name) for each in fields(self) if getattr(self, each.name) is not None}

    def chosen(self, keep: Any) -> "Springs":
        """The springs for which `keep` is true."""
        return Springs(**{name: values[keep] for name, values in self.arrays.items()})

    @staticmethod
    def joined(parts: Sequence["Springs"]) -> "Springs":
        """The springs of several parts, one part after the other."""
        limits = SPRING_LIMITS if any(part.have_limits for part in parts) else {}
        own = [{**{name: np.full(len(part), value) for name, value in limits.items()}, **part.arrays} for part in parts]
        return Springs(**{name: np.concatenate([each[name] for each in own]) for name in (*SPRING_ARRAYS, *limits)})


@dataclass(frozen=True, eq=False)
class Rods:
    """Rigid rods as arrays, one entry per rod.

    between   indices (i, j) of the two ends, shape (rod_count, 2)
    length    the constant distance of the two ends [length], (rod_count,)
    color     red, green, blue in 0…1, shape (rod_count, 3)
    """

    between: np.ndarray = field(default_factory=lambda: np.zeros((0, 2), np.int32))
    length: np.ndarray = field(default_factory=lambda: np.zeros(0))
    color: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))

    def __len__(self) -> int:
        """Count the rods."""
        return len(self.between)


@dataclass(frozen=True, eq=False)
class Comoving:
    """The particles in the uniformly moving frame in which they are stepped, with the digits that lie below a distant origin.

    origin, drift        place [length] and velocity [length / time] of the frame when it was chosen, shape (3,)
    elapsed              the time since then, as two numbers whose sum it is, shape (2,) [time]
    position, velocity   relative to the frame now, shape (particle_count, 3)
    """

    origin: np.ndarray
    drift: np.ndarray
    elapsed: np.ndarray
    position: np.ndarray
    velocity: np.ndarray


@dataclass(frozen=True, eq=False)
class Snapshot:
    """All particles at one time, as float64 host arrays whatever the precision of the run.

    position, velocity   [length], [length / time], shape (particle_count, 3)
    mass, radius, charge shape (particle_count,)
    color                red, green, blue in 0…1, shape (particle_count, 3)
    free                 False where an axis of a particle is held fixed, shape (particle_count, 3)
    name                 one string per particle, empty when it has none
    merged_into          where spheres merge: the particle of which each has become a part, −1 for a separate particle,
                         (particle_count,). A merged particle has neither mass, radius nor charge, and is held
    driven               indices of the bodies that move on a given path, and are held, for no force moves them
    changing             indices of the bodies whose mass or charge is a given function of the time
    comoving             the same places and velocities in the frame in which a method steps them, where it has such a frame
    """

    position: np.ndarray
    velocity: np.ndarray
    mass: np.ndarray
    radius: np.ndarray
    charge: np.ndarray
    color: np.ndarray
    free: np.ndarray
    name: tuple[str, ...]
    springs: Springs = field(default_factory=Springs)
    rods: Rods = field(default_factory=Rods)
    time: float = 0.0
    step: int = 0
    dt: float | None = None  # of the run that led here, where it is known [time]
    merged_into: np.ndarray | None = None
    comoving: Comoving | None = None
    driven: tuple[int, ...] = ()
    changing: tuple[int, ...] = ()

    @property
    def moving(self) -> np.ndarray:
        """False along the axes on which a particle has no velocity: held axes of bodies on no path, (particle_count, 3)."""
        if not self.driven:
            return self.free
        found = self.free.copy()
        found[list(self.driven)] = True
        return found

    @property
    def particle_count(self) -> int:
        """Number of particles."""
        return len(self.mass)

    @property
    def present(self) -> np.ndarray:
        """False for a particle that has merged into another particle, shape (particle_count,)."""
        return np.ones(self.particle_count, dtype=bool) if self.merged_into is None else self.merged_into < 0

    @property
    def numbers_change(self) -> bool:
        """Whether masses and charges may differ from time to time: where spheres merge, or are given functions of the time."""
        return self.merged_into is not None or bool(self.changing)

    def moved(self, *, position: np.ndarray, velocity: np.ndarray, time: float, step: int) -> "Snapshot":
        """The same particles elsewhere, at another time."""
        return replace(self, position=position, velocity=velocity, time=time, step=step, comoving=None)

    def continuing(self, start: "Snapshot") -> "Snapshot":
        """The particles of `start` where they are here, at this time and step, merged as they are here.

        Raises:
            StateError: these are other particles, or other springs or rods link them.
        """
        if self.particle_count != start.particle_count:
            raise StateError(f"the state has {self.particle_count:,} particles, the scene {start.particle_count:,}")
        if not np.array_equal(self.springs.between, start.springs.between):
            raise StateError(f"the {len(self.springs):,} springs of the state are not the {len(start.springs):,} of the scene")
        same_rods = np.array_equal(self.rods.between, start.rods.between)
        if not (same_rods and np.allclose(self.rods.length, start.rods.length, rtol=ROD_ROUNDING, atol=0.0)):
            raise StateError(f"the {len(self.rods):,} rods of the state are not the {len(start.rods):,} of the scene")
        if np.any(self.mass < 0.0) or np.any(self.radius < 0.0):
            raise StateError("the state holds a mass or a radius below 0")
        merges = start.merged_into is not None and self.merged_into is not None
        lasting = np.setdiff1d(np.arange(self.particle_count), start.changing)
        same = (
            abs(self.mass.sum() - start.mass.sum()) <= MASS_ROUNDING * np.abs(start.mass).sum()
            if merges
            else np.array_equal(self.mass[lasting], start.mass[lasting])
        )
        if not same:
            raise StateError("the masses of the state differ from the masses of the scene")
        if not (np.isfinite(self.position).all() and np.isfinite(self.velocity).all()):
            raise StateError("the state holds numbers that are not finite")
        made = start.moved(position=self.position, velocity=self.velocity * start.moving, time=self.time, step=self.step)
        made = replace(made, comoving=self.comoving)
        if start.springs.have_limits and self.springs.have_limits:
            springs = replace(start.springs, rest_length=self.springs.rest_length, broke_at=self.springs.broke_at)
            made = replace(made, springs=springs)
        return replace(made, **{key: getattr(self, key) for key in MERGED_ARRAYS}) if merges else made

    def save(self, path: str | Path) -> None:
        """Write `.npz` (no pickles) by way of a temporary file, so that a crash leaves the old file whole."""
        path = Path(path)
        arrays = {key: getattr(self, key) for key in PARTICLE_ARRAYS}
        arrays |= {f"spring_{key}": values for key, values in self.springs.arrays.items()}
        if len(self.rods):
            arrays |= {f"rod_{key}": getattr(self.rods, key) for key in ROD_ARRAYS}
        if self.merged_into is not None:
            arrays["merged_into"] = self.merged_into
        if self.comoving is not None:
            arrays |= {f"comoving_{key}": getattr(self.comoving, key) for key in _COMOVING_ARRAYS}
        meta = {"format": FORMAT_VERSION, "time": self.time, "step": self.step, "dt": self.dt}
        with whole_file(path, "the snapshot", durable=True) as temporary, open(temporary, "wb") as stream:
            np.savez(stream, meta=json.dumps(meta), name=np.array(self.name, dtype=np.str_), **arrays)

    @staticmethod
    def load(path: str | Path) -> "Snapshot":
        """Read a file that `save` wrote.

        Raises:
            OutputError: it is no such file, or has another version, or its arrays do not fit together.
        """
        try:
            with np.load(path, allow_pickle=False) as data:
                meta = json.loads(str(data["meta"]))
                limits = [key for key in SPRING_LIMITS if f"spring_{key}" in data]
                springs = Springs(**{key: data[f"spring_{key}"] for key in (*SPRING_ARRAYS, *limits)})
                arrays = {key: data[key] for key in PARTICLE_ARRAYS}
                names = tuple(str(entry) for entry in data["name"])
                if "rod_between" in data:
                    arrays["rods"] = Rods(**{key: data[f"rod_{key}"] for key in ROD_ARRAYS})
                arrays["merged_into"] = data["merged_into"] if "merged_into" in data else None
                if "comoving_origin" in data:
                    arrays["comoving"] = Comoving(**{key: data[f"comoving_{key}"] for key in _COMOVING_ARRAYS})
            made = Snapshot(**arrays, name=names, springs=springs, time=meta["time"], step=meta["step"], dt=meta.get("dt"))
            made._check(meta["format"])
        except Exception as error:  # NumPy lets errors of its parts through, such as those of tokenize
            raise OutputError(f"{path}: not a snapshot of this program: {error}") from error
        return made

    def _check(self, version: object) -> None:
        """ValueError where arrays, read from a file, do not match the fields of this class, or the version is another."""
        if version != FORMAT_VERSION:
            raise ValueError(f"its format is version {version}, this program reads version {FORMAT_VERSION}")
        count, links, bars = np.size(self.mass), np.size(self.springs.stiffness), np.size(self.rods.length)
        of_springs = (*SPRING_ARRAYS, *(SPRING_LIMITS if self.springs.have_limits else ()))
        owners = ((self, PARTICLE_ARRAYS, count), (self.springs, of_springs, links), (self.rods, ROD_ARRAYS, bars))
        for owner, keys, rows in owners:
            for key in keys:
                array, shape = getattr(owner, key), (rows, *_COLUMNS.get(key, ()))
                if array.shape != shape or array.dtype.kind not in "fiub":
                    raise ValueError(f"{key} is {array.dtype} of shape {array.shape}, must be numbers of shape {shape}")
        for key in ("mass", "radius"):
            if np.any(getattr(self, key) < 0):
                raise ValueError(f"{key} of particle {int(np.argmax(getattr(self, key) < 0))} is below 0")
        negative = (self.springs.stiffness < 0) & (self.springs.rest_length != 0)  # without a rest length it is of a hinge
        if negative.any():
            raise ValueError(f"stiffness of spring {int(np.argmax(negative))} is below 0")
        into = self.merged_into
        if into is not None and not (into.shape == (count,) and into.dtype.kind == "i" and (into < count).all()):
            raise ValueError("merged_into does not name particles")
        shapes = {"origin": (3,), "drift": (3,), "elapsed": (2,), "position": (count, 3), "velocity": (count, 3)}
        for key in _COMOVING_ARRAYS if self.comoving is not None else ():
            array = getattr(self.comoving, key)
            if array.shape != shapes[key] or array.dtype.kind not in "fiu":
                raise ValueError(f"comoving_{key} is {array.dtype} {array.shape}, must be numbers of shape {shapes[key]}")
        if len(self.name) != count:
            raise ValueError(f"it has {len(self.name)} names for {count} particles")
        sound = math.isfinite(self.time) and self.step >= 0 and (self.dt is None or 0.0 < self.dt < math.inf)
        if not sound:
            raise ValueError(f"time {self.time}, step {self.step} and dt {self.dt} cannot be")


def springs_differ(snapshots: Sequence[Snapshot]) -> bool:
    """Whether the springs of some snapshots have other numbers than those of the first."""
    first = snapshots[0].springs if snapshots else Springs()
    return any(not _same(first, each.springs) for each in snapshots[1:])


def _same(one: Springs, other: Springs) -> bool:
    return one is other or all(
        np.array_equal(getattr(one, key), getattr(other, key)) for key in ("stiffness", "damping", "rest_length")
    )
