"""The work of a step, from the scene alone and not from the clock, so that every machine finds the same number."""

from typing import Any

OVERHEAD = 50  # of an evaluation on the CPU beside its forces, in units of `step.plans`
LAUNCH_OVERHEAD = 100_000  # of a step whose loops are launches of their own
CONTACT_STEP, CONTACTS_OF_SPHERE = 10_000, 500  # of a step with contacts, and of each sphere in it
FLIGHT = 1000  # of a contact in event-driven flight, with the predictions that it asks for
SOLVER_SWEEPS = 30  # evaluations that an implicit step costs, roughly


def work_of_step(simulation: Any) -> float:
    """The work of one step in units of `step.plans`.

    Of a method that chooses its steps it is the work of an evaluation, of event-driven flight the work of a contact.
    """
    phase = simulation.phase
    if not simulation.launcher.takes_steps:
        return FLIGHT
    evaluations = phase.integrator.evaluations_per_step or 1
    counted = max(1, phase.integrator.typical_evaluations)  # included in the work of the phase
    work = phase.work / counted + OVERHEAD
    if "linear_solver" in phase.launcher.facts():
        evaluations = SOLVER_SWEEPS
    step = evaluations * work
    if phase.contacts is not None and phase.launcher.contacts_in_every_step:
        step += CONTACT_STEP + CONTACTS_OF_SPHERE * phase.state.particle_count
    if simulation.plan == "parallel" or not simulation.device.on_cpu:
        step += LAUNCH_OVERHEAD
    return float(step)
