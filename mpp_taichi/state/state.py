"""State: the fields of a simulation on the device; only the fields that the scene needs are allocated."""

import copy
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.low_parts import split
from mpp_taichi.device import bulk_copy
from mpp_taichi.precision import carries_low_parts, forces_have_low_parts, forces_see_low_parts
from mpp_taichi.snapshot import MERGED_ARRAYS, Comoving, Snapshot
from mpp_taichi.state.field_group import FieldGroup, Row, SideBySide, field_of_kind
from mpp_taichi.state.half_springs import half_springs, values_of_replicas
from mpp_taichi.state.moving_frame import MovingFrame, frame_of_center, frame_of_snapshots
from mpp_taichi.state.two_part_field import TwoPartField
from mpp_taichi.state.vector_layout import VectorLayout

# Quantities with an entry for each particle; the snapshot has an array of the same name.
PARTICLE_QUANTITIES = ("mass", "charge", "radius")
# Quantities of the half-springs, gathered per particle (compressed sparse rows).
SPRING_QUANTITIES = ("spring_start", "spring_neighbor", "spring_stiffness", "spring_rest_length", "spring_damping")


@ti.data_oriented
class State:
    """Fields for `replica_count` copies of `particle_count` particles, one copy after the other.

    position, velocity, acceleration   vectors of `dimensions` components in the run's precision
    free                               1 or 0 per axis, only where an axis of some particle is fixed, or where spheres merge
    mass, charge, radius, spring_…     only where named in `needs`, or where spheres merge
    merged_into                        only where spheres merge, as in `Snapshot`
    position_low, velocity_low         the low parts of both, only where the precision carries them (low_parts.py)
    position_rest, velocity_rest       the third parts of both, only in df64
    scratch_0, scratch_1, …            vectors that an integrator asks for
    the fields named in `work`         of an integrator: name → (kind, count for each replica)

    In df64 the accelerations, the scratch vectors of `slopes` and all quantities that forces read are fields of two parts
    (two_part_field.py).

    The `layout` says how the vectors of the particles lie in memory (vector_layout.py). Where the state is `centered`,
    positions and velocities on the device are relative to the `frame`; `write`, `write_snapshots` and `read` convert between
    this frame and the frame of the scene.
    """

    def __init__(
        self,
        snapshot: Snapshot,
        *,
        dimensions: int,
        needs: Iterable[str],
        scratch_count: int,
        layout: VectorLayout,
        slopes: range = range(0),
        replica_count: int = 1,
        wide: Any = ti.f64,
        work: Mapping[str, tuple[str, int]] = MappingProxyType({}),
        memory: tuple[str, ...] = (),
        precision: str = "f64",
        guards_rounding: bool = False,
        centered: bool = False,
        own_springs: bool = False,
    ):
        """Allocate for the needs, and fill every replica with the snapshot.

        `slopes` are the scratch vectors that hold accelerations. `precision` says which low parts there are; `guards_rounding`
        says whether their sums must be hidden from a compiler that reorders sums (low_parts.py); `centered` says whether the
        particles are stepped in a frame that moves with their centre of mass (moving_frame.py).
        """
        self.dimensions, self.particle_count, self.replica_count = dimensions, snapshot.particle_count, replica_count
        self.half_spring_count, self.wide = 2 * len(snapshot.springs), wide  # number type of energies: f64 where it is there
        self.total_count = snapshot.particle_count * replica_count
        self.merges = snapshot.merged_into is not None
        self.has_fixed_axes = self.merges or not bool(snapshot.free[:, :dimensions].all())
        self.carries_low = self.velocity_has_low = carries_low_parts(precision)
        self.forces_see_low, self.forces_have_low = forces_see_low_parts(precision), forces_have_low_parts(precision)
        self.number_kind: type | None = None  # of the numbers that the fields give in a kernel: those of Taichi
        self.guards_rounding, self.carries_rest = guards_rounding and self.carries_low, self.forces_have_low
        low = ("position_low", "velocity_low") if self.carries_low else ()
        low += ("position_rest", "velocity_rest") if self.carries_rest else ()
        self._moved = ("position", "velocity", *low)
        # Names of the fields that a step hands on to the next step, beside position and velocity.
        self.memory = (*memory, *(MERGED_ARRAYS if self.merges else ()), *low)
        needs = frozenset(needs) | frozenset(PARTICLE_QUANTITIES if self.merges else ())
        if unknown := needs - set(PARTICLE_QUANTITIES) - set(SPRING_QUANTITIES):
            raise TypeError(f"an effect needs {sorted(unknown)}, which State does not know")
        host = half_springs(snapshot) if needs & set(SPRING_QUANTITIES) else {}
        host |= values_of_replicas([snapshot] * replica_count) if own_springs else {}
        self.centered, self._mass, self.own_springs = centered, snapshot.mass, own_springs
        self.frame: MovingFrame | None = None
        self.quantities: list[str] = []
        self._rows: list[Row] = []  # the rows to be allocated
        self._saved: bulk_copy.MixedFields | None = None  # the fields of `save`
        self._layout, self._vectors = layout, list[Any]()
        self._declare_vectors(low, scratch_count, slopes)
        self._declare_quantities(needs, host)
        for name in work:
            self._declare_work(name, *work[name])
        if self._vectors:
            parts = [each.get_scalar_field(k) for each in self._vectors for k in range(dimensions)]
            self._rows.append((self.total_count, SideBySide(parts)))
        self._fields = FieldGroup(*self._rows)
        self._fill(snapshot, needs, host)
        self.moving_as_scratch = tuple(self._moving_as(field) for field in self.scratch)

    def _declare_vectors(self, low: tuple[str, ...], scratch_count: int, slopes: range) -> None:
        scratch = tuple(f"scratch_{k}" for k in range(scratch_count))
        free = ("free",) if self.has_fixed_axes else ()
        for name in ("position", "velocity", "acceleration", *low, *scratch, *free):
            self._declare(name, self._vector())
        if self.forces_have_low:
            for name in ("acceleration", *(scratch[k] for k in slopes)):
                self._add_low_part(name, self._vector())
        self.scratch = tuple(getattr(self, name) for name in scratch)

    def _declare_quantities(self, needs: frozenset, host: dict[str, np.ndarray]) -> None:
        for name in PARTICLE_QUANTITIES:
            if name in needs:
                self._declare_scalar(name, float, self.total_count)
        if self.merges:
            self._declare_scalar("merged_into", ti.i32, self.total_count)
        if self.guards_rounding:
            self.nothing = ti.field(ti.i32)  # 0, which only the running kernel finds out
            self._rows.append((None, self.nothing))
        for name in SPRING_QUANTITIES:
            if name in needs:
                self._declare_scalar(name, ti.i32 if host[name].dtype == np.int32 else float, max(len(host[name]), 1))

    def _declare_work(self, name: str, kind: str, count: int) -> None:
        """A field of an integrator, `count` for each replica: a vector, matrix, scalar, index or integers, a sum or two."""
        count *= self.replica_count
        if kind == "vector" and count == self.total_count:
            self._declare(name, self._vector())
            return
        made = field_of_kind(kind, self.dimensions, self.wide)
        self._rows.append((max(count, 1), made))
        self._declare(name, made)

    def _declare_scalar(self, name: str, dtype: Any, count: int) -> None:
        made = ti.field(dtype)
        self._rows.append((count, made))
        self._declare(name, made)
        if self.forces_have_low and dtype is float:
            low = ti.field(dtype)
            self._rows.append((count, low))
            self._add_low_part(name, low)

    def _add_low_part(self, name: str, low: Any) -> None:
        """Make a field of two parts of a field that has been declared."""
        high = getattr(self, name)
        self._declare(f"{name}_low", low)
        setattr(self, name, TwoPartField(self, high, low))

    def _declare(self, name: str, field: Any) -> None:
        setattr(self, name, field)
        self.quantities.append(name)

    def _vector(self) -> Any:
        """A vector for each particle of all replicas, in the layout of the state."""
        result = ti.Vector.field(self.dimensions, float)
        if self._layout is VectorLayout.SIDE_BY_SIDE:
            self._vectors.append(result)
        elif self._layout is VectorLayout.BY_COMPONENT:
            self._rows.append((self.total_count, *(result.get_scalar_field(k) for k in range(self.dimensions))))
        else:
            self._rows.append((self.total_count, result))
        return result

    def _moving_as(self, velocity: Any) -> "State":
        """The same fields with another field as velocity: the state that forces see on the way through a step."""
        result = copy.copy(self)
        result.velocity = velocity
        result.velocity_has_low = False
        return result

    def _fill(self, snapshot: Snapshot, needs: frozenset, host: dict[str, np.ndarray]) -> None:
        arrays: dict[str, np.ndarray] = {}
        for name in PARTICLE_QUANTITIES:
            if name in needs:
                arrays |= self._parts(name, np.tile(getattr(snapshot, name), self.replica_count))
        for name, values in host.items():
            if name in needs and len(values):
                arrays |= {name: values} if values.dtype == np.int32 else self._parts(name, values)
        if self.has_fixed_axes:
            free = snapshot.free[:, : self.dimensions].astype(self._dtype)
            arrays["free"] = np.tile(free, (self.replica_count, 1))
        if self.merges:
            arrays |= self._spheres(snapshot)
        self._write(arrays)
        self.write(snapshot.position, snapshot.velocity * snapshot.moving)

    @property
    def _dtype(self) -> type:
        return np.float32 if self.position.dtype == ti.f32 else np.float64

    def rounded(self, number: float) -> float:
        """A number rounded to the precision of the device."""
        return float(self._dtype(number))

    def as_kept(self, values: np.ndarray) -> np.ndarray:
        """Quantities rounded as forces read them, as float64."""
        if self.forces_have_low:
            high, low = split(np.asarray(values, np.float64))
            return high.astype(np.float64) + low
        return np.asarray(values).astype(self._dtype).astype(np.float64)

    def _parts(self, name: str, values: np.ndarray) -> dict[str, np.ndarray]:
        """Numbers in the precision of a field, or its high and low parts."""
        if f"{name}_low" not in self.quantities:
            return {name: values.astype(self._dtype)}
        values = np.asarray(values, np.float64)
        high, low = split(values)
        found = {name: high, f"{name}_low": low}
        if f"{name}_rest" in self.quantities:
            found[f"{name}_rest"] = ((values - high) - low).astype(np.float32)
        return found

    def field(self, name: str) -> Any:
        """The Taichi field of a quantity, or of its high parts."""
        field = getattr(self, name)
        return field.high if isinstance(field, TwoPartField) else field

    def write(self, position: np.ndarray, velocity: np.ndarray, *, frame: MovingFrame | None = None) -> None:
        """Set positions and velocities: (particle_count, 3) for every replica, or (total_count, 3).

        They are in the frame of the scene, or in a moving `frame`.
        """
        position, velocity = (self._of_all_replicas(values) for values in (position, velocity))
        if self.centered:
            mass = self.as_kept(self._mass)
            self.frame, *moved = frame_of_center(*(self._by_replica(values) for values in (position, velocity)), mass, frame)
            position, velocity = (values.reshape(self.total_count, -1) for values in moved)
        self._write_vectors(position, velocity)

    def write_snapshots(self, starts: Sequence[Snapshot]) -> None:
        """Set the positions and velocities of each replica from a snapshot of its own, or of all replicas from one snapshot.

        A snapshot of a centered state brings its frame with it, so that the motion goes on bit for bit.
        """
        known: tuple | None = None
        if self.centered:
            known = frame_of_snapshots(tuple(starts) * (self.replica_count // len(starts)), self.dimensions)
        if known is None:
            position, velocity = (np.concatenate([getattr(each, name) for each in starts]) for name in ("position", "velocity"))
            self.write(position, velocity)
        else:
            self.frame, *moved = known
            self._write_vectors(*(values.reshape(self.total_count, -1) for values in moved))

    def write_properties(self, starts: Sequence[Snapshot]) -> None:
        """Set masses and charges, and the numbers of springs where they are its own, of each replica from its own snapshot."""
        columns = {name: np.concatenate([getattr(each, name) for each in starts]) for name in ("mass", "charge")}
        self._write_numbers(columns | (values_of_replicas(starts) if self.own_springs else {}))
        self._mass = np.stack([each.mass for each in starts])

    def _write_numbers(self, columns: Mapping[str, np.ndarray]) -> None:
        kept = [name for name in columns if name in self.quantities]
        self._write({part: values for name in kept for part, values in self._parts(name, columns[name]).items()})

    def pass_time(self, steps: int, dt: float) -> None:
        """Let the frame move on for so many steps of the length `dt`, with the particles."""
        if self.frame is not None:
            self.frame = self.frame.later(steps, dt)

    def _of_all_replicas(self, values: np.ndarray) -> np.ndarray:
        values = np.asarray(values)[:, : self.dimensions]
        return values if len(values) == self.total_count else np.tile(values, (self.replica_count, 1))

    def _by_replica(self, values: np.ndarray) -> np.ndarray:
        return np.asarray(values, np.float64).reshape(self.replica_count, self.particle_count, -1)

    def _write_vectors(self, position: np.ndarray, velocity: np.ndarray) -> None:
        arrays: dict[str, np.ndarray] = {}
        for name, values in (("position", position), ("velocity", velocity)):
            arrays |= self._parts(name, values)
        self._write(arrays)

    def _write(self, arrays: Mapping[str, np.ndarray]) -> None:
        bulk_copy.write([self.field(name) for name in arrays], list(arrays.values()))

    def _read(self, *names: str) -> list[np.ndarray]:
        """Vectors of all replicas, in the precision of the device."""
        return bulk_copy.read([getattr(self, name) for name in names], self._dtype)

    def take_over(self, earlier: "State", free: np.ndarray) -> None:
        """Copy the positions and velocities of another state bit for bit; the velocity along an axis that is not free is 0.

        Where only one of the two states is in a moving frame, positions and velocities are rounded once. Where the masses
        differ, the frame moves with the new centre of mass.
        """
        free = np.tile(free[:, : self.dimensions], (self.replica_count, 1))
        shares_center = self.centered and earlier.centered
        if (self.centered or earlier.centered) and not (shares_center and np.array_equal(self._mass, earlier._mass)):
            read = earlier._read_vectors if shares_center else earlier.read
            position, velocity = (np.concatenate(each) for each in zip(*map(read, range(self.replica_count))))
            self.write(position, velocity[:, : self.dimensions] * free, frame=earlier.frame if shares_center else None)
            return
        self.frame = earlier.frame
        arrays = dict(zip(self._moved, earlier._read(*self._moved)))
        for name in self._moved[1::2]:
            arrays[name] = (arrays[name] * free).astype(self._dtype)
        self._write(arrays)

    def write_springs(self, snapshot: Snapshot) -> None:
        """Set stiffness, rest length and damping of springs that link the same particles as before."""
        columns = values_of_replicas([snapshot])
        if "spring_yield_stretch" in self.quantities:
            del columns["spring_rest_length"]  # it changes in the run, and no slider moves it
        self._write_numbers(columns)

    def write_spheres(self, snapshot: Snapshot) -> None:
        """Set the arrays that merging changes, the same in every replica."""
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
        """The arrays that merging changes, as in a Snapshot; `particles` is the snapshot of the scene."""
        found = {name: getattr(self, name).to_numpy().astype(np.float64) for name in ("mass", "radius", "charge")}
        into = self.merged_into.to_numpy()
        free = particles.free.copy()
        free[:, : self.dimensions] = self.free.to_numpy() != 0.0
        free[:, self.dimensions :] &= free[:, : self.dimensions].any(axis=1)[:, None]
        return found | {"free": free, "merged_into": into}

    def read(self, replica: int = 0) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities of one replica as float64, (particle_count, 3)."""
        return self.read_with_frame(replica)[:2]

    def read_with_frame(self, replica: int = 0) -> tuple[np.ndarray, np.ndarray, Comoving | None]:
        """The result of `read`, and the particles in their frame; None where it is the frame of the scene."""
        position, velocity = self._read_vectors(replica)
        if self.frame is None or self.frame.rests_at_origin:
            return position, velocity, None
        return self.frame.seen_from_scene(replica, position, velocity)

    def _read_vectors(self, replica: int) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities of one replica as the device has them, (particle_count, 3)."""
        rows = slice(replica * self.particle_count, (replica + 1) * self.particle_count)
        results = np.zeros((2, self.particle_count, 3))
        results[:, :, : self.dimensions] = [values[rows] for values in self._read_sums()]
        return results[0], results[1]

    def _read_sums(self) -> list[np.ndarray]:
        """Positions and velocities as the device has them, the sums of their parts, (total_count, dimensions)."""
        parts = self._read(*self._moved)
        sums = [values.astype(np.float64, copy=False) for values in parts[:2]]
        for number, low in enumerate(parts[2:]):
            sums[number % 2] = sums[number % 2] + low
        return sums

    def read_replicas(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities of all replicas, (replica_count, particle_count, 3)."""
        shape = (self.replica_count, self.particle_count)
        results = np.zeros((2, *shape, 3))
        shifts = (0.0, 0.0) if self.frame is None else (self.frame.place[:, None], self.frame.drift[:, None])
        for result, values, shift in zip(results, self._read_sums(), shifts, strict=True):
            np.add(values.reshape(*shape, self.dimensions), shift, out=result[:, :, : self.dimensions])
        return results[0], results[1]

    def save(self) -> tuple[np.ndarray, ...]:
        """Positions and velocities of all replicas, the fields of `memory` and the numbers of the frame, bit for bit."""
        if self._saved is None:
            self._saved = bulk_copy.MixedFields(self._lasting_fields)
        frame = () if self.frame is None else self.frame.arrays
        return (*self._saved.read(), *frame)

    def restore(self, saved: tuple[np.ndarray, ...]) -> None:
        """Write back the result of `save`."""
        fields = self._lasting_fields
        bulk_copy.write(fields, saved[: len(fields)])
        frame = saved[len(fields) :]
        self.frame = MovingFrame(*frame) if frame else None

    @property
    def _lasting_fields(self) -> list[Any]:
        return [getattr(self, name) for name in ("position", "velocity", *self.memory)]

    def field_sizes(self) -> dict[str, int]:
        """Bytes of every field."""
        sizes = {}
        for name in self.quantities:
            field = self.field(name)
            width = field.n * field.m if isinstance(field, ti.MatrixField) else 1
            bytes_each = 4 if field.dtype in (ti.f32, ti.i32) else 8
            sizes[name] = field.shape[0] * width * bytes_each
        return sizes

    def destroy(self) -> None:
        """Free the memory."""
        self._fields.destroy()
