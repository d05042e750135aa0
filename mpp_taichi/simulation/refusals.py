"""Refusals: the reasons why a phase cannot be compiled for a device, a plan or a precision, each an error of one line."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mpp_taichi import component
from mpp_taichi.contacts._base import ContactSolver
from mpp_taichi.device.backends import Device
from mpp_taichi.errors import BackendError, CapacityError, PrecisionError, SceneError, UnsupportedError
from mpp_taichi.precision import (
    FARTHEST_PAIR,
    FARTHEST_PAIR_IN_SINGLE,
    LARGEST_SINGLE,
    SMALLEST_IN_TWO_PARTS,
    SMALLEST_SINGLE,
    carries_low_parts,
    forces_have_low_parts,
    forces_see_low_parts,
    number_type,
)
from mpp_taichi.scene.asked_quantities import derivative_quantities, tangent_quantities
from mpp_taichi.scene.available_memory import available_bytes
from mpp_taichi.scene.estimate import LARGEST_COUNT
from mpp_taichi.scene.formulas.laws import is_formula
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.scene.tree_checks import tree_of
from mpp_taichi.scene.wall_motions import functions_of_motions
from mpp_taichi.simulation import first_bad_step
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.wording.told_apart import told_apart

NUMBERS_PER_ENTRY = {"scalar": 1, "wide": 1, "index": 0.5, "vector2": 2, "wide_vector2": 2, "vector4": 4, "vector8": 8}
"""Numbers of the size of an f64 in one entry of a work field, by the kind of the field."""

MOST_COPIES = 600  # of a system, one for each direction of its derivative


def check_contacts(spec: SceneSpec, solver: ContactSolver, count: int, *, device: Device, logs: bool) -> None:
    """Refuse a contact solver on a device, or a log of events, that it does not have.

    Raises:
        UnsupportedError: the solver runs on the CPU only, or elsewhere with fewer spheres only.
        SceneError: a log of events is asked for, and the solver keeps none.
        PrecisionError: a wall moves by a function that the device lacks in this precision.
    """
    assert spec.contacts is not None
    name = spec.contacts.solver.name
    if not device.on_cpu and solver.in_turn:
        raise UnsupportedError(
            f"the contact solver {name} runs on the CPU only, not on {device.backend}: {solver.in_turn}; use --backend cpu, "
            "or solver: pairwise"
        )
    if not device.on_cpu and solver.most_elsewhere is not None and count > solver.most_elsewhere:
        raise UnsupportedError(
            f"the contact solver {name} takes up to {solver.most_elsewhere} spheres on {device.backend}, and here are {count}: "
            "more of them run on the CPU only; use --backend cpu, or solver: pairwise"
        )
    for name in functions_of_motions(spec):
        check_functions(f"the motion of a wall calls {name}", device)
    if logs and not solver.can_log:
        raise SceneError(f"{spec.contacts.solver.location}: {name} keeps no log of events, allowed: event_driven, merging")


def check_rods(spec: SceneSpec, device: Device) -> None:
    """Refuse rigid rods on a device that is no CPU, where one thread would do the work of all.

    Raises:
        UnsupportedError: the device is no CPU.
    """
    if not device.on_cpu:
        raise UnsupportedError(f"{spec.rods_named} run on the CPU only, not on {device.backend}; use --backend cpu")


def check_sines(spec: SceneSpec, forces: Sequence[Any], device: Device) -> None:
    """Refuse forces with sines or exponentials under f64 on Vulkan, whose kernels have such functions in f32 only.

    Raises:
        PrecisionError: such a force is there.
    """
    for entry, force in zip(spec.forces, forces):
        if force.takes_sine or force.has_functions:
            what = f"calls {', '.join(force.has_functions)}" if force.has_functions else "takes a sine"
            check_functions(f"{entry.label} {what}", device)


def check_functions(what: str, device: Device) -> None:
    """Refuse, by a text that says `what` calls a sine or an exponential, Vulkan in f64, which has none.

    Raises:
        PrecisionError: the device is Vulkan in f64.
    """
    if device.backend == "vulkan" and device.precision == "f64":
        raise PrecisionError(f"{what}, which vulkan has only in f32; use --precision f32 or --backend cpu")


def _check_formulas(spec: SceneSpec, start: Snapshot, precision: str) -> None:
    """Refuse formulas of pairs whose steps leave the range of single precision where particles are at the start."""
    if any(is_formula(entry.name) for entry in spec.forces):
        from mpp_taichi.scene.formula_checks import beyond_single  # only where a formula stands in the scene

        for entry in spec.forces:
            if told := beyond_single(entry, start):
                cure = "choose units in which distances are near 1, or use --precision f64"
                raise PrecisionError(f"{entry.label}: in {precision} {told}; {cure}")


def check_low_parts(spec: SceneSpec, integrator: Any, forces: Sequence[Any], precision: str) -> None:
    """Refuse a precision with low parts where a method, a contact solver, a tree or a force does not carry them.

    Raises:
        PrecisionError: such a component is there.
    """
    refused = None if integrator.takes_low_parts else f"the method {spec.integrator.name}"
    if spec.rigid_entries:
        refused = f"the solver of {spec.rods_named}"
    if spec.limited_springs and forces_have_low_parts(precision):
        refused = "the search for springs that break or yield"
    if spec.contacts is not None:
        refused = f"the contact solver {spec.contacts.solver.name}"
    if tree_of(spec) is not None and forces_see_low_parts(precision):
        refused = "newtonian_gravity with solver: tree"
    if forces_have_low_parts(precision):
        names = [*(entry.label for entry in spec.forces), *["of springs"] * (len(forces) - len(spec.forces))]
        carries = [force.takes_any_numbers and force.takes_low_parts for force in forces]
        named = [name for name, carried in zip(names, carries, strict=True) if not carried]
        refused = f"the force {named[0]}" if named and refused is None else refused
    if refused:
        raise PrecisionError(f"{refused} does not carry low parts, so it cannot run in {precision}; use f64 or f32")


def check_tangent(spec: SceneSpec, integrator: Any, forces: Sequence[Any], precision: str, plan: str, copies: int) -> None:
    """Refuse the quantities that need the tangent of the step where a part of the step, or the plan, does not have it.

    Raises:
        UnsupportedError: such a part is there.
        BackendError: the parallel plan is asked for.
        CapacityError: a quantity needs more copies of the system than MOST_COPIES.
    """
    names = [*(entry.label for entry in spec.forces), *["of springs"] * (len(forces) - len(spec.forces))]
    reasons = [f"the force {name} does" for name, force in zip(names, forces, strict=True) if not force.takes_any_numbers]
    carries = spec.contacts is not None and component.flag("contacts", spec.contacts.solver.name, "takes_tangent")
    if not (integrator.takes_any_numbers or integrator.takes_tangent or carries):
        reasons.insert(0, f"the method {spec.integrator.name} does")
    if carries_low_parts(precision):
        reasons.insert(0, f"steps in {precision} do")
    if tree_of(spec) is not None:
        reasons.insert(0, "a tree does")
    if spec.rigid_entries:
        reasons.insert(0, f"{spec.rods_named} do")
    if spec.limited_springs:
        reasons.insert(0, "springs that break or yield do")
    if spec.timeline:
        reasons.insert(0, "a timeline does")
    if spec.thermal_walls:
        reasons.insert(0, "walls with a temperature do")
    if spec.contacts is not None and not carries:
        reasons.insert(0, f"collisions of {spec.contacts.solver.name} do")
    wanted = " and ".join(tangent_quantities(spec))
    if reasons:
        raise UnsupportedError(f"{wanted} needs the derivative of every step, which {reasons[0]} not have")
    whole = " and ".join(derivative_quantities(spec))
    if copies > 1 and spec.contacts is not None:
        raise UnsupportedError(f"{whole} needs the derivative along all directions, which collisions do not have")
    if copies > MOST_COPIES:
        raise CapacityError(
            f"{whole} follows a copy of the system for each free component of a position or velocity; here are "
            f"{copies - 1:,}, allowed: {MOST_COPIES}"
        )
    if plan == "parallel":
        raise BackendError(f"{wanted} has no parallel plan; there are serial and replicas")


def check_range(start: Snapshot, total_force: Any, precision: str) -> None:
    """Refuse double-single forces of numbers whose low parts are too small for an f32 (see two_part_pairs.py).

    Raises:
        PrecisionError: particles that act on each other are too far apart, or a mass or a charge is too small.
    """
    if not forces_have_low_parts(precision):
        return
    extent = float(np.linalg.norm(np.ptp(start.position, axis=0))) if total_force.has_pairs else 0.0
    if extent > FARTHEST_PAIR:
        most, here = told_apart(FARTHEST_PAIR, extent, digits=3)
        raise PrecisionError(
            f"{precision} computes forces between particles up to {most} lengths apart, and here they are "
            f"{here} apart; choose a larger unit of length, or use f64 or ds"
        )
    for name, values in (("mass", start.mass), ("charge", start.charge)):
        sizes = np.abs(values[values != 0.0])
        if name in total_force.needs and len(sizes) and sizes.min() < SMALLEST_IN_TWO_PARTS:
            least, here = told_apart(SMALLEST_IN_TWO_PARTS, sizes.min(), digits=3)
            raise PrecisionError(
                f"{precision} keeps the digits of numbers from {least} on, and here is a {name} of "
                f"{here}; choose a smaller unit of {name}, or use f64 or ds"
            )


def check_numbers(spec: SceneSpec, start: Snapshot, total_force: Any, precision: str) -> None:
    """Refuse numbers that single precision does not have: they would become 0 or infinite, and a body massless.

    Raises:
        PrecisionError: a number is too large or too small, or particles that act on each other are too far apart.
    """
    if number_type(precision) == "f64":
        return
    _check_formulas(spec, start, precision)
    used = [name for name in ("mass", "charge", "radius") if name in total_force.needs]
    for name in ("position", "velocity", *used):
        values = getattr(start, name)
        size = np.abs(values).reshape(start.particle_count, -1).max(axis=1)
        lost = (size < SMALLEST_SINGLE) & (size > 0.0) & (name in used)
        wrong = np.flatnonzero(lost | (size > LARGEST_SINGLE))
        if len(wrong):
            here, least, most = told_apart(size[wrong[0]], SMALLEST_SINGLE, LARGEST_SINGLE, digits=3)
            raise PrecisionError(
                f"{first_bad_step.label(start, int(wrong[0]))} has a {name} of {here}, and {precision} has "
                f"numbers from {least} to {most}; choose another unit, or use f64"
            )
    extent = float(np.linalg.norm(np.ptp(start.position, axis=0))) if total_force.has_pairs else 0.0
    if extent > FARTHEST_PAIR_IN_SINGLE:
        most, here = told_apart(FARTHEST_PAIR_IN_SINGLE, extent, digits=3)
        raise PrecisionError(
            f"{precision} computes forces between particles up to {most} lengths apart, and here they "
            f"are {here} apart; choose a larger unit of length, or use f64"
        )


def check_room(fields: Mapping[str, tuple[str, int]], *, dimensions: int, replica_count: int, on_cpu: bool) -> None:
    """Refuse work fields that have more numbers than an index can count, or need more memory than is left.

    Only the band of `solver: direct` grows faster than the scene: n w numbers for n unknowns of half-bandwidth w. Every number
    is counted as an f64.

    Raises:
        CapacityError: the fields are too large.
    """
    numbers = {**NUMBERS_PER_ENTRY, "vector": dimensions, "lattice": dimensions, "matrix": dimensions**2}
    needed = {name: count * replica_count * numbers[kind] for name, (kind, count) in fields.items()}
    largest = max(needed, key=lambda name: needed[name], default="")
    hint = "; solver: conjugate_gradients needs none of it" if largest == "band" else ""
    if largest and needed[largest] > LARGEST_COUNT:
        raise CapacityError(f"the work field {largest} has {needed[largest]:,.0f} numbers, allowed: {LARGEST_COUNT:,}{hint}")
    free, total = available_bytes(), 8 * sum(needed.values())
    if on_cpu and free is not None and total > free:
        needs, has = told_apart(total / 2**30, free / 2**30, digits=3)
        raise CapacityError(
            f"the integrator's work fields need {needs} GiB, most of it for {largest}; "
            f"{has} GiB are available to this process{hint}"
        )


def steps_per_launch(launcher: Any, total_force: Any, device: Device, plan: str) -> int:
    """Most steps that one launch may hold: software Vulkan stops the loops of a thread and says nothing.

    Raises:
        CapacityError: it may not hold one step.
    """
    limit = device.probes.loop_limit
    if limit is None:
        return 2**31 - 1
    in_one_launch = plan != "parallel"
    longest = launcher.loop_iterations_per_step() if in_one_launch else total_force.longest_loop
    if longest > limit:
        raise CapacityError(
            f"this device ({device.name}) stops a kernel thread after {limit:,} loop iterations, and one step of "
            f"{launcher.state.particle_count:,} particles under the {plan} plan needs {longest:,}; "
            "use --backend cpu or another plan"
        )
    return limit // longest if in_one_launch else 2**31 - 1
