"""Explain a scene: the kernels that are compiled, the memory that is allocated, and the cost of each effect.

The share of an effect is measured: the step is timed with it and without it, in turn, and the medians are compared. The cost
of an effect that the scene does not have is measured by adding it with next to no strength.
"""

import argparse
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from mpp_taichi.cli import _options
from mpp_taichi.cli._terminal import output_reserved, put, put_json, say

if TYPE_CHECKING:
    from mpp_taichi.cli._costs import EffectCost, StepTime
    from mpp_taichi.simulation.simulation import Simulation


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    _options.add_scene(parser)
    _options.add_device(parser)
    _options.add_report(parser)


def execute(arguments: argparse.Namespace) -> int:
    """Measure, and print."""
    from mpp_taichi.scene.load import load_scene

    spec = load_scene(arguments.scene, overrides=arguments.overrides)
    from mpp_taichi.cli._choose_method import settled
    from mpp_taichi.cli._costs import measure
    from mpp_taichi.cli._phases import described
    from mpp_taichi.simulation.simulation import Simulation

    with output_reserved(arguments.json):
        spec, arguments.precision, _ = settled(spec, arguments)
        if not arguments.quiet:
            say(f"compiling and timing variants of {spec.source}")
        simulation = Simulation(
            spec, backend=arguments.backend, precision=arguments.precision, plan=arguments.plan, threads=arguments.threads
        )
        with simulation:
            step, shares, prices = measure(simulation)
            found = _facts(simulation, arguments.plan) | _timings(step, shares, prices) | {"timeline": described(spec)}
    if arguments.json:
        put_json(found)
    else:
        put("\n".join(_lines(found)))
    return 0


def _facts(simulation: "Simulation", plan_asked: str) -> dict[str, Any]:
    from mpp_taichi.cli._explained_walls import walls_told
    from mpp_taichi.device.memory_limit import most_resident_bytes
    from mpp_taichi.modes.network_report import network_facts
    from mpp_taichi.report.summary import effect_names, plan_reason
    from mpp_taichi.step import plans

    fields, advice = simulation.state.field_sizes(), simulation.step_advice
    return {
        "scene": simulation.spec.source,
        "backend": simulation.device.backend,
        "device": simulation.device.name,
        "precision": simulation.device.precision,
        "particle_count": simulation.state.particle_count,
        "spring_count": len(simulation.start.springs),
        "rod_count": len(simulation.start.rods),
        "effects": effect_names(simulation),
        "integrator": simulation.spec.integrator.name,
        "contacts": None if simulation.spec.contacts is None else simulation.spec.contacts.solver.name,
        "walls": walls_told(simulation.spec),
        "force_evaluations_per_step": simulation.integrator.evaluations_per_step,
        "plan": simulation.plan,
        "plan_reason": plan_reason(simulation, plan_asked),
        "work_per_step": simulation.phase.work,
        "crossover_work": plans.CROSSOVER_WORK,
        "launches_per_step": simulation.launcher.launches_per_step(),
        "fields": fields,
        "field_bytes": sum(fields.values()),
        "bytes_per_particle": sum(fields.values()) / simulation.state.particle_count,
        "process_bytes": most_resident_bytes(),
        "dt": simulation.dt,
        **(advice.facts() if advice is not None else {"dt_limit": None}),
        "dt_said": advice.line() if advice is not None else "nothing in this scene limits it",
        "conserves_energy": simulation.phase.conserves_energy,
        **network_facts(
            simulation.spec,
            simulation.start,
            simulation.integrator.amplification,
            simulation.dt,
            highest=advice.network.frequency if advice is not None else None,
        ),
    }


def _timings(step: "StepTime", shares: "list[EffectCost]", prices: "list[EffectCost]") -> dict[str, Any]:
    def rows(costs: "list[EffectCost]") -> list[dict[str, Any]]:
        return [
            {
                "effect": cost.name,
                "seconds": cost.seconds,
                "share": cost.seconds / step.seconds,
                "noise": cost.noise / step.seconds,
            }
            for cost in costs
        ]

    return {"seconds_per_step": step.seconds, "spread": step.spread, "shares": rows(shares), "absent": rows(prices)}


def _column(names: Iterable[str]) -> int:
    """Characters of a column of names."""
    return max([20, *(len(name) + 2 for name in names)])


def _lines(found: dict[str, Any]) -> list[str]:
    from mpp_taichi.cli._phases import phase_line
    from mpp_taichi.modes.network_report import MOST_FREEDOMS, network_lines, note

    launches = found["launches_per_step"]
    how_often = f"{launches} parallel loops launched per step" if launches else "one launch holds many steps"
    if launches is None:
        how_often = "as many launches as the contacts take" if found["contacts"] else "several parallel loops per iteration"
    evaluations = f"{found['force_evaluations_per_step']} force evaluations per step"
    if found["force_evaluations_per_step"] is None:
        evaluations = "as many force evaluations as each step needs"
    fields = _column(found["fields"])
    effects = _column(row["effect"] for row in (*found["shares"], *found["absent"]))
    rows = [
        f"{found['scene']}: {found['particle_count']:,} particles, {found['spring_count']:,} springs"
        + (f", {found['rod_count']:,} rods" if found["rod_count"] else ""),
        f"compiled   {', '.join(found['effects']) or 'no effect'}; {found['integrator']}, {evaluations}",
        *([f"contacts   {found['contacts']}; its own fields are not listed below"] if found["contacts"] else []),
        *(f"{'walls' if not n else '':11s}{told}" for n, told in enumerate(found["walls"])),
        f"device     {found['backend']}: {found['device']}, {found['precision']}",
        f"plan       {found['plan']}: {found['plan_reason']}; {how_often}",
        f"memory     {_bytes(found['field_bytes'])} in fields, {_memory(found)}",
        *(f"           {name:{fields}s}{_bytes(size)}" for name, size in found["fields"].items()),
        f"step       {_seconds(found['seconds_per_step'])} (half of the timings within {_seconds(found['spread'])})",
        *(f"           {row['effect']:{effects}s}{_share(row, ' of it')}" for row in found["shares"]),
        "absent     what each would add to a step",
        *(f"           {row['effect']:{effects}s}{_share(row)}" for row in found["absent"]),
        *(f"{'timeline' if not n else '':11s}{phase_line(phase)}" for n, phase in enumerate(found["timeline"])),
        f"dt         {found['dt']:.6g}; {found['dt_said']}",
        *(f"{head:10s} {text}" for head, text in network_lines(found)),
        *([f"           {said}"] if (said := note(found)) else []),
        *([f"springs    modes are counted for up to {MOST_FREEDOMS:,} freedoms"] if _is_too_large(found) else []),
    ]
    return rows


def _is_too_large(found: dict[str, Any]) -> bool:
    return bool(found["spring_count"]) and "zero_frequency_modes" not in found


def _share(row: dict[str, Any], of_what: str = "") -> str:
    """The share of an effect; a negative share is noise, even where its error is small."""
    if row["share"] <= row["noise"]:
        return f"not measurable (timings differ by {100 * row['noise']:.0f} %)"
    return f"{100 * row['share']:.0f} % ± {100 * row['noise']:.0f} %, {_seconds(row['seconds'])}{of_what}"


def _seconds(value: float) -> str:
    for size, unit in ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs")):
        if abs(value) >= size:
            return f"{value / size:.3g} {unit}"
    return f"{value * 1e9:.3g} ns"


def _memory(found: dict[str, Any]) -> str:
    """The memory of a particle in fields, and of the whole process, in which contact solvers and trees have theirs."""
    most = "" if found["process_bytes"] is None else f"; the process has had {_bytes(found['process_bytes'])} at most"
    return f"{found['bytes_per_particle']:,.0f} B a particle{most}"


def _bytes(count: int) -> str:
    if count < 10_000:
        return f"{count:,} B"
    return f"{count / 2**10:,.1f} KiB" if count < 10_000_000 else f"{count / 2**20:,.1f} MiB"
