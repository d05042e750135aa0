"""A dry run: the facts of a run that are known without starting a device."""

import argparse
from typing import Any

from mpp_taichi.cli import _options
from mpp_taichi.cli._amounts import check_amounts
from mpp_taichi.cli._goal import Goal
from mpp_taichi.cli._phases import described, phase_line
from mpp_taichi.cli._request import Request
from mpp_taichi.cli._terminal import explain_error, output_reserved, put, put_json
from mpp_taichi.errors import StabilityError
from mpp_taichi.scene.estimate import Estimate, check_capacity, estimate
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.step import plans


def dry_run(spec: SceneSpec, arguments: argparse.Namespace) -> int:
    """Print the facts known before the run; the exit code is 0 for a scene that can be run, 4 where its step is unstable.

    Raises:
        CapacityError: the scene is too large to be run.
    """
    needed = estimate(spec)
    names = ("until", "steps", "video", "html", "trajectory", "every")
    request = Request(**{name: getattr(arguments, name) for name in names})
    goal = Goal.of(spec, request.until, request.steps)
    dt = float(spec.integrator.parameters["dt"])
    found = {
        "scene": spec.source,
        "title": spec.title,
        "dimensions": spec.dimensions,
        "effects": spec.effects(needed.spring_count),
        "integrator": spec.integrator.name,
        "dt": dt,
        "timeline": described(spec),
        "particle_count": needed.particle_count,
        "spring_count": needed.spring_count,
        "pair_interactions_per_evaluation": needed.pair_interactions_per_evaluation,
        "steps": goal.step_count(spec),
        "time": None if goal.endless else goal.span(spec),
        "bytes": needed.bytes,
        "backend": arguments.backend,
        "precision": arguments.precision or "f64 on the CPU, f32 elsewhere",
        "plan": _plan(spec, arguments.plan, needed),
        "expect": [expectation.quantity for expectation in spec.expect],
        "files": _files(spec, arguments),
        "resolved": spec.resolved,
        "status": "ok",
        "exit_code": 0,
    }
    check_capacity(needed)
    check_amounts(spec, request, goal)
    refused = _check_step(spec, arguments, goal, found)
    if refused is not None:
        found |= {"status": "failed", "error": str(refused), "exit_code": refused.exit_code}
    if arguments.json:
        put_json(found)
    else:
        hidden = ("resolved", "status", "exit_code", "error")
        found["timeline"] = [phase_line(phase) for phase in described(spec)]
        put("\n".join(_line(name, value) for name, value in found.items() if name not in hidden))
    if refused is not None:
        explain_error(refused)
        return refused.exit_code
    return 0


def _check_step(spec: SceneSpec, arguments: argparse.Namespace, goal: Goal, found: dict[str, Any]) -> StabilityError | None:
    """Add the limit of the first step, and return the error with which a run would be refused in any of its phases.

    The particles are placed, and Taichi is imported without starting a device, only for a scene with springs or drag: the
    stability of an integrator is written in its own file, beside its step.
    """
    scenes = (spec, *(event.scene for event in spec.timeline))
    if not any(scene.springs or scene.forces_with("is_linear_drag") for scene in scenes):
        return None
    from mpp_taichi.cli._step_check import advice_of, spans, steps_in
    from mpp_taichi.device.backends import import_taichi
    from mpp_taichi.simulation.course import phases_of

    with output_reserved(arguments.json):
        import_taichi()
        reached = [(advice_of(phase), span) for phase, span in spans(phases_of(spec), goal)]
    for number, (advice, span) in enumerate(reached):
        if advice is None:
            continue
        if number == 0:
            found |= advice.facts()
        try:
            advice.enforce(steps=steps_in(span, advice.dt), force=arguments.force)
        except StabilityError as error:
            return error
    return None


def _line(name: str, value: object) -> str:
    if isinstance(value, list):
        value = ", ".join(map(str, value)) or "none"
    return f"  {name.replace('_', ' '):34s}{'not said' if value is None else value}"


def _plan(spec: SceneSpec, asked: str, needed: Estimate) -> str:
    if asked != "auto":
        return asked
    work = plans.step_work(spec, needed.particle_count, needed.spring_count)
    return f"{plans.choose(work, on_cpu=True, replica_count=1)} on a CPU, parallel on a GPU"


def _files(spec: SceneSpec, arguments: argparse.Namespace) -> list[str]:
    """The files that the run will write; without a display a film is among them."""
    names = ("video", "html", "trajectory", "snapshot", "diagnostics", "modes", "speeds", "events")
    files = [str(getattr(arguments, name)) for name in names if getattr(arguments, name) is not None]
    if not arguments.headless and arguments.video is None and arguments.html is None:
        files.append(f"{_options.OUTPUT_FOLDER / _options.output_stem(spec.source)}.mp4, unless a window opens")
    return files
