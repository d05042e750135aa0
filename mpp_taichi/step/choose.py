"""Choose: the plan of a step, and its launcher.

This is the only file that reads how methods and contact solvers want to be launched.
"""

import importlib
from contextlib import AbstractContextManager, nullcontext

from mpp_taichi import component
from mpp_taichi.contacts._base import ContactSolver
from mpp_taichi.device.backends import Device
from mpp_taichi.device.fast_taichi.explicit_vectors import explicit_vectors
from mpp_taichi.device.fast_taichi.quick_compilation import quick_compilation
from mpp_taichi.device.fast_taichi.serial_loops import FEW, SerialLoops
from mpp_taichi.device.heavy_loops import CPU_GRAIN
from mpp_taichi.errors import BackendError, UnsupportedError
from mpp_taichi.forces._total_force import TotalForce
from mpp_taichi.integrators._base import Integrator
from mpp_taichi.state.state import State
from mpp_taichi.state.tangent_meter import TangentMeter
from mpp_taichi.step import plans
from mpp_taichi.step.finite_check import FiniteCheck
from mpp_taichi.step.force_sum import ForceSum, LaunchedForceSum, ParallelForceSum, SerialForceSum
from mpp_taichi.step.launcher import Launcher, Mode, StepParts


def settle_plan(
    asked: str,
    *,
    name: str,
    integrator: Integrator,
    total_force: TotalForce,
    device: Device,
    work: int,
    replica_count: int,
) -> str:
    """The plan of a step, from the requested plan; `name` is the integrator's name in the scene.

    Raises:
        UnsupportedError: the integrator does not run on this device.
        BackendError: the plan asked for does not fit.
    """
    if integrator.launchers.cpu_only and not device.on_cpu:
        raise UnsupportedError(f"{name} runs on the CPU only, not on {device.backend}; use --backend cpu")
    if integrator.launchers.copies_elsewhere and not device.on_cpu:
        if replica_count == 1:
            raise UnsupportedError(
                f"one copy with {name} runs on the CPU only, not on {device.backend}, which runs the copies of a sweep, "
                "a thread for each; use --backend cpu"
            )
        if not device.probes.float64:
            raise UnsupportedError(
                f"{name} computes its steps in f64, which this device ({device.name}) lacks; use --backend cpu"
            )
    plan = asked if asked != "auto" else plans.choose(work, on_cpu=device.on_cpu, replica_count=replica_count)
    if plan == "parallel" and not integrator.launchers.parallel:
        if asked == "parallel":
            raise BackendError(f"{name} has no parallel plan; there are serial and replicas")
        plan = "serial"
    if total_force.by_tree:  # it is built and walked by all threads together
        if asked == "serial" or replica_count > 1:
            raise BackendError(
                "newtonian_gravity with solver: tree has only the parallel plan, for one copy; use solver: direct"
            )
        plan = "parallel" if asked == "auto" else plan
    if replica_count > 1 and total_force.looks:
        what = "springs that break or yield have" if total_force.has_limits else "a force that reads all particles has"
        raise BackendError(f"{what} no plan replicas; run one copy of the scene")
    if total_force.by_lists:  # made and read by all threads together
        plan = "parallel"
    if plan not in plans.PLANS or (replica_count > 1) != (plan == "replicas"):
        raise BackendError(
            f"plan {asked!r} does not fit; there are auto, serial and parallel for one copy, replicas for several"
        )
    return plan


def launcher_for(
    state: State,
    total_force: TotalForce,
    integrator: Integrator,
    *,
    plan: str,
    on_cpu: bool,
    loop_limit: int | None = None,
    contacts: ContactSolver | None = None,
    tangent_meter: TangentMeter | None = None,
) -> Launcher:
    """The launcher of this kind of step; nothing is compiled before its first launch."""
    launched = sums_are_launched(total_force, plan, on_cpu)
    few = on_cpu and state.particle_count <= FEW
    grain = CPU_GRAIN if on_cpu else 1
    is_long = integrator.launchers.quickly or total_force.has_rods or integrator.follows_deviation
    quickly: Mode = quick_compilation if is_long else nullcontext
    in_vectors = plan != "parallel" and on_cpu and integrator.in_vectors(state, total_force)
    compiled: Mode = explicit_vectors if in_vectors else quickly
    stage_loops: AbstractContextManager = SerialLoops() if few and launched and not total_force.bonds else nullcontext()
    force_sum: ForceSum
    if plan != "parallel":
        force_sum = SerialForceSum(state, grain=grain, compiled=explicit_vectors if in_vectors else nullcontext)
    elif launched:
        force_sum = LaunchedForceSum(state, total_force, stage_loops)
    else:
        force_sum = ParallelForceSum(state, total_force)
    parts = StepParts(
        state=state,
        total_force=total_force,
        integrator=integrator,
        contacts=contacts,
        force_sum=force_sum,
        finite=FiniteCheck(state),
        compiled=compiled,
        quickly=quickly,
        loops=stage_loops if contacts is None else SerialLoops() if few else nullcontext(),
        grain=grain,
        shape="launched" if launched else plan,
        on_cpu=on_cpu,
        loop_limit=loop_limit,
        tangent_meter=tangent_meter,
    )
    name = _file_of(parts, plan)
    module = importlib.import_module(f"mpp_taichi.step.{name}")
    launcher: Launcher = getattr(module, component.class_name_of(name))(parts)
    return launcher


def sums_are_launched(total_force: TotalForce, plan: str, on_cpu: bool) -> bool:
    """Whether sums of forces are launches of their own (see LaunchedForceSum)."""
    return bool(plan == "parallel" and total_force.has_pairs and (on_cpu or total_force.sums_apart))


def _file_of(parts: StepParts, plan: str) -> str:
    """The file of this folder whose launcher runs these parts."""
    contacts, integrator, total_force = parts.contacts, parts.integrator, parts.total_force
    if contacts is not None:
        return contacts.launched_by
    if parts.tangent_meter is not None and not integrator.takes_tangent:
        return "tangent_steps"
    name: str = getattr(integrator.launchers, plan)
    if name != "parallel":
        return name
    if parts.shape == "launched" or integrator.looks_stages_up(total_force):
        return "parallel_staged"
    return "parallel_joined" if integrator.joins_steps(total_force) else "parallel_fused"
