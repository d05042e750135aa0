"""Moment: all that a run knows at one time, as plain values for an archive, and the way back to it in another process.

A moment is a dictionary. `phase` is the number of the phase; `clock` holds the origin of the time [time], its step, the steps
since then, and dt [time]. `fields` are positions, velocities, the memory of the method and of the contacts, and the moving
frame, as they are on the device; `prepared` says whether the forces and the history with which the next step begins are among
them; `contacts` is what a contact solver knows beyond them, such as the times and events of an event-driven run; `sums` are
its sums since the phase began, such as the virial. `accounts` are the counts of the solvers, the work of the phases, the
energy balance and the findings of the judge. A simulation is `Any` here, as its class imports this module.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from mpp_taichi.archive import object_state
from mpp_taichi.device import one_thread
from mpp_taichi.errors import StateError
from mpp_taichi.simulation.clock import MOST_STEPS_COUNTED, Reading
from mpp_taichi.simulation.compiled_phase import SavedFields
from mpp_taichi.simulation.in_turn import require_life
from mpp_taichi.simulation.saved_state import Mark


def moment_of(simulation: Any) -> dict[str, Any]:
    """The present moment of a simulation."""
    mark, runner = simulation.mark(), simulation._runner
    reading = mark.clock
    return {
        "phase": runner.number,
        "clock": [reading.origin_time, reading.origin_step, reading.steps, reading.dt],
        "fields": list(mark.fields.arrays),
        "prepared": mark.fields.prepared,
        "contacts": list(mark.fields.contacts),
        "sums": list(mark.fields.sums or ()),
        "accounts": object_state.captured({"accounts": runner.accounts.save(), "judge": simulation.judge}),
    }


def go_to(simulation: Any, moment: Mapping[str, Any]) -> None:
    """Take a simulation to a moment of a run of the same scene on the same backend and in the same precision, bit for bit.

    Raises:
        StateError: the moment is of another run.
    """
    require_life(simulation)
    with one_thread.lock:
        _go_to(simulation, moment)


def forget_history(simulation: Any) -> None:
    """Let the method begin anew from the present state, with steps of another length."""
    require_life(simulation)
    with one_thread.lock:
        simulation.phase.take_over(simulation.phase, simulation.dt, simulation.step_count)


def _go_to(simulation: Any, moment: Mapping[str, Any]) -> None:
    runner = simulation._runner
    try:
        number, reading = int(moment["phase"]), _reading(moment["clock"])
        if not runner.course.first <= number < len(runner.course.phases):
            raise StateError(f"the archive is of a run in its phase {number}, and this run has no such phase")
        again = number != runner.number
        if again:
            runner.enter(number)
        fields, contacts = tuple(moment["fields"]), tuple(moment["contacts"])
        sums = tuple(moment.get("sums", ()))  # older archives have none
        _require_same_forms(fields, runner.phase.save(whole=False).arrays)
        if contacts:
            _require_same_forms(contacts, () if runner.phase.contacts is None else runner.phase.contacts.save())
        if sums:
            _require_same_forms(sums, () if runner.phase.contacts is None else runner.phase.contacts.save_sums())
        accounts = runner.accounts.save()
        object_state.restore(moment["accounts"], {"accounts": accounts, "judge": simulation.judge})
        mark = Mark(SavedFields(fields, bool(moment["prepared"]), contacts, sums), reading)
        runner.go_to(number, mark, accounts, again=again)
        runner.phase.warm_up(runner.clock)
        runner.return_to(mark)
    except (KeyError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
        raise StateError(f"the archive is damaged: {error!r}") from error


def _reading(numbers: Sequence[Any]) -> Reading:
    """The clock of a moment; what is no time of a run would stop the kernels, and not with words."""
    origin_time, origin_step, steps, dt = numbers
    whole = all(type(each) is int and 0 <= each < 2**63 for each in (origin_step, steps)) and steps <= MOST_STEPS_COUNTED
    if not (whole and math.isfinite(origin_time) and 0.0 < dt < math.inf):
        raise ValueError(f"a clock of {list(numbers)}")
    return Reading(origin_time, origin_step, steps, dt)


def _require_same_forms(found: Sequence[Any], wanted: Sequence[Any]) -> None:
    if [(each.dtype, each.shape) for each in found] != [(each.dtype, each.shape) for each in wanted]:
        raise StateError("the archive has other fields than this run: it is of another scene, method or precision")
