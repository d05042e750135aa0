"""Costs: how long a step takes, and how much of that each effect takes, by leaving it out or adding it."""

import math
import statistics
import time as clock
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from mpp_taichi import component
from mpp_taichi.component import REQUIRED, Declaration, Parameter
from mpp_taichi.scene.asked_quantities import tangent_quantities, without_tangent
from mpp_taichi.scene.pair_forces import is_pair_force
from mpp_taichi.scene.periodic_forces import acts_across_faces
from mpp_taichi.scene.spec import ComponentSpec, Location, SceneSpec
from mpp_taichi.scene.tree_checks import tree_of

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation

ROUNDS = 11
SAMPLE_SECONDS = 0.02  # seconds: the least length of one timing, far above the resolution of the clock
LONG_SECONDS = 6.0  # seconds of all timings together; at least two rounds are made
ALMOST_NOTHING = 1e-30  # a strength without visible effect that is not zero, so that the compiler cannot remove the force


@dataclass(frozen=True)
class StepTime:
    """Seconds per step: the median of the rounds, and how far apart half of them lie (interquartile range)."""

    seconds: float
    spread: float


@dataclass(frozen=True)
class EffectCost:
    """The part of a step that an effect takes, in seconds, and two standard errors of this time."""

    name: str
    seconds: float
    noise: float


def measure(simulation: "Simulation") -> tuple[StepTime, list[EffectCost], list[EffectCost]]:
    """The step of a simulation as it is, the share of each of its effects, and the cost of every absent force.

    The variants are timed in turn, round after round, so that a machine that slows down slows all of them.
    """
    spec, asked = replace(simulation.spec, timeline=()), simulation.plan
    fewer, more = _without(spec), _with(spec)
    simulations = [simulation]
    try:
        for _, variant in (*fewer, *more):
            simulations.append(_start(variant, simulation, asked))
        times = _time_in_turn(simulations)
    finally:
        for started in simulations[1:]:
            started.close()
    full, others = times[0], times[1:]
    costs = [_cost(name, full, other) for (name, _), other in zip((*fewer, *more), others)]
    shares = [EffectCost(cost.name, -cost.seconds, cost.noise) for cost in costs[: len(fewer)]]
    return StepTime(statistics.median(full), _spread(full)), shares, costs[len(fewer) :]


def _cost(name: str, full: list[float], other: list[float]) -> EffectCost:
    """Median of the differences round by round.

    Two standard errors of a median are about 1.85 interquartile ranges / √rounds.
    """
    differences = [changed - plain for changed, plain in zip(other, full)]
    return EffectCost(name, statistics.median(differences), 1.85 * _spread(differences) / math.sqrt(len(differences)))


def _start(spec: SceneSpec, like: "Simulation", plan: str) -> "Simulation":
    from mpp_taichi.simulation.simulation import Simulation

    threads = like.device.threads or None
    return Simulation(spec, backend=like.device.backend, precision=like.device.precision, plan=plan, threads=threads)


def _without(spec: SceneSpec) -> list[tuple[str, SceneSpec]]:
    """The scene without one of its effects, for each effect."""
    variants = [
        (force.label, replace(spec, forces=spec.forces[:number] + spec.forces[number + 1 :]))
        for number, force in enumerate(spec.forces)
    ]
    rigid = [entry for _, entry in spec.rigid_entries]
    elastic = tuple(entry for entry in spec.springs if entry not in rigid)
    if elastic:
        others = tuple(force for force in spec.forces if force not in spec.bonds)  # for a bond needs springs
        name = " with ".join([component.marked("forces", "acts_on_springs")[0], *(force.label for force in spec.bonds)])
        variants.append((name, replace(spec, springs=tuple(rigid), forces=others)))
    if rigid:
        variants.append((rigid[0].name, replace(spec, springs=elastic)))
    if spec.contacts is not None and not _flies(spec):
        variants.append(("hard_spheres", replace(spec, contacts=None, walls=())))
    if tangent_quantities(spec):
        variants.append(("tangent", without_tangent(spec)))
    return variants


def _flies(spec: SceneSpec) -> bool:
    """Whether the contact solver moves the particles, so that no step is possible without it, and no force but gravity."""
    return bool(spec.integrator.flag("integrators", "flies"))


def _with(spec: SceneSpec) -> list[tuple[str, SceneSpec]]:
    """The scene with one more force, for each force that it does not name, except springs, which need two ends."""
    variants, has_tangent = [], bool(tangent_quantities(spec))
    for name in component.names("forces"):
        declared = component.declaration("forces", name)
        if declared.base == "BondForce" or any(force.name == name for force in spec.forces):
            continue
        # Formulas are without number, and a correction to gravity acts only beside a gravity that the scene may not have.
        if declared.flags.get("is_formula") or declared.flags.get("needs_gravity"):
            continue
        if _flies(spec) and not declared.flags.get("is_uniform"):
            continue
        if has_tangent and not declared.flags.get("takes_any_numbers"):
            continue
        if is_pair_force(name) and (tree_of(spec) is not None or acts_across_faces(spec)):  # which allow no other pair force
            continue
        parameters = _slight(declared)
        if parameters is not None:
            added = ComponentSpec(name, parameters, Location("explain", 0, 0))
            variants.append((name, replace(spec, forces=(*spec.forces, added))))
    return variants


def _slight(declared: Declaration) -> dict[str, Any] | None:
    """Parameters with which a force acts as weakly as possible; None where a parameter cannot be guessed."""
    found = {}
    for parameter in declared.parameters:
        value = _slight_value(parameter)
        if value is None and not parameter.optional:  # absent groups and names restrict nothing
            return None
        found[parameter.name] = value
    return found


def _slight_value(parameter: Parameter) -> Any:
    if parameter.default is not REQUIRED and parameter.default is not None:
        return parameter.default
    least = max(ALMOST_NOTHING, parameter.minimum or 0.0, 2.0 * (parameter.above or 0.0))
    return {"float": least, "Vector": (least, least, least)}.get(parameter.type)


def _time_in_turn(simulations: list["Simulation"]) -> list[list[float]]:
    """Seconds per step of each simulation, one number a round."""
    counts = [_steps_for(simulation) for simulation in simulations]
    round_seconds = sum(_time(simulation, count) * count for simulation, count in zip(simulations, counts))
    rounds = max(2, min(ROUNDS, int(LONG_SECONDS / round_seconds)))
    seen: list[list[float]] = [[] for _ in simulations]
    for _ in range(rounds):
        for values, simulation, count in zip(seen, simulations, counts):
            values.append(_time(simulation, count))
    return seen


def _spread(values: list[float]) -> float:
    if len(values) < 4:
        return max(values) - min(values)
    low, _, high = statistics.quantiles(values, n=4)
    return high - low


def _steps_for(simulation: "Simulation") -> int:
    """Steps that take `SAMPLE_SECONDS`; the first of them compiles."""
    _time(simulation, 1)
    steps, limit = 1, simulation.phase.launch_limit
    while steps < limit and (seconds := _time(simulation, steps) * steps) < SAMPLE_SECONDS:
        steps = min(limit, steps * max(2, min(16, int(SAMPLE_SECONDS / max(seconds, 1e-6)))))
    return steps


def _time(simulation: "Simulation", steps: int) -> float:
    """Seconds per step of `steps` steps from the start, without any sample of the state."""
    simulation.restart()
    simulation.launcher.prepare(0.0, simulation.dt)
    simulation.launcher.first_bad_particle()  # waits for the device
    began = clock.perf_counter()
    simulation.launcher.advance(0.0, simulation.dt, 0, steps)
    simulation.launcher.first_bad_particle()
    return (clock.perf_counter() - began) / steps
