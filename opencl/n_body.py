"""The direct sum over all pairs in OpenCL: gravity and charges, by the kernel that is fastest here."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .devices import Device, Refused
from .program import Memory, build
from .tuning import fastest

VARIANTS = ("naive", "tiled", "vectors", "third_law")
FAR = 1e15  # where bodies without a source lie that fill the last tile: their squared distances are numbers of f32
PADDING = 16  # the widest vectors
SAMPLE = {"cpu": 8192, "gpu": 131_072, "accelerator": 8192}  # bodies on which variants are tried
ROWS_PER_UNIT = 4  # of the third law, for each compute unit, so that a busy core holds up little
GPU_TILES = tuple(("tiled", tile, bodies) for tile in (128, 256) for bodies in (1, 2, 4))


@dataclass(frozen=True)
class PairForce:
    """a_i = response_i Σ_j source_j d / (|d|² + softening²)^(3/2); response and source are (particle_count,)."""

    source: np.ndarray
    response: np.ndarray
    softening: float


@dataclass(frozen=True)
class Variant:
    """A kernel, and how it is built and launched."""

    name: str
    group: int  # work-items of a group
    bodies: int = 1  # that a work-item of a tile takes
    seeded: bool = False  # 1/ρ from a root in f32, in f64 only

    def __str__(self) -> str:
        """In words."""
        more = f", {self.bodies} bodies an item" if self.name == "tiled" else ""
        return f"{self.name}, groups of {self.group}{more}{', seeded in f32' if self.seeded else ''}"


class PairSum:
    """The sum of several pair forces.

    columns   buffer of x, y, z, `stride` bodies each: where the bodies are
    sum       buffer of their accelerations, in the same order
    """

    def __init__(self, memory: Memory, device: Device, forces: Sequence[PairForce], *, variant: str | None = None):
        """Allocate; find the fastest variant, or take the one of this name, and compile it."""
        if variant is not None and variant not in VARIANTS:
            raise Refused(f"no variant {variant!r} of the direct sum, there are {', '.join(VARIANTS)}")
        self._memory, self._device, self._forces = memory, device, tuple(forces)
        self.count = len(forces[0].source)
        largest_tile = max((tile * bodies for _, tile, bodies in GPU_TILES), default=1) if self._wants_tiles(variant) else PADDING
        self.stride = -(-self.count // largest_tile) * largest_tile
        self.columns = memory.reals(np.full(3 * self.stride, FAR))
        self.sum = memory.room(3 * self.stride)
        self._strengths = [tuple(memory.reals(self._filled(each)) for each in (one.source, one.response)) for one in forces]
        self.lanes = self._lane_count()
        self._rows: Any = None
        self._row_count = 1
        self._kernels: dict[tuple[Variant, bool], tuple[Any, ...]] = {}
        self._names = variant
        self.variant = self._variants()[0]

    @property
    def launches(self) -> int:
        """For one sum."""
        return (2 if self.variant.name == "third_law" else 1) * len(self._forces)

    def tune(self) -> None:
        """Find the fastest variant, on the first of the bodies where they are now."""
        count = min(self.count, SAMPLE[self._device.type])
        softened = self._forces[0].softening > 0.0
        key = ("n_body", self._device.id, self._memory.precision, softened, self._names, count)

        def attempt(variant: Variant) -> None:
            self._enqueue(variant, 0, count)
            self._memory.queue.finish()

        best = fastest(key, self._variants(), attempt)
        if self._memory.precision == "f64":
            best = fastest((*key, "seed"), [best, replace(best, seeded=not best.seeded)], attempt)
        self.variant = best
        self._kernels = {key: kernels for key, kernels in self._kernels.items() if key[0] == best}

    def enqueue(self) -> None:
        """Sum all forces at the places of `columns`."""
        for number in range(len(self._forces)):
            self._enqueue(self.variant, number, self.count)

    def _wants_tiles(self, variant: str | None) -> bool:
        return variant == "tiled" or (variant is None and self._device.type == "gpu")

    def _filled(self, values: np.ndarray) -> np.ndarray:
        """As long as the columns, nothing behind the last body."""
        return np.concatenate([values, np.zeros(self.stride - self.count)])

    def _lane_count(self) -> int:
        handle, wide = self._device.handle, self._memory.precision == "f64"
        native = handle.native_vector_width_double if wide else handle.native_vector_width_float
        return min(16, max(4, native))

    def _variants(self) -> list[Variant]:
        """What is tried here; the kernels for GPUs are ten times slower on a CPU, and those of vectors as bad on a GPU."""
        handle = self._device.handle
        most = handle.max_work_group_size
        if self._names is None:
            names = ("vectors", "third_law") if self._device.type == "cpu" else ("naive", "tiled")
        else:
            names = (self._names,)
        groups = {"naive": (min(256, most),), "vectors": (1, 4), "third_law": (1,)}
        found = [Variant(name, group) for name in names if name in groups for group in groups[name]]
        tiles = [Variant("tiled", tile, bodies) for _, tile, bodies in GPU_TILES if tile <= most]
        return found + (tiles if "tiled" in names else [])

    def _built(self, variant: Variant, softened: bool) -> tuple[Any, ...]:
        """The kernels of a variant."""
        import pyopencl

        key = (variant, softened)
        if key not in self._kernels:
            definitions: dict[str, Any] = {"SOFTENED": None} if softened else {}
            if variant.seeded:
                definitions["SEEDED"] = None
            if variant.name == "tiled":
                definitions |= {"TILE": variant.group, "BODIES": variant.bodies}
            if variant.name in ("vectors", "third_law"):
                definitions["LANES"] = self.lanes
            program = build(self._memory.context, ("n_body",), self._memory.precision, definitions)
            names = (variant.name, "add_rows") if variant.name == "third_law" else (variant.name,)
            self._kernels[key] = tuple(pyopencl.Kernel(program, name) for name in names)
        return self._kernels[key]

    def _enqueue(self, variant: Variant, number: int, count: int) -> None:
        force, (source, response) = self._forces[number], self._strengths[number]
        kernels = self._built(variant, force.softening > 0.0)
        launch, real = self._memory.launch, self._memory.real
        squared, adds = real(force.softening**2), np.int32(number > 0)
        sizes = np.int32(count), np.int32(self.stride)
        if variant.name == "third_law":
            rows = self._rows_for()
            launch(kernels[0], self._row_count, 1, *sizes, self.columns, source, rows, squared)
            vectors = -(-count // self.lanes)
            launch(kernels[1], vectors, 1, *sizes, np.int32(self._row_count), rows, response, self.sum, adds)
            return
        each = {"vectors": self.lanes, "tiled": variant.bodies}.get(variant.name, 1)
        arguments = (*sizes, self.columns, source, response, self.sum, squared, adds)
        launch(kernels[0], -(-count // each), variant.group, *arguments)

    def _rows_for(self) -> Any:
        """Room for the third law, made when it is first used."""
        if self._rows is None:
            self._row_count = max(1, min(ROWS_PER_UNIT * self._device.handle.max_compute_units, self.stride // self.lanes))
            self._rows = self._memory.room(self._row_count * 3 * self.stride)
        return self._rows


