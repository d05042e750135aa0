"""State: the device fields of a simulation, allocated only for what some effect of the scene needs."""

import copy
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.low_parts import split
from mpp_taichi.device import bulk_copy
from mpp_taichi.precision import carries_low_parts, forces_see_low_parts
from mpp_taichi.snapshot import MERGED_ARRAYS, Snapshot

# Quantities one entry of which belongs to each particle, and the snapshot array they come from.
PARTICLE_QUANTITIES = ("mass", "charge", "radius")
# Quantities of the half-springs, gathered per particle (compressed sparse rows).
SPRING_QUANTITIES = ("spring_start", "spring_neighbor", "spring_stiffness", "spring_rest_length", "spring_damping")

# The trees of work fields that do not hold numbers of the run's precision.
TREES = {"index": "integers", "wide": "wide", "wide_pair": "wide", "lattice": "wide"}


def half_springs(snapshot: Snapshot) -> dict[str, np.ndarray]:
    """Both ends of every spring, sorted by the particle they pull at: compressed sparse rows.

    Row i is spring_start[i] … spring_start[i+1]; within a row the order is that of the scene, so sums are repeatable.
    """
    springs = snapshot.springs
    ends = np.concatenate([springs.between[:, 0], springs.between[:, 1]])
    others = np.concatenate([springs.between[:, 1], springs.between[:, 0]])
    number = np.tile(np.arange(len(springs)), 2)
    order = np.lexsort((number, ends))
    counts = np.bincount(ends, minlength=snapshot.particle_count)
    return {
        "spring_start": np.concatenate([[0], np.cumsum(counts)]).astype(np.int32),
        "spring_neighbor": others[order].astype(np.int32),
        "spring_stiffness": springs.stiffness[number[order]],
        "spring_rest_length": springs.rest_length[number[order]],
        "spring_damping": springs.damping[number[order]],
    }


@ti.data_oriented
class State:
    """Fields for `replica_count` copies of `particle_count` particles, one copy after the other.

    position, velocity, acceleration   vectors of `dimensions` components in the run's precision
    free                               1 or 0 per axis, only where an axis of some particle is fixed
    mass, charge, radius, spring_…     only where named in `needs`, or where spheres merge
    merged_into                        where spheres merge, as in `Snapshot`; there `free` is always kept, too
    position_low, velocity_low         what rounding took from both, where the precision carries it (f32c, ds; see low_parts)
    scratch_0, scratch_1, …            vectors that an integrator asks for
    and whatever else it names in `work`: name → (kind, count for each replica)

    Vectors are stored component by component when a pair sum streams over all of them, else together.
    """

    def __init__(
        self,
        snapshot: Snapshot,
        *,
        dimensions: int,
        needs: Iterable[str],
        scratch_count: int,
        streaming: bool,
        replica_count: int = 1,
        wide: Any = ti.f64,
        work: Mapping[str, tuple[str, int]] = MappingProxyType({}),
        memory: tuple[str, ...] = (),
        precision: str = "f64",
        guards_rounding: bool = False,
    ):
        """Allocate for the needs, and fill with the snapshot in every replica.

        `precision` says whether there are low parts, `guards_rounding` whether they must be kept from the compiler's eyes.
        """
        self.dimensions = dimensions
        self.memory = memory  # names of what a step hands on to the next, beside position and velocity
        self.wide = wide  # of energies: f64 where the device has it
        self.particle_count = snapshot.particle_count
        self.replica_count = replica_count
        self.total_count = snapshot.particle_count * replica_count
        self.merges = snapshot.merged_into is not None
        self.has_fixed_axes = self.merges or not bool(snapshot.free[:, :dimensions].all())
        self.carries_low = self.velocity_has_low = carries_low_parts(precision)
        self.forces_see_low = forces_see_low_parts(precision)
        self.guards_rounding = guards_rounding and self.carries_low
        needs = frozenset(needs) | frozenset(PARTICLE_QUANTITIES if self.merges else ())
        if self.merges:
            self.memory = (*memory, *MERGED_ARRAYS)
        if self.carries_low:
            self.memory = (*self.memory, "position_low", "velocity_low")
        unknown = needs - set(PARTICLE_QUANTITIES) - set(SPRING_QUANTITIES)
        if unknown:
            raise TypeError(f"an effect needs {sorted(unknown)}, which State does not know")
        self.quantities: list[str] = ["position", "velocity", "acceleration"]
        if self.carries_low:
            self.quantities += ["position_low", "velocity_low"]
        self._builders: dict[str, ti.FieldsBuilder] = {}
        layout = ti.Layout.SOA if streaming else ti.Layout.AOS
        for name in self.quantities:
            setattr(self, name, self._vector(layout))
        for k in range(scratch_count):
            setattr(self, f"scratch_{k}", self._vector(layout))
            self.quantities.append(f"scratch_{k}")
        self.scratch = tuple(getattr(self, f"scratch_{k}") for k in range(scratch_count))
        if self.has_fixed_axes:
            self.free = self._vector(layout)
            self.quantities.append("free")
        for name in PARTICLE_QUANTITIES:
            if name in needs:
                self._scalar(name, float, self.total_count)
        if self.merges:
            self._scalar("merged_into", ti.i32, self.total_count)
        if self.guards_rounding:
            self.nothing = ti.field(ti.i32)  # 0, which only the running kernel finds out
            self._builder("integers").place(self.nothing)
        host = half_springs(snapshot) if needs & set(SPRING_QUANTITIES) else {}
        for name in SPRING_QUANTITIES:
            if name in needs:
                self._scalar(name, ti.i32 if host[name].dtype == np.int32 else float, max(len(host[name]), 1))
        for name in work:
            self._work(name, *work[name], layout)
        self._trees = [builder.finalize() for builder in self._builders.values()]
        self._fill(snapshot, needs, host)
        self.moving_as_scratch = tuple(self._moving_as(field) for field in self.scratch)

    def _moving_as(self, velocity: Any) -> "State":
        """The same fields, but another for the velocities: what forces are to see on the way through a step."""
        result = copy.copy(self)
        result.velocity = velocity
        result.velocity_has_low = False
        return result

    def _builder(self, tree: str) -> ti.FieldsBuilder:
        """Of one tree for each width of numbers.

        In a tree with 4-byte numbers 8-byte ones may come to lie across their alignment, and on Vulkan share bytes with others.
        """
        if tree not in self._builders:
            self._builders[tree] = ti.FieldsBuilder()
        return self._builders[tree]

    def _vector(self, layout: Any) -> Any:
        result = ti.Vector.field(self.dimensions, float)
        if layout == ti.Layout.SOA:
            for k in range(self.dimensions):
                self._builder("numbers").dense(ti.i, self.total_count).place(result.get_scalar_field(k))
        else:
            self._builder("numbers").dense(ti.i, self.total_count).place(result)
        return result

    def _scalar(self, name: str, dtype: Any, count: int) -> None:
        result = ti.field(dtype)
        self._builder("integers" if dtype == ti.i32 else "numbers").dense(ti.i, count).place(result)
        setattr(self, name, result)
        self.quantities.append(name)

    def _work(self, name: str, kind: str, count: int, layout: Any) -> None:
        """A field of an integrator, `count` for each replica: a vector, matrix, scalar, index or integers, a sum or two."""
        count *= self.replica_count
        if kind == "vector" and count == self.total_count:
            setattr(self, name, self._vector(layout))
        else:
            made = {
                "vector": lambda: ti.Vector.field(self.dimensions, float),
                "vector4": lambda: ti.Vector.field(4, float),
                "vector8": lambda: ti.Vector.field(8, float),
                "matrix": lambda: ti.Matrix.field(self.dimensions, self.dimensions, float),
                "scalar": lambda: ti.field(float),
                "index": lambda: ti.field(ti.i32),
                "lattice": lambda: ti.Vector.field(self.dimensions, ti.i64),
                "pair": lambda: ti.Vector.field(2, float),
                "wide": lambda: ti.field(self.wide),
                "wide_pair": lambda: ti.Vector.field(2, self.wide),
            }[kind]()
            self._builder(TREES.get(kind, "numbers")).dense(ti.i, max(count, 1)).place(made)
            setattr(self, name, made)
        self.quantities.append(name)

    def _fill(self, snapshot: Snapshot, needs: frozenset, host: dict[str, np.ndarray]) -> None:
        arrays = {}
        for name in PARTICLE_QUANTITIES:
            if name in needs:
                arrays[name] = np.tile(getattr(snapshot, name), self.replica_count).astype(self._dtype)
        for name, values in host.items():
            if name in needs and len(values):
                arrays[name] = values if values.dtype == np.int32 else values.astype(self._dtype)
        if self.has_fixed_axes:
            free = snapshot.free[:, : self.dimensions].astype(self._dtype)
            arrays["free"] = np.tile(free, (self.replica_count, 1))
        if self.merges:
            arrays |= self._spheres(snapshot)
        self._write(arrays)
        self.write(snapshot.position, snapshot.velocity * snapshot.free)

    @property
    def _dtype(self) -> type:
        return np.float32 if self.position.dtype == ti.f32 else np.float64

    def rounded(self, number: float) -> float:
        """A number as the device keeps it."""
        return float(self._dtype(number))

    def as_kept(self, values: np.ndarray) -> np.ndarray:
        """Numbers as the device keeps them, in float64."""
        return np.asarray(values).astype(self._dtype).astype(np.float64)

    def write(self, position: np.ndarray, velocity: np.ndarray) -> None:
        """Set positions and velocities: (particle_count, 3) for every replica, or (total_count, 3)."""
        arrays = {}
        for name, values in (("position", position), ("velocity", velocity)):
            values = np.asarray(values)[:, : self.dimensions]
            if len(values) != self.total_count:
                values = np.tile(values, (self.replica_count, 1))
            if self.carries_low:
                values, arrays[f"{name}_low"] = split(np.asarray(values, np.float64))
            arrays[name] = values.astype(self._dtype)
        self._write(arrays)

    def _write(self, arrays: Mapping[str, np.ndarray]) -> None:
        bulk_copy.write([getattr(self, name) for name in arrays], list(arrays.values()))

    def _read(self, *names: str) -> list[np.ndarray]:
        """Vectors of all replicas as the device keeps them."""
        return bulk_copy.read([getattr(self, name) for name in names], self._dtype)

    def take_over(self, earlier: "State", free: np.ndarray) -> None:
        """Positions and velocities of all replicas as another state has them, bit for bit; an axis that is not free stops."""
        free = np.tile(free[:, : self.dimensions], (self.replica_count, 1))
        names = ("position", "velocity", *(("position_low", "velocity_low") if self.carries_low else ()))
        arrays = dict(zip(names, earlier._read(*names)))
        for name in names[1::2]:
            arrays[name] = (arrays[name] * free).astype(self._dtype)
        self._write(arrays)

    def write_springs(self, snapshot: Snapshot) -> None:
        """Set stiffness, rest length and damping of springs that link the same particles as before."""
        host = half_springs(snapshot)
        names = [name for name in ("spring_stiffness", "spring_rest_length", "spring_damping") if name in self.quantities]
        bulk_copy.write([getattr(self, name) for name in names], [host[name].astype(self._dtype) for name in names])

    def write_spheres(self, snapshot: Snapshot) -> None:
        """Set what merging changes of each sphere, the same in every replica."""
        self._write(self._spheres(snapshot))

    def _spheres(self, snapshot: Snapshot) -> dict[str, np.ndarray]:
        found = {}
        for name in MERGED_ARRAYS:
            values = np.asarray(getattr(snapshot, name))
            kind = np.int32 if name == "merged_into" else self._dtype
            columns = values[:, : self.dimensions] if values.ndim == 2 else values
            found[name] = np.concatenate([columns] * self.replica_count).astype(kind)
        return found

    def read_spheres(self, particles: Snapshot) -> dict[str, Any]:
        """What merging changes of each sphere, as a Snapshot has it; `particles` are those of the scene."""
        found = {name: getattr(self, name).to_numpy().astype(np.float64) for name in ("mass", "radius", "charge")}
        into = self.merged_into.to_numpy()
        free = particles.free.copy()
        free[:, : self.dimensions] = self.free.to_numpy() != 0.0
        free[:, self.dimensions :] &= free[:, : self.dimensions].any(axis=1)[:, None]
        return found | {"free": free, "merged_into": into}

    def read(self, replica: int = 0) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities of one replica as float64, (particle_count, 3)."""
        rows = slice(replica * self.particle_count, (replica + 1) * self.particle_count)
        results = np.zeros((2, self.particle_count, 3))
        parts = self._read("position", "velocity", *(("position_low", "velocity_low") if self.carries_low else ()))
        for result, values in zip(results, parts[:2]):
            result[:, : self.dimensions] = values[rows]
        for result, low in zip(results, parts[2:]):
            result[:, : self.dimensions] += low[rows]
        return results[0], results[1]

    def save(self) -> tuple[np.ndarray, ...]:
        """Positions and velocities of all replicas, and what the integrator remembers, bit for bit."""
        return (*self._read("position", "velocity"), *(getattr(self, name).to_numpy() for name in self.memory))

    def restore(self, saved: tuple[np.ndarray, ...]) -> None:
        """Put back what `save` gave."""
        position, velocity, *others = saved
        self._write({"position": position, "velocity": velocity})
        for name, values in zip(self.memory, others, strict=True):
            getattr(self, name).from_numpy(values)

    def field_sizes(self) -> dict[str, int]:
        """Bytes of every field."""
        sizes = {}
        for name in self.quantities:
            field = getattr(self, name)
            width = field.n * field.m if isinstance(field, ti.MatrixField) else 1
            bytes_each = 4 if field.dtype in (ti.f32, ti.i32) else 8
            sizes[name] = field.shape[0] * width * bytes_each
        return sizes

    def destroy(self) -> None:
        """Give the memory back."""
        for tree in self._trees:
            tree.destroy()
