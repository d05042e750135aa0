"""Sweep store: the sweep that a command line asks for, as its folder holds it, or a new one."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpp_taichi.cli import _options
from mpp_taichi.cli._sweep_options import block_of
from mpp_taichi.cli._terminal import UsageError

if TYPE_CHECKING:
    from mpp_taichi.sweep.cost import Cost
    from mpp_taichi.sweep.plan import Plan
    from mpp_taichi.sweep.store import SweepStore


def asked_for(arguments: argparse.Namespace) -> "tuple[SweepStore, Cost]":
    """The sweep that is asked for, as its folder holds it, or a new one."""
    from mpp_taichi.cli._refusals import require_room
    from mpp_taichi.errors import StateError
    from mpp_taichi.scene.load import load_resolved
    from mpp_taichi.start.assemble import assemble
    from mpp_taichi.sweep.cost import compiled_share, cost_of
    from mpp_taichi.sweep.plan import Plan
    from mpp_taichi.sweep.store import SUFFIX, SweepStore, opened
    from mpp_taichi.sweep.structure import why_alone

    resolved, source = _resolved(arguments)
    spec = load_resolved(resolved, source)
    if spec.sweep is None:
        raise UsageError(
            f"sweep: {source} has no block sweep:; --vary PATH=A:B:N says which key varies, --measure QUANTITY what is measured"
        )
    if spec.run.duration is None and spec.run.steps is None:
        raise UsageError(f"sweep: {source} has no run.duration; --until T or --steps N says how long a member runs")
    plan = Plan(spec.sweep)
    check_paths(resolved, source, plan)
    require_room(spec)
    start = assemble(spec)
    compiled = compiled_share(resolved, source, plan, start.particle_count) if why_alone(spec) else 0.0
    cost = cost_of(spec, plan.count, start, compiled)
    precision = arguments.precision or ("f64" if arguments.backend == "cpu" else "f32")
    folder = arguments.out or _options.OUTPUT_FOLDER / f"{Path(source).stem}{SUFFIX}"
    store = SweepStore(
        folder, resolved, source, {"backend": arguments.backend, "precision": precision}, arguments.chunk or cost.chunk
    )
    if not arguments.fresh and not arguments.dry_run and arguments.slurm is None:
        try:
            before = opened(folder)
        except StateError:
            before = None
        if before is not None and before.known == store.known and before.plan.count == store.plan.count and not arguments.chunk:
            store = SweepStore(folder, resolved, source, store.device, before.chunk)
    return store, cost


def _resolved(arguments: argparse.Namespace) -> tuple[dict[str, Any], str]:
    """The scene as plain data with everything that the command line says, and its file."""
    from mpp_taichi.scene.load import load_scene

    interval = None if arguments.until is None else arguments.until / 200
    spec = load_scene(arguments.scene, overrides=arguments.overrides, interval=interval)
    resolved = dict(spec.resolved)
    block = block_of(arguments, resolved.get("sweep"))
    if block is not None:
        resolved["sweep"] = block
    if arguments.until is not None:
        resolved["run"] = {**(resolved.get("run") or {}), "duration": arguments.until}
        resolved["run"].pop("steps", None)
    elif arguments.steps is not None:
        resolved["run"] = {**(resolved.get("run") or {}), "steps": arguments.steps}
        resolved["run"].pop("duration", None)
    return resolved, spec.source


def check_paths(resolved: dict[str, Any], source: str, plan: "Plan") -> None:
    """Refuse a path that the scene does not have, before members are refused one by one.

    Raises:
        SceneError: no member at an end of the ranges can be made, and why the first of them cannot.
    """
    from mpp_taichi.errors import SceneError
    from mpp_taichi.sweep.member import scene_of

    first: SceneError | None = None
    for number in dict.fromkeys((0, plan.count // 2, plan.count - 1)):
        try:
            scene_of(resolved, source, plan.values([number])[0])
            return
        except SceneError as error:
            first = first or error
    if first is not None:
        raise first
