"""Summary: the settings of a run, its results and its times as data; `summary_lines` writes them for a person."""

import contextlib
import time as clock
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from mpp_taichi.device.fast_taichi import switch
from mpp_taichi.energy.numerical_damping import numerical_damping
from mpp_taichi.report.adaptive_summary import step_control
from mpp_taichi.report.contact_summary import contact_facts
from mpp_taichi.report.spring_limits import spring_limit_facts
from mpp_taichi.step import plans

if TYPE_CHECKING:
    from mpp_taichi.recorders.table import TableRecorder
    from mpp_taichi.simulation.simulation import Simulation


class Stopwatch:
    """Seconds spent under each name."""

    def __init__(self) -> None:
        """Start the clock of the whole run."""
        self.began = clock.perf_counter()
        self.seconds: dict[str, float] = {}

    @contextlib.contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        """Time a block."""
        began = clock.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + clock.perf_counter() - began

    @property
    def total(self) -> float:
        """Seconds since the start."""
        return clock.perf_counter() - self.began


class Timed:
    """A recorder whose calls are timed under a name."""

    def __init__(self, recorder: Any, stopwatch: Stopwatch, name: str) -> None:
        """Wrap a recorder."""
        self.recorder, self.stopwatch, self.name = recorder, stopwatch, name

    def steps_until_due(self, simulation: "Simulation") -> int:
        """Steps until the recorder is due."""
        return self.recorder.steps_until_due(simulation)

    def record(self, simulation: "Simulation") -> None:
        """Call the recorder, timed."""
        with self.stopwatch(self.name):
            self.recorder.record(simulation)

    def restart(self) -> None:
        """Restart the recorder."""
        self.recorder.restart()


def effect_names(simulation: "Simulation") -> list[str]:
    """The effects that were compiled, by their names in scenes."""
    return simulation.phases[simulation.phase_number].effects


def summarize(
    simulation: "Simulation",
    table: "TableRecorder",
    stopwatch: Stopwatch,
    *,
    plan_asked: str,
    first_step: int = 0,
    keeps_pace: bool = False,
) -> dict[str, Any]:
    """The facts of a run; the callers add `status`, `files` and `expect`.

    `first_step` is the step from which this process went on, and `keeps_pace` is True for a run whose pace a person sets, in
    a window. Both decide about the rates: `steps_per_second` counts the launches of steps alone, without the compiler, and
    `steps_per_second_overall` all seconds since the compiler, with samples, pictures and files.
    """
    spec, device = simulation.spec, simulation.device
    phases = simulation.phases[simulation.course.first : simulation.phase_number + 1]
    # The first launch of each phase is one step, and its time the compiler's.
    done = simulation.step_count - max(simulation.start.step, first_step)
    timings, total = simulation.timings, stopwatch.total
    timed_steps = max(0, done - len(phases))
    rate = timed_steps / timings.advance_seconds if timings.advance_seconds > 0.0 else None
    whole = total - timings.setup_seconds - timings.compile_seconds - stopwatch.seconds.get("horizon", 0.0)
    overall = None if keeps_pace or rate is None or not whole > 0.0 else timed_steps / whole
    count = simulation.state.particle_count
    control = step_control(simulation)
    evaluations = float(max(1, simulation.integrator.evaluations))
    if control:
        evaluations = control["step_control"]["force_evaluations"] / max(1, simulation.step_count)
    by_pairs = simulation.total_force.has_pairs and not simulation.total_force.sums_apart
    pairs = count * (count - 1) * evaluations if by_pairs else 0
    return {
        "scene": spec.source,
        "title": spec.title,
        "units": spec.units,
        "backend": device.backend,
        "device": device.name,
        "threads": device.threads,
        "precision": device.precision,
        "plan": simulation.plan,
        "plan_reason": plan_reason(simulation, plan_asked),
        **switch.facts(),
        "integrator": spec.integrator.name,
        "dt": simulation.dt,
        "effects": list(dict.fromkeys(name for phase in phases for name in phase.effects)),
        "particle_count": count,
        "spring_count": len(simulation.start.springs),
        "rod_count": len(simulation.start.rods),
        "steps": simulation.step_count,
        "time": simulation.time,
        "wall_seconds": total,
        "setup_seconds": simulation.timings.setup_seconds,
        "compile_seconds": simulation.timings.compile_seconds,
        "step_seconds": simulation.timings.advance_seconds,
        **{f"{name}_seconds": seconds for name, seconds in stopwatch.seconds.items()},
        "steps_per_second": rate,
        "steps_per_second_overall": overall,
        "pair_interactions_per_second": rate * pairs if rate is not None and pairs else None,
        "launches_per_step": launches_per_step(simulation),
        **_solver(simulation),
        **control,
        **contact_facts(simulation),
        **spring_limit_facts(simulation),
        **({"heat_bath": True} if simulation.integrator.draws_random else {}),
        **({"driven_bodies": len(simulation.start.driven)} if simulation.start.driven else {}),
        **({"changing_bodies": len(simulation.start.changing)} if simulation.start.changing else {}),
        "conserves_energy": simulation.phase.conserves_energy and all(row["conserves_energy"] for row in table.rows),
        "conserves_momentum": simulation.phase.conserves_momentum and all(row["conserves_momentum"] for row in table.rows),
        "conserves_angular_momentum": simulation.phase.conserves_angular_momentum
        and all(row["conserves_momentum"] for row in table.rows),
        "phases": phase_facts(simulation),
        **(table.summary() if table.rows else {}),
        **damping_of_method(simulation, table),
    }


def _solver(simulation: "Simulation") -> dict[str, Any]:
    """The work of the solver for the equations of implicit steps; {} for methods that solve none."""
    report, steps = simulation.solver_report, max(1, simulation.solver_report.steps)
    linear_solver = simulation.launcher.facts().get("linear_solver")
    if linear_solver is None:
        return {}
    return {
        "linear_solver": linear_solver,
        "newton_iterations_per_step": report.newton_iterations / steps,
        "newton_iterations_most": report.most_newton_iterations,
        "linear_iterations_per_step": report.linear_iterations / steps,
        "cut_steps": report.cut_steps,
        "gaining_pieces": report.gaining_pieces,
        "unsolved_steps": report.unsolved,
    }


def phase_facts(simulation: "Simulation") -> list[dict[str, Any]]:
    """The changes by the timeline so far: time, keys and values, the effects after it, and the energy that the change adds."""
    begun = simulation.phases[simulation.course.first + 1 : simulation.phase_number + 1]
    return [
        {
            "at": phase.at,
            "changes": phase.changes,
            "effects": phase.effects,
            "integrator": phase.spec.integrator.name,
            "work": work,
        }
        for phase, work in zip(begun, simulation.phase_work, strict=True)
    ]


def damping_of_method(simulation: "Simulation", table: "TableRecorder") -> dict[str, Any]:
    """The energy lost by the method itself: measured where an energy balance is kept, or where no force explains a loss.

    It is left out for a symplectic method in a scene that conserves energy, which loses no energy in the long run, and for a
    method that works to round-off, whose loss cannot be seen.
    """
    balance = simulation.energy_balance
    closed = simulation.phase.conserves_energy
    if (
        not table.rows
        or simulation.integrator.controlled_by
        or (closed and simulation.integrator.symplectic)
        or not (closed or balance is not None)
    ):
        return {}
    times = [row["time"] for row in table.rows]
    energies = [row["energy_balance_residual" if balance is not None else "total_energy"] for row in table.rows]
    losses = [energies[0] - energy for energy in energies]
    return {"numerical_damping": numerical_damping(times, losses, balance.oscillations if balance is not None else None)}


def launches_per_step(simulation: "Simulation") -> float | None:
    """The mean number of kernel launches per step so far: a serial launch holds many steps, a parallel step several loops."""
    done = simulation.step_count - simulation.start.step
    if done <= 0:
        return None
    if simulation.plan == "parallel":
        launches = simulation.launcher.launches_per_step()
        return None if launches is None else float(launches)
    return simulation.timings.launch_count / done


def plan_reason(simulation: "Simulation", plan_asked: str) -> str:
    """The reason for the choice of the plan."""
    if plan_asked != "auto":
        return "asked for"
    if not simulation.device.on_cpu:
        return "a device of many threads"
    if simulation.total_force.by_tree:
        return "a tree is built and walked by all threads"
    if simulation.total_force.by_lists:
        return "lists of neighbours are made and read by all threads"
    relation = "below" if simulation.plan == "serial" else "from"
    return f"work of a step {simulation.phase.work:,}, {relation} the crossover of {plans.CROSSOVER_WORK:,} on"
