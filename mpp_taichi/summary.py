"""Summary: what a run was, how it went, and where its time went; as data for programs and as lines for people."""

import contextlib
import time as clock
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from mpp_taichi import plans

if TYPE_CHECKING:
    from mpp_taichi.recorders.table import TableRecorder
    from mpp_taichi.simulation import Simulation


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
    """A recorder whose looks are timed under a name."""

    def __init__(self, recorder: Any, stopwatch: Stopwatch, name: str) -> None:
        """Wrap a recorder."""
        self.recorder, self.stopwatch, self.name = recorder, stopwatch, name

    def steps_until_due(self, simulation: "Simulation") -> int:
        """As the recorder says."""
        return self.recorder.steps_until_due(simulation)

    def record(self, simulation: "Simulation") -> None:
        """Look, timed."""
        with self.stopwatch(self.name):
            self.recorder.record(simulation)

    def restart(self) -> None:
        """As the recorder does."""
        self.recorder.restart()


def effect_names(simulation: "Simulation") -> list[str]:
    """The effects that were compiled, as scenes call them."""
    return [type(force).__module__.rsplit(".", 1)[-1] for force in simulation.total_force.forces]


def summarize(simulation: "Simulation", table: "TableRecorder", stopwatch: Stopwatch, *, plan_asked: str) -> dict[str, Any]:
    """The facts of a run; `status`, `files` and `expect` are added by who knows them."""
    spec, device = simulation.spec, simulation.device
    timed_steps = (
        simulation.step_count - simulation.start.step - 1
    )  # the first launch is one step, and its time is that of the compiler
    rate = timed_steps / simulation.advance_seconds if simulation.advance_seconds > 0.0 else None
    count = simulation.state.particle_count
    pairs = count * (count - 1) * max(1, simulation.integrator.evaluations) if simulation.total_force.has_pairs else 0
    return {
        "scene": spec.source,
        "title": spec.title,
        "backend": device.backend,
        "device": device.name,
        "threads": device.threads,
        "precision": device.precision,
        "plan": simulation.plan,
        "plan_reason": plan_reason(simulation, plan_asked),
        "integrator": spec.integrator.name,
        "dt": simulation.dt,
        "effects": effect_names(simulation),
        "particle_count": count,
        "spring_count": len(simulation.start.springs),
        "steps": simulation.step_count,
        "time": simulation.time,
        "wall_seconds": stopwatch.total,
        "setup_seconds": simulation.setup_seconds,
        "compile_seconds": simulation.compile_seconds,
        "step_seconds": simulation.advance_seconds,
        **{f"{name}_seconds": seconds for name, seconds in stopwatch.seconds.items()},
        "steps_per_second": rate,
        "pair_interactions_per_second": rate * pairs if rate is not None and pairs else None,
        "launches_per_step": launches_per_step(simulation),
        **(_solver(simulation) if simulation.integrator.implicit else {}),
        "conserves_energy": simulation.conserves_energy,
        **(table.summary() if table.rows else {}),
    }


def _solver(simulation: "Simulation") -> dict[str, Any]:
    """What solving the steps' equations took."""
    report, steps = simulation.solver_report, max(1, simulation.solver_report.steps)
    return {
        "linear_solver": type(simulation.integrator.newton.linear).__name__,
        "newton_iterations_per_step": report.newton_iterations / steps,
        "newton_iterations_most": report.most_newton_iterations,
        "linear_iterations_per_step": report.linear_iterations / steps,
        "cut_steps": report.cut_steps,
        "unsolved_steps": report.unsolved,
    }


def launches_per_step(simulation: "Simulation") -> float | None:
    """Kernel launches a step took, on average so far: a serial launch holds many steps, a parallel step several loops."""
    done = simulation.step_count - simulation.start.step
    if done <= 0:
        return None
    if simulation.plan == "parallel":
        return float(simulation.stepper.launches_per_step())
    return simulation.kernel_calls / done


def plan_reason(simulation: "Simulation", plan_asked: str) -> str:
    """Why the plan is what it is."""
    if plan_asked != "auto":
        return "asked for"
    if not simulation.device.on_cpu:
        return "a device of many threads"
    relation = "below" if simulation.plan == "serial" else "from"
    return f"work of a step {simulation.step_work:,}, {relation} the crossover of {plans.CROSSOVER_WORK:,} on"


def lines(found: Mapping[str, Any], *, files: Sequence[str] = (), verdicts: Sequence[Any] = ()) -> list[str]:
    """The summary for a person."""
    springs = f", {found['spring_count']:,} springs" if found["spring_count"] else ""
    threads = f", {found['threads']} threads" if found["threads"] else ""
    rows = [
        ("scene", f"{found['title'] or found['scene']}: {found['particle_count']:,} particles{springs}"),
        ("effects", ", ".join(found["effects"]) or "none: every particle moves on a straight line"),
        ("method", f"{found['integrator']}, dt {found['dt']:.6g}, {found['precision']}"),
        ("rewound", found.get("rewound", "")),
        ("device", f"{found['backend']}: {found['device']}{threads}"),
        ("plan", f"{found['plan']}: {found['plan_reason']}"),
        ("reached", f"t = {found['time']:.9g} in {found['steps']:,} steps{_rate(found)}"),
        ("solver", _solver_line(found)),
        ("errors", _errors(found)),
        ("time", _times(found)),
        *(("wrote", file) for file in files),
        *(("expect", verdict_line(verdict)) for verdict in verdicts),
        ("status", found["status"]),
    ]
    return [f"  {name:8s}{text}" for name, text in rows if text]


def verdict_line(verdict: Any) -> str:
    """`pass  relative_energy_error_max = 2.1e-09, expected < 1e-06`."""
    value = "undefined" if verdict.value is None else f"{verdict.value:.9g}"
    reason = f" ({verdict.reason})" if verdict.reason else ""
    return f"{'pass' if verdict.passed else 'FAIL'}  {verdict.label} = {value}, expected {verdict.bound}{reason}"


def _rate(found: Mapping[str, Any]) -> str:
    if found["steps_per_second"] is None:
        return ""
    pairs = found["pair_interactions_per_second"]
    return f", {found['steps_per_second']:,.0f} steps/s" + (f", {pairs:.3g} pair interactions/s" if pairs else "")


def _solver_line(found: Mapping[str, Any]) -> str:
    if "linear_solver" not in found:
        return ""
    newton = f"{found['newton_iterations_per_step']:.2f} Newton iterations a step, at most {found['newton_iterations_most']}"
    linear = ", factors of a banded matrix in each"
    if found["linear_solver"] == "ConjugateGradients":
        linear = f", {found['linear_iterations_per_step']:.1f} of conjugate gradients a step"
    return f"{newton}{linear}; {found['cut_steps']} steps cut in pieces, {found['unsolved_steps']} not solved"


def _errors(found: Mapping[str, Any]) -> str:
    if "relative_energy_error_max" not in found:
        return ""
    energy = f"energy {found['relative_energy_error_max']:.2g}"
    if not found["conserves_energy"]:
        energy += " (a force does work here)"
    return f"{energy}, momentum {found['momentum_error_max']:.2g}, angular momentum {found['angular_momentum_error_max']:.2g}"


def _times(found: Mapping[str, Any]) -> str:
    total = found["wall_seconds"]
    names = ("setup", "compile", "step", "diagnostics", "capture", "encode")
    parts = [(name, found.get(f"{name}_seconds", 0.0)) for name in names]
    parts.append(("other", total - sum(seconds for _, seconds in parts)))
    told = ", ".join(f"{name} {seconds:.2f}" for name, seconds in parts if seconds >= 0.005)
    return f"{total:.2f} s" + (f": {told}" if told else "")
