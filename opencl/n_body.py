"""The direct sum over all pairs in OpenCL: gravity and charges, by the kernel that is fastest here."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .devices import Device, Refused
from .program import Memory, build
from .tuning import fastest

VARIANTS = ("naive", "tiled", "vectors", "third_law")  # each also with " seeded", in f64
FAR = 1e15  # where bodies without a source lie that fill the last tile: their squared distances are numbers of f32
PADDING = 16  # the widest vectors
# Bodies on which variants are tried: on a CPU so few that an attempt often ends before something else has its turn.
SAMPLE = {"cpu": 4096, "gpu": 131_072, "accelerator": 4096}
ROWS_PER_UNIT = 4  # of the third law, for each compute unit, so that a busy core holds up little
TILES = tuple((tile, bodies) for tile in (128, 256) for bodies in (1, 2, 4))  # work-items of a group, bodies of each
TILE_ON_CPU = (64, 1)  # work-items are loops there, and compiling many of them takes seconds


@dataclass(frozen=True)
class PairForce:
    """a_i = response_i Σ_j source_j d / (|d|² + softening²)^(3/2); response and source are (particle_count,).

    A `formula` (formula.py) is the text of steps for another law than the inverse cube.
    """

    source: np.ndarray
    response: np.ndarray
    softening: float
    formula: str = ""


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
        """Allocate; `variant` is one to take instead of the fastest, which `tune` finds."""
        name, _, seed = (variant or VARIANTS[0]).partition(" ")
        if name not in VARIANTS or seed not in ("", "seeded") or (seed and memory.precision == "f32"):
            raise Refused(f"no variant {variant!r} of the direct sum in {memory.precision}, there are {', '.join(VARIANTS)}")
        self._memory, self._device, self._forces = memory, device, tuple(forces)
        self._asked = (name, bool(seed)) if variant is not None else None
        self.count = len(forces[0].source)
        self._variants = self._named(name, bool(seed)) if variant is not None else self._usual()
        filled = max([PADDING, *(each.group * each.bodies for each in self._variants if each.name == "tiled")])
        self.stride = -(-self.count // filled) * filled
        self.columns = memory.reals(np.full(3 * self.stride, FAR))
        self.sum = memory.room(3 * self.stride)
        self._strengths = [tuple(memory.reals(self._filled(each)) for each in (one.source, one.response)) for one in forces]
        self.lanes = self._lane_count()
        self._rows: Any = None
        self._row_count = 1
        self._kernels: dict[tuple[Variant, bool, str], tuple[Any, ...]] = {}
        self.variant = self._variants[0]

    @property
    def launches(self) -> int:
        """For one sum."""
        return (2 if self.variant.name == "third_law" else 1) * len(self._forces)

    def tune(self) -> None:
        """Find the fastest variant, on the first of the bodies where they are now."""
        if self._asked is not None:
            return
        count = min(self.count, SAMPLE[self._device.type])
        first = self._forces[0]
        key = ("n_body", self._device.id, self._memory.precision, self._softened(first), count, first.formula)

        def attempt(variant: Variant) -> None:
            self._enqueue(variant, 0, count)
            self._memory.queue.finish()

        best = fastest(key, self._variants, attempt)
        if self._memory.precision == "f64":
            best = fastest((*key, "seeded"), [best, replace(best, seeded=True)], attempt)
        self.variant = best
        if best.name != "third_law" and self._rows is not None:
            self._memory.free(self._rows)
            self._rows = None
        self._kernels = {key: kernels for key, kernels in self._kernels.items() if key[0] == best}

    def enqueue(self) -> None:
        """Sum all forces at the places of `columns`."""
        for number in range(len(self._forces)):
            self._enqueue(self.variant, number, self.count)

    def _filled(self, values: np.ndarray) -> np.ndarray:
        """As long as the columns, nothing behind the last body."""
        return np.concatenate([values, np.zeros(self.stride - self.count)])

    def _softened(self, force: PairForce) -> bool:
        """Whether a body may meet itself: its distance is then not zero, as the kernels have it."""
        return bool(self._memory.real(force.softening**2) > 0.0)

    def _lane_count(self) -> int:
        handle, wide = self._device.handle, self._memory.precision == "f64"
        native = handle.native_vector_width_double if wide else handle.native_vector_width_float
        return min(16, max(4, native))

    def _usual(self) -> list[Variant]:
        """What is tried here; the kernels for GPUs are ten times slower on a CPU, and those of vectors as bad on a GPU."""
        if any(force.formula for force in self._forces):  # the others sum beyond the last body, where a formula may be infinite
            return [Variant("vectors", 1)] if self._device.type == "cpu" else self._named("naive", False)
        if self._device.type == "cpu":
            return [Variant("vectors", 1), Variant("vectors", 4), Variant("third_law", 1)]
        most = self._device.handle.max_work_group_size
        return [*self._named("naive", False), *(Variant("tiled", tile, bodies) for tile, bodies in TILES if tile <= most)]

    def _named(self, name: str, seeded: bool) -> list[Variant]:
        """The one of this name."""
        tile, bodies = TILE_ON_CPU if self._device.type == "cpu" else TILES[-2]
        group = {"naive": min(256, self._device.handle.max_work_group_size), "tiled": tile}.get(name, 1)
        return [Variant(name, group, bodies if name == "tiled" else 1, seeded)]

    def _built(self, variant: Variant, softened: bool, formula: str) -> tuple[Any, ...]:
        """The kernels of a variant."""
        import pyopencl

        key = (variant, softened, formula)
        if key not in self._kernels:
            definitions: dict[str, Any] = {"SOFTENED": None} if softened else {}
            if variant.seeded:
                definitions["SEEDED"] = None
            if variant.name == "tiled":
                definitions |= {"TILE": variant.group, "BODIES": variant.bodies}
            if variant.name in ("vectors", "third_law"):
                definitions["LANES"] = self.lanes
            program = build(self._memory.context, ("n_body",), self._memory.precision, definitions, formula)
            names = (variant.name, "add_rows") if variant.name == "third_law" else (variant.name,)
            self._kernels[key] = tuple(pyopencl.Kernel(program, name) for name in names)
        return self._kernels[key]

    def _enqueue(self, variant: Variant, number: int, count: int) -> None:
        force, (source, response) = self._forces[number], self._strengths[number]
        kernels = self._built(variant, self._softened(force), force.formula)
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
