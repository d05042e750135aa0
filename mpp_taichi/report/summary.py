"""Summary: the settings of a run, its results and its times; as data for programs and as lines for people."""

import contextlib
import time as clock
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from mpp_taichi.device.fast_taichi import switch
from mpp_taichi.energy.numerical_damping import numerical_damping
from mpp_taichi.modes.network_report import mode_lines, network_lines
from mpp_taichi.report.adaptive_summary import step_control, step_control_line
from mpp_taichi.report.contact_summary import contact_facts, contact_line
from mpp_taichi.scene.human_units import symbol, time_text
from mpp_taichi.step import plans

if TYPE_CHECKING:
    from mpp_taichi.recorders.table import TableRecorder
    from mpp_taichi.simulation.simulation import Simulation

PHASES_TOLD = 8


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


def summarize(simulation: "Simulation", table: "TableRecorder", stopwatch: Stopwatch, *, plan_asked: str) -> dict[str, Any]:
    """The facts of a run; the callers add `status`, `files` and `expect`."""
    spec, device = simulation.spec, simulation.device
    phases = simulation.phases[simulation.course.first : simulation.phase_number + 1]
    # The first launch of each phase is one step, and its time the compiler's.
    timed_steps = simulation.step_count - simulation.start.step - len(phases)
    rate = timed_steps / simulation.timings.advance_seconds if simulation.timings.advance_seconds > 0.0 else None
    count = simulation.state.particle_count
    control = step_control(simulation)
    evaluations = float(max(1, simulation.integrator.evaluations))
    if control:
        evaluations = control["step_control"]["force_evaluations"] / max(1, simulation.step_count)
    by_pairs = simulation.total_force.has_pairs and not simulation.total_force.by_tree
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
        "steps": simulation.step_count,
        "time": simulation.time,
        "wall_seconds": stopwatch.total,
        "setup_seconds": simulation.timings.setup_seconds,
        "compile_seconds": simulation.timings.compile_seconds,
        "step_seconds": simulation.timings.advance_seconds,
        **{f"{name}_seconds": seconds for name, seconds in stopwatch.seconds.items()},
        "steps_per_second": rate,
        "pair_interactions_per_second": rate * pairs if rate is not None and pairs else None,
        "launches_per_step": launches_per_step(simulation),
        **_solver(simulation),
        **control,
        **contact_facts(simulation),
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
    relation = "below" if simulation.plan == "serial" else "from"
    return f"work of a step {simulation.phase.work:,}, {relation} the crossover of {plans.CROSSOVER_WORK:,} on"


def lines(found: Mapping[str, Any], *, files: Sequence[str] = (), verdicts: Sequence[Any] = ()) -> list[str]:
    """The summary for a person."""
    springs = f", {found['spring_count']:,} springs" if found["spring_count"] else ""
    threads = f", {found['threads']} threads" if found["threads"] else ""
    control = step_control_line(found)
    rows = [
        ("scene", f"{found['title'] or found['scene']}: {found['particle_count']:,} particles{springs}"),
        ("effects", ", ".join(found["effects"]) or "none: every particle moves on a straight line"),
        ("method", f"{found['integrator']}, dt {found['dt']:.6g}{' between samples' if control else ''}, {found['precision']}"),
        ("rewound", found.get("rewound", "")),
        ("device", f"{found['backend']}: {found['device']}{threads}"),
        ("plan", f"{found['plan']}: {found['plan_reason']}"),
        ("off", switch.line(found)),
        ("reached", f"t = {found['time']:.9g}{_time_unit(found)} in {found['steps']:,} steps{_rate(found)}"),
        *(("phase", line) for line in _phase_lines(found["phases"])),
        ("control", control),
        ("solver", _solver_line(found)),
        ("contact", contact_line(found)),
        ("errors", _errors(found)),
        ("valid", found.get("horizon", {}).get("sentence", "")),
        ("balance", _balance(found)),
        ("damping", _damping(found)),
        ("beside", _beside(found)),
        ("time", _times(found)),
        *network_lines(found),
        *mode_lines(found),
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


def _time_unit(found: Mapping[str, Any]) -> str:
    """The unit of the time, and the time in another unit where this is easier to read: ` s (19.3 d)`."""
    units = found.get("units")
    other = time_text(units, found["time"])
    return (f" {symbol(units['time'])}" if units else "") + (f" ({other})" if other else "")


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
    gains = f", {found['gaining_pieces']} pieces gained energy" if found["gaining_pieces"] else ""
    return f"{newton}{linear}; {found['cut_steps']} steps cut in pieces{gains}, {found['unsolved_steps']} not solved"


def _phase_lines(phases: Sequence[Mapping[str, Any]]) -> list[str]:
    """A line for each change; of many changes, such as those by a slider, the first, and the number of the other changes."""
    told = [_phase_line(phase) for phase in phases[:PHASES_TOLD]]
    left = len(phases) - len(told)
    return [*told, f"… and {left:,} more changes, the last at t = {phases[-1]['at']:.9g}"] if left else told


def _phase_line(phase: Mapping[str, Any]) -> str:
    effects = ", ".join(phase["effects"]) or "no effect"
    return f"from t = {phase['at']:.9g}: {', '.join(phase['changes'])} changed, then {effects}; energy {phase['work']:+.6g}"


def _errors(found: Mapping[str, Any]) -> str:
    if "relative_energy_error_max" not in found:
        return ""
    energy = f"energy {found['relative_energy_error_max']:.2g}"
    if not found["conserves_energy"]:
        energy += " (contacts or walls change it)" if "contacts" in found else " (a force does work here)"
        if "conserved_energy_error_max" in found:
            energy += f", {found['conserved_energy_error_max']:.2g} where none does"
    if not found["conserves_momentum"]:
        return f"{energy}; momentum is not conserved: external forces, walls or held particles change it"
    momentum = f"{energy}, momentum {found['momentum_error_max']:.2g}"
    turning = f"{momentum}, angular momentum {found['angular_momentum_error_max']:.2g}"
    if "merge_count" in found.get("contacts", {}):
        return f"{turning} (merged spheres do not spin)"
    return (
        turning if found["conserves_angular_momentum"] else f"{momentum}; angular momentum is not conserved in a periodic box"
    )


def _balance(found: Mapping[str, Any]) -> str:
    if "energy_balance_error_max" not in found:
        return ""
    return (
        f"dissipated {found['dissipated_energy']:.6g}, work {found['work']:.6g}, "
        f"closes to {found['energy_balance_error_max']:.2g} of the energy turned over"
    )


def _damping(found: Mapping[str, Any]) -> str:
    """The energy lost by the method itself: the price of its step, next to the time."""
    damping = found.get("numerical_damping")
    if damping is None:
        return ""
    if damping["per_time"] is None:
        return f"by the method itself not determinable: {damping['problem']}"
    word = "lost" if damping["energy_lost"] >= 0.0 else "gained"
    told = f"the method itself {word} {abs(damping['energy_lost']):.3g}, {abs(damping['per_time']):.3g} per unit time"
    if damping["per_oscillation"] is None:
        return f"{told}; per oscillation not determinable: {damping['problem']}"
    each, share = abs(damping["per_oscillation"]), abs(damping["share_per_oscillation"])
    return f"{told}, {each:.3g} or {share:.3g} of it per oscillation, {damping['oscillations']:.4g} of them"


def _beside(found: Mapping[str, Any]) -> str:
    """The right half of a film: its settings, and the final difference of the two halves."""
    right = found.get("beside")
    if right is None:
        return ""
    method = f"{right['integrator']}, dt {right['dt']:.6g}, {right['backend']} {right['precision']}"
    apart = "" if right["rms_distance"] is None else f"; at the end {right['rms_distance']:.3g} apart (rms)"
    return f"{', '.join(right['settings'])}: {method}{apart}"


def _times(found: Mapping[str, Any]) -> str:
    total = found["wall_seconds"]
    names = ("setup", "compile", "horizon", "step", "diagnostics", "beside", "capture", "encode")
    parts = [(name, found.get(f"{name}_seconds", 0.0)) for name in names]
    parts.append(("other", total - sum(seconds for _, seconds in parts)))
    told = ", ".join(f"{name} {seconds:.2f}" for name, seconds in parts if seconds >= 0.005)
    return f"{total:.2f} s" + (f": {told}" if told else "")
