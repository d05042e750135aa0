"""Two ways to run a drift with resting contacts: by one thread in one launch, or a launch for each loop over the spheres."""

from typing import Any

import taichi as ti

from mpp_taichi.contacts._base import ContactSetup
from mpp_taichi.contacts.rest.step import ROOM, RestingStep
from mpp_taichi.device.fast_taichi.serial_loops import on_cpu
from mpp_taichi.neighbors.cell_grid import CellGrid
from mpp_taichi.neighbors.device_grid import DeviceGrid
from mpp_taichi.neighbors.prefix_sum import PrefixSum
from mpp_taichi.types import Template

ALL_PAIRS_UP_TO = 1000  # spheres on another device than the CPU, where a launch takes longer than the test of all pairs
TRIES = 12  # to build rows, each time for spheres twice as fast


@ti.data_oriented
class SerialPlan:
    """A single thread does the whole drift, and tests all pairs."""

    def __init__(self, step: RestingStep):
        """Bind the step."""
        self.step = step

    def destroy(self) -> None:
        """Own no memory."""

    def drift(self, state: Any, time: float, h: float, resting_speed: float, kicked: bool) -> tuple[bool, int, int]:
        """Returns whether velocities had changed since the last drift, the iterations, and the number of failures."""
        changed, iterations, unresolved = self._drift(state, time, h, resting_speed, int(kicked))
        return changed == 1, int(iterations), int(unresolved)

    @ti.kernel
    def _drift(self, state: Template, time: float, h: float, resting_speed: float, kicked: int) -> ti.types.vector(3, int):
        result = ti.Vector([0, 0, 0])
        ti.loop_config(serialize=True)
        for _ in range(1):
            if kicked == 1:
                self.step.rows.remember()
            self.step.measure(state.velocity)
            bound = ROOM * ti.cast(self.step.solver.total[0][0], float)
            result[0] = 1 if self.step.solver.total[0][1] > 0.0 else 0
            tries = 0
            while tries < TRIES:
                tries += 1
                for counting in range(2):
                    self.step.begin_rows()
                    self.step.add_all_pairs(state, bound, time, h, 0 if counting == 0 else 1 + result[0])
                    if counting == 0:
                        self.step.rows.number()
                        if self.step.rows.start[self.step.particle_count] > self.step.rows.capacity:
                            result[2] += self.step.rows.start[self.step.particle_count]
                            self.step.rows.clear()
                self.step.find_impacts(state, time, h, resting_speed)
                hit = self.step.solver.total[0][0] > 0.0
                phase = 0 if hit else 1
                last = 2 if hit else 1
                while phase <= last:
                    if phase == 0:
                        self.step.begin_impacts(state)
                        if ti.static(self.step.mixed):
                            spreading = 1
                            while spreading == 1:
                                self.step.spread_restitution()
                                spreading = 1 if self.step.solver.total[0][0] > 0.0 else 0
                    elif phase == 1:
                        self.step.begin_rest(state, h, ti.cast(hit, ti.i32))
                    else:
                        self.step.begin_ways(state, h)
                    self.step.solver.prepare(1 if phase == 0 else 0, h)
                    outcome = self.step.solver.solve_serial(h)
                    result[1] += outcome[0]
                    result[2] += outcome[1]
                    if phase == 0:
                        self.step.end_impacts(state)
                    elif phase == 1:
                        self.step.end_rest()
                    phase += 1
                self.step.measure(self.step.solver.velocity)
                fastest = ti.cast(self.step.solver.total[0][0], float)
                if fastest <= bound:
                    tries = TRIES + 1
                else:
                    bound = 2.0 * fastest
            if tries == TRIES:
                result[2] += 1
            self.step.move(state, h)
        return result


@ti.data_oriented
class ParallelPlan:
    """A launch for each loop; near spheres are found on the cell grid, or among all pairs of few spheres."""

    def __init__(self, step: RestingStep, setup: ContactSetup, state: Any):
        """Bind the step and the state; allocate the grid."""
        self.step = step
        self.state = state
        n, enclosure = setup.particle_count, setup.enclosure
        kind = CellGrid if on_cpu() else DeviceGrid
        self.few = not on_cpu() and n <= ALL_PAIRS_UP_TO
        self.grid = None if self.few else kind(n, setup.dimensions, enclosure.period, enclosure.origin)
        self.sums = None if on_cpu() else PrefixSum(n)
        builder = ti.FieldsBuilder()
        self.reach = ti.field(float)
        builder.dense(ti.i, setup.particle_count).place(self.reach)
        self._tree = builder.finalize()

    def destroy(self) -> None:
        """Give the memory back."""
        for part in (self.grid, self.sums):
            if part is not None:
                part.destroy()
        self._tree.destroy()

    def drift(self, state: Any, time: float, h: float, resting_speed: float, kicked: bool) -> tuple[bool, int, int]:
        """Returns whether velocities had changed since the last drift, the iterations, and the number of failures."""
        step = self.step
        if kicked:
            self._remember()
        self._measure(state.velocity)
        fastest, change = self._totals()
        bound = ROOM * fastest
        iterations = unresolved = 0
        for _ in range(TRIES):
            if self.grid is not None:
                self._set_reach(h * bound)
                self.grid.build(state.position, self.reach)
            entries = self._number_rows(state, bound, time, h)
            if entries > step.rows.capacity:
                unresolved += entries
                self._clear()
            self._fill(state, bound, time, h, 2 if change > 0.0 else 1, resting_speed)
            hit = self._totals()[0] > 0.0
            if hit:
                done, failed = self._rebound(state, h)
                iterations, unresolved = iterations + done, unresolved + failed
            self._begin_rest(state, h, int(hit))
            done, failed = step.solver.solve_parallel(h)
            iterations, unresolved = iterations + done, unresolved + failed
            self._end_rest()
            if hit:
                self._begin_ways(state, h)
                done, failed = step.solver.solve_parallel(h)
                iterations, unresolved = iterations + done, unresolved + failed
            self._measure(step.solver.velocity)
            fastest, _ = self._totals()
            if fastest <= bound:
                break
            bound = 2.0 * fastest
        else:
            unresolved += 1
        self._move(state, h)
        return change > 0.0, iterations, unresolved

    def _number_rows(self, state: Any, bound: float, time: float, h: float) -> int:
        """Count the entries of each row, and set where the rows begin; returns the number of entries."""
        rows = self.step.rows
        if self.sums is None:
            return self._count(state, bound, time, h)
        self._count_each(state, bound, time, h)
        self.sums.run(rows.filled, rows.start, self.step.particle_count)
        return int(rows.start[self.step.particle_count])

    def _totals(self) -> tuple[float, float]:
        total = self.step.solver.total[0]
        return float(total[0]), float(total[1])

    def _rebound(self, state: Any, h: float) -> tuple[int, int]:
        self._begin_impacts(state)
        while self.step.mixed:
            self._spread_restitution()
            if not self._totals()[0] > 0.0:
                break
        self._prepare_impacts(h)
        outcome = self.step.solver.solve_parallel(h)
        self._end_impacts(state)
        return outcome

    @ti.func
    def _see(self, slot, other, margin, filling):
        i, j = self.grid.order[slot], self.grid.order[other]
        self.step.rows.add_sphere(i, j, self.step.rows.separation(self.state, i, j), margin, filling)

    @ti.func
    def _look(self, state: Template, bound, time, h, filling):
        if ti.static(self.few):
            self.step.add_all_pairs(state, bound, time, h, filling)
        else:
            for slot in range(self.step.particle_count):
                i = self.grid.order[slot]
                self.grid.visit(slot, self._see, 2.0 * h * bound, filling)
                self.step.rows.add_surfaces(state, i, bound, time, h, filling)

    @ti.kernel
    def _remember(self):
        self.step.rows.remember()

    @ti.kernel
    def _measure(self, velocity: Template):
        self.step.measure(velocity)

    @ti.kernel
    def _set_reach(self, way: float):
        for i in range(self.step.particle_count):
            self.reach[i] = self.step.rows.radius[i] + way

    @ti.kernel
    def _count(self, state: Template, bound: float, time: float, h: float) -> int:
        self.step.begin_rows()
        self._look(state, bound, time, h, 0)
        self.step.rows.number()
        return self.step.rows.start[self.step.particle_count]

    @ti.kernel
    def _count_each(self, state: Template, bound: float, time: float, h: float):
        self.step.begin_rows()
        self._look(state, bound, time, h, 0)

    @ti.kernel
    def _clear(self):
        self.step.rows.clear()

    @ti.kernel
    def _fill(self, state: Template, bound: float, time: float, h: float, filling: int, resting_speed: float):
        self.step.begin_rows()
        self._look(state, bound, time, h, filling)
        self.step.find_impacts(state, time, h, resting_speed)

    @ti.kernel
    def _begin_impacts(self, state: Template):
        self.step.begin_impacts(state)

    @ti.kernel
    def _prepare_impacts(self, h: float):
        self.step.solver.prepare(1, h)

    @ti.kernel
    def _spread_restitution(self):
        self.step.spread_restitution()

    @ti.kernel
    def _end_impacts(self, state: Template):
        self.step.end_impacts(state)

    @ti.kernel
    def _begin_rest(self, state: Template, h: float, after_impacts: int):
        self.step.begin_rest(state, h, after_impacts)
        self.step.solver.prepare(0, h)

    @ti.kernel
    def _end_rest(self):
        self.step.end_rest()

    @ti.kernel
    def _begin_ways(self, state: Template, h: float):
        self.step.begin_ways(state, h)
        self.step.solver.prepare(0, h)

    @ti.kernel
    def _move(self, state: Template, h: float):
        self.step.move(state, h)
