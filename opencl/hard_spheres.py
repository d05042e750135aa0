"""Hard spheres in OpenCL: the `pairwise` step on a cell grid, off all surfaces that a scene may have."""

from typing import Any

import numpy as np

from mpp_taichi.start.contact_setup import ContactSetup

from .devices import Device, Failed
from .program import Memory, build, definition

FEW = 128  # spheres up to which one work-item looks at all pairs: fewer launches
PAIRS_PER_SPHERE = 8  # for which there is room: a contact graph of spheres has fewer than 7.5 edges for each
CELLS_PER_SPHERE = 4  # at most, on the whole grid
MOST_CELLS = 1 << 15  # along an axis, so that in f32 a place in units of cells is rounded by 1/512 of a cell at most
# Of a cell over the largest diameter: two spheres that touch are then less than a cell apart, whatever rounding does.
WIDER = 1.01
FEWEST_CELLS = 3  # along an axis that repeats: with fewer, a pair would be seen from both sides
PARTS = 64  # of the cells, for sums over all of them
DRIFTS_PER_GRID = 256  # after which the grid is fitted to the spheres again; they may leave it, at the cost of speed alone
GROUP = 64
ITEMS_OF_ROUNDS = 256  # that work off pairs together on a GPU, where one alone would wait for memory all the time
LONG_AGO = -1e30  # when a sphere that never touched anything did so last
KINDS = ("plane", "cylinder", "sphere")


class HardSpheres:
    """The spheres of a setup on a device, and `drift`, which moves them and lets them bounce."""

    def __init__(self, memory: Memory, device: Device, setup: ContactSetup):
        """Allocate and compile."""
        import pyopencl

        self._memory, self._setup = memory, setup
        self._vectors: Any = pyopencl.cltypes
        count = self.count = setup.particle_count
        surfaces = setup.enclosure.surfaces
        self._period = np.array(setup.enclosure.period)[: setup.dimensions]
        self._widest = max(WIDER * 2.0 * float(setup.radius.max()), float(np.finfo(np.float32).tiny))
        self._few = count <= FEW or bool(((self._period > 0.0) & (self._period < FEWEST_CELLS * self._widest)).any())
        room = PAIRS_PER_SPHERE * count + 64
        definitions: dict[str, Any] = {"DIMENSIONS": setup.dimensions, "ROOM": room, "MATERIALS": len(setup.restitution)}
        definitions["SURFACES"] = len(surfaces)
        if self._period.any():
            names = ("PERIOD_X", "PERIOD_Y", "PERIOD_Z")
            periods = {name: definition(value, memory.precision) for name, value in zip(names, setup.enclosure.period)}
            definitions |= {"PERIODIC": None, **periods}
        if setup.contact_time > 0.0:
            definitions["HAS_CONTACT_TIME"] = None
        program = build(memory.context, ("hard_spheres",), memory.precision, definitions)
        on_grid = ["clear", "move_and_count", "sum_parts", "begin_cells", "sort", "find"]
        self._together = device.type == "gpu" and not self._few
        self._rounds_of = min(ITEMS_OF_ROUNDS, device.handle.max_work_group_size)
        working_off = "work_off_together" if self._together else "work_off"
        used = [*(["find_among_few"] if self._few else on_grid), working_off, *["bounce_off_walls"] * bool(surfaces)]
        self._kernels = {name: pyopencl.Kernel(program, name) for name in used}
        flat = np.arange(3) < setup.dimensions
        self._radius = memory.reals(setup.radius)
        self._inverse_mass = memory.reals(memory.padded(setup.inverse_mass * flat))
        self._material = memory.buffer(setup.material.astype(np.int32))
        self._restitution = memory.reals(setup.restitution)
        self._last_contact = memory.reals(np.full(count, LONG_AGO))
        self._surfaces = memory.reals(np.array([surface_numbers(surface, setup.dimensions) for surface in surfaces]))
        integer = np.int32
        self._row, self._partner = memory.room(count + 3, integer), memory.room(room, integer)
        self._found, self._given_up = memory.room(2 * room, integer), memory.room(1, integer)
        if not self._few:
            self._most_cells = CELLS_PER_SPHERE * count + 64
            self._cell, self._order = memory.room(count, integer), memory.room(count, integer)
            self._crowd, self._start = memory.room(self._most_cells, integer), memory.room(self._most_cells + 1, integer)
            self._parts, self._sorted = memory.room(PARTS, integer), memory.room(4 * count)
        self._drifts_left = 0

    @property
    def variant(self) -> str:
        """In words."""
        found = "all pairs" if self._few else "cell grid"
        return f"pairwise, {found}{', in rounds' if self._together else ''}"

    @property
    def launches(self) -> int:
        """For one drift."""
        return len(self._kernels)

    def forget(self) -> None:
        """Positions and velocities were set from outside."""
        self._memory.write(self._last_contact, np.full(self.count, LONG_AGO, self._memory.real))
        self._memory.write(self._given_up, np.zeros(1, np.int32))
        self._drifts_left = 0

    def drift(self, position: Any, velocity: Any, time: float, span: float) -> None:
        """Move all spheres by `span` along their velocities, then let those bounce that overlap."""
        real = self._memory.real
        moved = (position, velocity, real(span))
        if self._few:
            self._run("find_among_few", 1, np.int32(self.count), *moved, self._radius, self._row, self._found)
        else:
            self._find(*moved)
        spheres = (np.int32(self.count), position, velocity, self._radius, self._inverse_mass)
        when = (real(time + span), real(self._setup.contact_time), self._last_contact)
        bounced = (*spheres, self._material, self._restitution, *when, self._row, self._found)
        if self._together:
            items = self._rounds_of
            kernel, turns = self._kernels["work_off_together"], (self._cell, self._partner)  # both free by now
            self._memory.launch(kernel, items, items, *bounced, *turns, self._given_up)
        else:
            self._run("work_off", 1, *bounced, self._partner, self._given_up)
        if "bounce_off_walls" in self._kernels:
            self._run("bounce_off_walls", self.count, *spheres, *when, self._surfaces)

    def check(self) -> None:
        """Failed where there were more pairs than there is room for."""
        given_up = int(self._memory.read(self._given_up, 1, np.int32)[0])
        if given_up:
            raise Failed(f"{given_up} overlapping pairs found no room; there is some for {PAIRS_PER_SPHERE} a sphere")

    def _find(self, position: Any, velocity: Any, span: Any) -> None:
        if self._drifts_left == 0:
            self._fit(self._memory.read(position, (self.count, 4)).astype(float))
            self._drifts_left = DRIFTS_PER_GRID
        self._drifts_left -= 1
        count, grid, cells = np.int32(self.count), self._grid, np.int32(self._cell_count)
        self._run("clear", self.count + 3, self._row, np.int32(self.count + 3))
        self._run("move_and_count", self.count, count, position, velocity, span, *grid, self._cell, self._crowd)
        self._run("sum_parts", PARTS, cells, self._crowd, self._parts)
        self._run("begin_cells", PARTS, cells, self._crowd, self._parts, self._start)
        into = (self._order, self._sorted)
        self._run("sort", self.count, count, position, self._radius, self._cell, self._start, self._crowd, *into)
        self._run("find", self.count, count, *grid, self._start, *into, self._row, self._found)

    def _fit(self, position: np.ndarray) -> None:
        """A grid around the spheres, or of the box that repeats, in cells that hold the largest."""
        place = np.nan_to_num(position[:, : self._setup.dimensions])
        repeats = self._period > 0.0
        lower = np.where(repeats, self._setup.enclosure.origin[: len(repeats)], place.min(axis=0))
        extent = np.where(repeats, self._period, np.ptp(place, axis=0))
        width = max(self._widest, float(extent.max()) / MOST_CELLS)
        while (counted := cells_along(extent, width, repeats)).prod() > self._most_cells and width < extent.max():
            width *= 1.25
        cells, corner, inverse = np.ones(4, int), np.zeros(4), np.zeros(4)
        cells[: len(extent)], corner[: len(extent)] = counted, lower
        inverse[: len(extent)] = np.where(repeats, counted / np.where(repeats, extent, 1.0), 1.0 / width)
        make = self._vectors.make_float4 if self._memory.precision == "f32" else self._vectors.make_double4
        self._cell_count = int(cells.prod())
        self._grid = (make(*corner), make(*inverse), self._vectors.make_int4(*cells))

    def _run(self, name: str, items: int, *arguments: Any) -> None:
        self._memory.launch(self._kernels[name], items, 1 if items in (1, PARTS) else GROUP, *arguments)


def cells_along(extent: np.ndarray, width: float, repeats: np.ndarray) -> np.ndarray:
    """How many cells of at least this width there are along each axis; where it repeats, they fill it."""
    whole = np.floor(extent / width).astype(int)
    return np.where(repeats, np.maximum(whole, FEWEST_CELLS), whole + 1)


def surface_numbers(surface: Any, dimensions: int) -> list[float]:
    """A surface as kernels read it; see hard_spheres.cl."""
    flat = [float(axis < dimensions) for axis in range(3)]
    vectors = [value * f for vector in (surface.point, surface.direction, surface.velocity) for value, f in zip(vector, flat)]
    kind, side = float(KINDS.index(surface.kind)), 1.0 if surface.inside else -1.0
    return [kind, side, surface.radius, surface.restitution, *vectors, 0.0]
