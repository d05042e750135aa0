"""Two ways to run a drift with resting contacts: by one thread in one launch, or a launch for each loop over the spheres."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import taichi as ti

from mpp_taichi.contacts._base import ContactSetup
from mpp_taichi.contacts.rest.complementarity import PATIENCE
from mpp_taichi.contacts.rest.slow_groups import SlowGroups, Squeeze
from mpp_taichi.contacts.rest.step import ROOM, RestingStep
from mpp_taichi.device.fast_taichi.serial_loops import on_cpu
from mpp_taichi.neighbors.cell_grid import CellGrid
from mpp_taichi.neighbors.device_grid import DeviceGrid
from mpp_taichi.neighbors.prefix_sum import PrefixSum
from mpp_taichi.types import Template

ALL_PAIRS_UP_TO = 1000  # spheres on another device than the CPU, where a launch takes longer than the test of all pairs
TRIES = 12  # to build rows, each time for spheres twice as fast
MOST_ITERATIONS = 50_000  # for groups that are too large for the host


@dataclass(frozen=True)
class Drifted:
    """What a drift tells.

    changed      whether velocities had changed since the last drift
    iterations   of all problems
    crowded      largest number of contact rows for which there was no room, 0 if there was room for all
    hurried      whether spheres came out faster than rows could be built for
    squeezes     of each problem without a solution, the worst contact
    """

    changed: bool
    iterations: int
    crowded: int
    hurried: bool
    squeezes: tuple[Squeeze, ...]


IMPACTS, REST, WAYS, MOVED = 0, 1, 2, 3  # the three problems of a drift, one after the other, and its end
BEGIN = -1


@ti.data_oriented
class SerialPlan:
    """A single thread does the whole drift, and tests all pairs.

    The kernel ends at a problem that its iterations do not solve. The host solves it, and the kernel goes on behind it.
    """

    def __init__(self, step: RestingStep):
        """Bind the step."""
        self.step = step
        self.slow = SlowGroups(step.rows, step.solver)
        builder = ti.FieldsBuilder()
        self.bound = ti.field(float)  # of the speeds for which there are rows
        builder.dense(ti.i, 1).place(self.bound)
        self._tree = builder.finalize()

    def destroy(self) -> None:
        """Give the memory back."""
        self._tree.destroy()

    def drift(self, state: Any, time: float, h: float, resting_speed: float, kicked: bool) -> Drifted:
        """Move all spheres by h."""
        squeezes: list[Squeeze] = []
        iterations = crowded = hurried = 0
        changed, tries, hit, solved = int(kicked), 0, 0, BEGIN
        while solved != MOVED:
            told = self._drift(state, time, h, resting_speed, changed, tries, hit, solved)
            changed, tries, hit, solved = int(told[0]), int(told[1]), int(told[2]), int(told[3])
            iterations, crowded, hurried = iterations + int(told[4]), max(crowded, int(told[5])), hurried + int(told[6])
            if solved != MOVED:
                squeeze = self.slow.solve(h)[1]
                if squeeze is not None:
                    squeezes.append(squeeze)
        return Drifted(changed == 1, iterations, crowded, hurried > 0, tuple(squeezes))

    @ti.kernel
    def _drift(
        self, state: Template, time: float, h: float, resting_speed: float, kicked: int, tried: int, had_hit: int, solved: int
    ) -> ti.types.vector(7, int):
        """From the beginning, or on from the problem `solved` that the host has solved, to a problem that it has to solve."""
        result = ti.Vector([kicked, tried, had_hit, solved, 0, 0, 0])
        ti.loop_config(serialize=True)
        for _ in range(1):
            tries = tried
            hit = had_hit
            phase = solved
            if phase == BEGIN:
                if kicked == 1:
                    self.step.rows.remember()
                self.step.measure(state.velocity)
                self.bound[0] = ROOM * ti.cast(self.step.solver.total[0][0], float)
                result[0] = 1 if self.step.solver.total[0][1] > 0.0 else 0
            going = 1
            while going == 1:
                if phase == BEGIN:
                    tries += 1
                    for counting in range(2):
                        self.step.begin_rows()
                        self.step.add_all_pairs(state, self.bound[0], time, h, 0 if counting == 0 else 1 + result[0])
                        if counting == 0:
                            self.step.rows.number()
                            if self.step.rows.start[self.step.particle_count] > self.step.rows.capacity:
                                result[5] = ti.max(result[5], self.step.rows.start[self.step.particle_count])
                                self.step.rows.clear()
                    self.step.find_impacts(state, time, h, resting_speed)
                    hit = 1 if self.step.solver.total[0][0] > 0.0 else 0
                elif phase == IMPACTS:
                    self.step.end_impacts(state)
                elif phase == REST:
                    self.step.end_rest()
                phase = (
                    IMPACTS if phase == BEGIN and hit == 1 else REST if phase <= IMPACTS else WAYS if phase == REST else MOVED
                )
                if phase == WAYS and hit == 0:
                    phase = MOVED
                if phase == MOVED:
                    self.step.measure(self.step.solver.velocity)
                    fastest = ti.cast(self.step.solver.total[0][0], float)
                    if fastest > self.bound[0] and tries < TRIES:
                        self.bound[0] = 2.0 * fastest
                        phase = BEGIN
                    else:
                        going = 0
                        result[6] = 1 if fastest > self.bound[0] else 0
                else:
                    if phase == IMPACTS:
                        self.step.begin_impacts(state)
                        if ti.static(self.step.mixed):
                            spreading = 1
                            while spreading == 1:
                                self.step.spread_restitution()
                                spreading = 1 if self.step.solver.total[0][0] > 0.0 else 0
                    elif phase == REST:
                        self.step.begin_rest(state, h, hit)
                    else:
                        self.step.begin_ways(state, h)
                    self.step.solver.prepare(1 if phase == IMPACTS else 0, h)
                    outcome = self.step.solver.solve_serial(h)
                    result[4] += outcome[0]
                    if outcome[1] == 1:
                        going = 0
            if phase == MOVED:
                self.step.move(state, h)
            result[1], result[2], result[3] = tries, hit, phase
        return result


@ti.data_oriented
class ParallelPlan:
    """A launch for each loop; near spheres are found on the cell grid, or among all pairs of few spheres."""

    def __init__(self, step: RestingStep, setup: ContactSetup, state: Any):
        """Bind the step and the state; allocate the grid."""
        self.step = step
        self.state = state
        self.slow = SlowGroups(step.rows, step.solver)
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

    def drift(self, state: Any, time: float, h: float, resting_speed: float, kicked: bool) -> Drifted:
        """Move all spheres by h."""
        step = self.step
        if kicked:
            self._remember()
        self._measure(state.velocity)
        fastest, change = self._totals()
        bound = ROOM * fastest
        iterations = crowded = 0
        squeezes: list[Squeeze] = []

        def solve(prepare: Callable[[], None]) -> None:
            nonlocal iterations
            prepare()
            done, squeeze = self._solve(h)
            iterations += done
            if squeeze is not None:
                squeezes.append(squeeze)

        for _ in range(TRIES):
            if self.grid is not None:
                self._set_reach(h * bound)
                self.grid.build(state.position, self.reach)
            entries = self._number_rows(state, bound, time, h)
            if entries > step.rows.capacity:
                crowded = max(crowded, entries)
                self._clear()
            self._fill(state, bound, time, h, 2 if change > 0.0 else 1, resting_speed)
            hit = self._totals()[0] > 0.0
            if hit:
                solve(lambda: self._prepare_rebounds(state, h))
                self._end_impacts(state)
            solve(lambda after=int(hit): self._begin_rest(state, h, after))
            self._end_rest()
            if hit:
                solve(lambda: self._begin_ways(state, h))
            self._measure(step.solver.velocity)
            fastest, _ = self._totals()
            if fastest <= bound:
                break
            bound = 2.0 * fastest
        self._move(state, h)
        return Drifted(change > 0.0, iterations, crowded, not fastest <= bound, tuple(squeezes))

    def _solve(self, h: float) -> tuple[int, Squeeze | None]:
        """Iterate, then solve on the host what is not solved; returns the iterations and the worst contact without one."""
        iterations, unsolved = self.step.solver.solve_parallel(h, 0, PATIENCE)
        squeeze = None
        if unsolved:
            done, squeeze = self.slow.solve(h, whatever=False)
            if not done:
                iterations, unsolved = self.step.solver.solve_parallel(h, iterations, MOST_ITERATIONS)
                if unsolved:
                    squeeze = self.slow.solve(h)[1]
        return iterations, squeeze

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

    def _prepare_rebounds(self, state: Any, h: float) -> None:
        self._begin_impacts(state)
        while self.step.mixed:
            self._spread_restitution()
            if not self._totals()[0] > 0.0:
                break
        self._prepare_impacts(h)

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
