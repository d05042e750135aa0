"""Measuring: the wanted quantity of a problem in a run, exactly as the run verb measures it."""

import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.problem import Problem
from mpp_taichi.errors import MppError
from mpp_taichi.recorders.table import TableRecorder
from mpp_taichi.report.expectations import Watcher
from mpp_taichi.scene.expectations import BALANCE_QUANTITIES, SUMMARY_QUANTITIES
from mpp_taichi.simulation.simulation import Simulation

ROUNDINGS = {"f64": 50.0}  # by which a start is shifted, more than the few of a flight between two collisions
FEW_ROUNDINGS = 2.0  # in other precisions: spheres that touch must not overlap by more than their solver takes for touching
SEED = 20261121
HEAP_SHIFT = 1e-3  # of the system's size: large enough that a start decides anew which heap a run comes to


@dataclass(frozen=True)
class Measurement:
    """The values of all entries in one run; None, and the reason, where the run does not have one of them.

    shortest   time between two samples that the quantity asks for [time]; infinite where it asks for none
    broken     whether the run itself broke off
    """

    values: tuple[float, ...] | None
    reason: str = ""
    shortest: float = float("inf")
    broken: bool = False


class BudgetWatch:
    """A recorder that takes no samples and stops the run when the budget ends."""

    def __init__(self, budget: Budget) -> None:
        """Watch a budget."""
        self.budget = budget

    def steps_until_due(self, _: Simulation) -> int:
        """Never due; raises OutOfTime where the budget has ended."""
        self.budget.check()
        return 2**31

    def record(self, _: Simulation) -> None:
        """Take no sample."""


def measure(
    simulation: Simulation,
    problem: Problem,
    steps: int,
    budget: Budget,
    *,
    finer: float = 1.0,
    start: tuple[np.ndarray, np.ndarray] | None = None,
    lengths: Mapping[int, float] | None = None,
    begin: Callable[[], None] = lambda: None,
) -> Measurement:
    """Run the span of a problem with so many equal steps, or samples of an adaptive method, and measure its quantity.

    With a timeline, `lengths` are the steps of the phases by their number [time]. In each phase `begin` is called before the
    first step.

    The samples are those of the run verb: every k-th step as `run.every` says, else about 200, and as often as the quantity
    asks for; the error that samples leave is a part of the quantity's error. With `finer` there are more samples.

    Raises:
        OutOfTime: the budget ended first.
    """
    wanted = problem.wanted
    assert wanted is not None
    names = {entry.quantity for entry in wanted.entries}
    if names & BALANCE_QUANTITIES and simulation.energy_balance is None:
        simulation.keep_energy_balance()
    simulation.dt = problem.span / steps
    simulation.restart()

    def enter() -> None:
        if lengths is not None:
            simulation.dt = lengths[simulation.phase_number]
            simulation.integrator.adopt(simulation.state, simulation.dt)
        begin()

    enter()
    if simulation.contacts is not None:
        simulation.contacts.collect()  # the counts of steps that were not taken by `Simulation.run`
    if start is not None:
        simulation.state.write(*start)
    every = max(1, int(TableRecorder.every_of(simulation, steps) / finer))
    watcher = Watcher(wanted.entries, every, finer=finer)
    table = TableRecorder(every)
    looks: list[Any] = [*([table] if names & SUMMARY_QUANTITIES.keys() else []), watcher]
    simulation.when_phase_begins.append(enter)
    try:
        simulation.run(problem.span, recorders=[BudgetWatch(budget), *looks], judge="off")
        for look in looks:
            look.finish(simulation)
        found = watcher.values(table.summary() if table.rows else {})
    except MppError as error:
        return Measurement(None, str(error).splitlines()[0], broken=True)
    finally:
        simulation.when_phase_begins.remove(enter)
    reasons = [reason or "it is not finite" for value, reason in found if value is None or not np.isfinite(value)]
    if reasons:
        return Measurement(None, reasons[0], watcher.shortest)
    return Measurement(tuple(float(value) for value, _ in found if value is not None), "", watcher.shortest)


def shifted_start(problem: Problem, number: int, precision: str, key: str = "") -> tuple[np.ndarray, np.ndarray] | None:
    """The start of run `number`: the scene's own, None, for 0; else with positions shifted at random by some roundings.

    Collisions enlarge the shifts, so that these runs differ as far as rounding lets the runs of this scene differ.

    Where the wanted quantity has a `shift`, the velocities of every run, of number 0 too, are shifted instead, at random by up
    to `shift` times the size of the system over the span, so that no spheres overlap that touch at the start. These shifts
    differ with the `key` of the setting: means of two settings are independent.
    """
    start = problem.start
    size = float(np.sqrt(np.mean(np.sum((start.position - start.position.mean(axis=0)) ** 2, axis=1)))) or 1.0
    if problem.wanted is not None and problem.wanted.shift:
        drawn = np.random.default_rng([SEED, number, zlib.crc32(key.encode())]).uniform(-1.0, 1.0, start.velocity.shape)
        drawn[:, problem.spec.dimensions :] = 0.0
        return start.position, (start.velocity + problem.wanted.shift * size / problem.span * drawn) * start.free
    if number == 0:
        return None
    epsilon = 2.0**-52 if precision == "f64" else 2.0**-23
    amount = ROUNDINGS.get(precision, FEW_ROUNDINGS) * epsilon * size
    shift = amount * np.random.default_rng([SEED, number]).uniform(-1.0, 1.0, start.position.shape) * start.free
    shift[:, problem.spec.dimensions :] = 0.0
    return start.position + shift, start.velocity * start.free


def with_runs(problem: Problem, **changes: Any) -> Problem:
    """The problem with other `runs`, `samples` or `shift` of its quantity."""
    assert problem.wanted is not None
    return replace(problem, wanted=replace(problem.wanted, **changes))


def means(values: Sequence[Sequence[float]]) -> tuple[np.ndarray, np.ndarray, int]:
    """Mean and standard deviation of each entry over the runs, and the number of runs that differ from each other."""
    table = np.array(values)
    distinct = len({tuple(row) for row in values})
    return table.mean(axis=0), table.std(axis=0, ddof=1) if len(table) > 1 else np.zeros(table.shape[1]), distinct
