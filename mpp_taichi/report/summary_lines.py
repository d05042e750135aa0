"""Lines of a summary, for a person: verdict, files, promises, errors and time; with `-v` also the method, device and rates."""

from collections.abc import Mapping, Sequence
from typing import Any

from mpp_taichi import component
from mpp_taichi.device.fast_taichi import switch
from mpp_taichi.modes.network_report import mode_lines, network_lines
from mpp_taichi.report.adaptive_summary import step_control_line
from mpp_taichi.report.contact_summary import contact_line
from mpp_taichi.report.spring_limits import spring_limit_line
from mpp_taichi.scene.human_units import symbol, time_text

PHASES_TOLD = 8


def lines(
    found: Mapping[str, Any],
    *,
    files: Sequence[str] = (),
    verdicts: Sequence[Any] = (),
    error: Exception | None = None,
    verbose: bool = False,
) -> list[str]:
    """The summary, in the order in which a person reads; `verbose` adds how the run was computed, and how fast."""
    springs = f", {found['spring_count']:,} springs" if found["spring_count"] else ""
    springs += f", {found['rod_count']:,} rods" if found.get("rod_count") else ""
    rows = [
        ("status", found["status"]),
        *(("because", reason) for reason in _reasons(found, verdicts, error)),
        *(("wrote", file) for file in files),
        *(("expect", verdict_line(verdict)) for verdict in verdicts),
        ("scene", f"{found['title'] or found['scene']}: {found['particle_count']:,} particles{springs}"),
        ("reached", f"t = {found['time']:.9g}{_time_unit(found)} in {found['steps']:,} steps"),
        ("rewound", found.get("rewound", "")),
        ("off", switch.line(found)),
        ("errors", _errors(found)),
        ("valid", found.get("horizon", {}).get("sentence", "")),
        ("contact", contact_line(found)),
        ("springs", spring_limit_line(found)),
        ("balance", _balance(found)),
        ("damping", _damping(found)),
        ("beside", _beside(found)),
        *mode_lines(found),
        ("time", _time(found)),
        *(_details(found) if verbose else ()),
    ]
    return [f"  {name:8s}{text}" for name, text in rows if text]


def _details(found: Mapping[str, Any]) -> list[tuple[str, str]]:
    """How the run was computed, and how fast."""
    threads = f", {found['threads']} threads" if found["threads"] else ""
    control = step_control_line(found)
    return [
        ("effects", ", ".join(found["effects"]) or "none: every particle moves on a straight line"),
        ("method", f"{found['integrator']}, dt {found['dt']:.6g}{' between samples' if control else ''}, {found['precision']}"),
        *(("phase", line) for line in _phase_lines(found["phases"])),
        ("control", control),
        ("solver", _solver_line(found)),
        *network_lines(found),
        ("device", f"{found['backend']}: {found['device']}{threads}"),
        ("plan", f"{found['plan']}: {found['plan_reason']}"),
        ("rate", _rate(found)),
        ("seconds", _seconds(found)),
    ]


def _reasons(found: Mapping[str, Any], verdicts: Sequence[Any], error: Exception | None) -> list[str]:
    """The reasons for a status other than `ok`, one line for each."""
    failed = sum(not verdict.passed for verdict in verdicts)
    told = [" ".join(str(error).split())] if error is not None else []
    told += [f"{failed} of {len(verdicts)} expectations not met"] if failed else []
    return told + [finding["message"] for finding in found.get("findings", ())]


def verdict_line(verdict: Any) -> str:
    """`pass  relative_energy_error_max = 2.1e-09, expected < 1e-06`."""
    reason = f" ({verdict.reason})" if verdict.reason else ""
    mark, name = "pass" if verdict.passed else "FAIL", verdict.named or verdict.label
    return f"{mark}  {name} = {verdict.told}, expected {verdict.bound}{reason}"


def _time_unit(found: Mapping[str, Any]) -> str:
    """The unit of the time, and the time in another unit where this is easier to read: ` s (19.3 d)`."""
    units = found.get("units")
    other = time_text(units, found["time"])
    return (f" {symbol(units['time'])}" if units else "") + (f" ({other})" if other else "")


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
        energy += f" ({_reason(found)})"
        if "conserved_energy_error_max" in found:
            energy += f", {found['conserved_energy_error_max']:.2g} where none does"
    if not found["conserves_momentum"]:
        # A held axis or a wall need not act: the change is told as well, so that it can be compared with a promise.
        changed = found["momentum_error_max"]
        causes = ["a bath of heat"] if "heat_bath" in found else []
        causes += ["terms of 1/c²"] if _is_relativistic(found) else []
        told = ", ".join([*causes, "external forces", "walls or held particles"])
        return f"{energy}; momentum changes by {changed:.2g}, as {told} may change it"
    momentum = f"{energy}, momentum {found['momentum_error_max']:.2g}"
    turning = f"{momentum}, angular momentum {found['angular_momentum_error_max']:.2g}"
    if "merge_count" in found.get("contacts", {}):
        return f"{turning} (merged spheres do not spin)"
    return (
        turning if found["conserves_angular_momentum"] else f"{momentum}; angular momentum is not conserved in a periodic box"
    )


def _is_relativistic(found: Mapping[str, Any]) -> bool:
    """Whether the sum of m v, which is measured, is the momentum without the terms of general relativity."""
    forces = component.names("forces")
    return any(name in forces and component.flag("forces", name, "needs_gravity") for name in found.get("effects", ()))


def _reason(found: Mapping[str, Any]) -> str:
    """Why the energy is not conserved."""
    if "heat_bath" in found:
        return "a bath of heat changes it"
    if "contacts" in found:
        return "contacts or walls change it"
    if "driven_bodies" in found:
        return "work is done on bodies on paths"
    if "changing_bodies" in found:
        return "masses or charges change with the time"
    broken = found.get("spring_limits", {"lost_energy": 0.0})["lost_energy"] != 0.0
    return "springs broke or yielded" if broken else "a force does work here"


def _balance(found: Mapping[str, Any]) -> str:
    if "energy_balance_error_max" not in found:
        return ""
    heat = f"heat {found['heat']:.6g}, " if "heat" in found else ""
    return (
        f"dissipated {found['dissipated_energy']:.6g}, work {found['work']:.6g}, {heat}"
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


def _time(found: Mapping[str, Any]) -> str:
    """The seconds of the whole run, and its rate with everything that the run did beside its steps."""
    overall = found["steps_per_second_overall"]
    told = f", {_count(overall)} steps/s with samples, pictures and files" if overall is not None else ""
    return f"{found['wall_seconds']:.2f} s{told}"


def _rate(found: Mapping[str, Any]) -> str:
    """The rate of the steps by themselves."""
    if found["steps_per_second"] is None:
        return ""
    pairs = found["pair_interactions_per_second"]
    more = f", {pairs:.3g} pair interactions/s" if pairs else ""
    return f"{_count(found['steps_per_second'])} steps/s{more}, in the steps alone"


def _count(rate: float) -> str:
    return f"{rate:,.0f}" if rate >= 100.0 else f"{rate:.3g}"


def _seconds(found: Mapping[str, Any]) -> str:
    """The parts of the time of the run."""
    names = ("setup", "compile", "horizon", "step", "diagnostics", "beside", "capture", "encode")
    parts = [(name, found.get(f"{name}_seconds", 0.0)) for name in names]
    parts.append(("other", found["wall_seconds"] - sum(seconds for _, seconds in parts)))
    return ", ".join(f"{name} {seconds:.2f}" for name, seconds in parts if seconds >= 0.005)
