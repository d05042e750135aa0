"""Runs that are cut off at a step and go on in a new simulation, for every method, contact solver and recorder."""

import random
from dataclasses import dataclass
from itertools import zip_longest

import numpy as np

from mpp_taichi import component
from mpp_taichi.archive import object_state
from mpp_taichi.archive.values import pack, unpack
from mpp_taichi.precision import PRECISIONS, carries_low_parts
from mpp_taichi.recorders.blow_up import BlowUpWatch
from mpp_taichi.recorders.event_log import EventLogRecorder
from mpp_taichi.recorders.inspection import InspectionRecorder
from mpp_taichi.recorders.inspector import Inspector
from mpp_taichi.recorders.modes import ModeRecorder
from mpp_taichi.recorders.speed_histogram import SpeedHistogram
from mpp_taichi.recorders.table import TableRecorder
from mpp_taichi.recorders.watchdog import EnergyWatchdog
from mpp_taichi.report.expectations import Watcher
from mpp_taichi.simulation.moment import go_to, moment_of
from mpp_taichi.simulation.simulation import Simulation
from scenes import REQUIRED

STEPS = 60
PLANS = ("serial", "parallel")


def orbits(integrator):
    """A planet and a moon around a heavy body, at an odd place of space; springs where the method is for springs."""
    bodies = [(1.0, [0.3, 0.1, 0.0], [0, 0, 0]), (1e-3, [1.3, 0.1, 0.1], [0, 0.9, 0]), (1e-4, [-1.7, 0.2, 0.0], [0, -0.7, 0.1])]
    scene = {
        "title": "Orbits",
        "particles": [{"body": {"mass": m, "position": x, "velocity": v}} for m, x, v in bodies],
        "forces": [{"newtonian_gravity": {"strength": 1}}],
        "integrator": {integrator: {"dt": 0.01} | REQUIRED.get(integrator, {})},
        "run": {"duration": 1},
    }
    if component.flag("integrators", integrator, "implicit"):
        scene["springs"] = [{"link": {"between": [1, 2], "stiffness": 2, "damping": 0.01}}]
    return scene


def gas(solver, integrator=None, *, forced=False):
    """Disks that fall onto each other between walls; `forced`: with a force, where the solver can have one."""
    places = [[1.1 + 1.7 * column + 0.13 * row, 1.2 + 1.9 * row] for row in range(4) for column in range(5)]
    scene = {
        "title": "Gas",
        "dimensions": 2,
        "particles": [
            {
                "body": {
                    "mass": 1 + 0.1 * (k % 3),
                    "radius": 0.6,
                    "position": place,
                    "velocity": [(-1) ** k * (1 + 0.1 * k), 0.7],
                }
            }
            for k, place in enumerate(places)
        ],
        "walls": [{"box": {"lower": [0, 0], "upper": [10, 10]}}],
        "contacts": {"hard_spheres": {"solver": solver}},
        "run": {"duration": 3},
    }
    method = integrator or integrators_of(solver)[0]
    scene["integrator"] = {method: {"dt": 0.02} | REQUIRED.get(method, {})}
    if component.flag("contacts", solver, "leads"):
        scene["forces"] = [{"newtonian_gravity": {"strength": 0.1}}]
    elif forced:
        scene["forces"] = [{"uniform_gravity": {"acceleration": [0, -1]}}]
    return scene


def integrators_of(solver):
    """The integrators that go with a contact solver; the usual one first."""
    if component.flag("contacts", solver, "flies"):
        return component.marked("integrators", "flies")
    if component.flag("contacts", solver, "leads"):
        return sorted(component.marked("integrators", "begins_anew"), key=lambda name: name != "ias15")
    return sorted(component.marked("integrators", "moves_forward_alone"), key=lambda name: name != "leapfrog")


def bits(simulation):
    """The time, the step and all that is known of the particles."""
    now = simulation.snapshot()
    arrays = (now.position, now.velocity, now.mass, now.radius)
    return now.time, now.step, *(array.tobytes() for array in arrays)


def counts(simulation):
    """The counts and sums of both reports, and the diagnostics."""
    both = vars(simulation.contact_report) | vars(simulation.solver_report)
    return {key: np.array(each).tolist() for key, each in {**both, **simulation.diagnostics()}.items() if key != "rests"}


class EveryStep:
    """A recorder that is due at every step, so that each launch holds one step."""

    def steps_until_due(self, simulation):
        return 1

    def record(self, simulation):
        """Take nothing."""


def same_after_a_cut(scene, cut, recorder="none", **options):
    """Whether a run, and a run that went on in a new simulation after `cut` steps, end with the same bits, counts and samples.

    The second run takes one step in each launch, and the first takes more and more, for results must not depend on it.
    """
    wanted = run(scene, recorder, options)
    data = run(scene, recorder, options, cut=cut)
    return run(scene, recorder, options, cut=cut, data=data) == wanted


def run(scene, recorder, options, *, cut=None, data=None):
    """The end of a whole run, the record of a run that was `cut` off, or the end of the run that goes on with that record."""
    with Simulation(scene, backend="cpu", event_log=recorder == "events", **options) as simulation:
        looks = RECORDERS[recorder](simulation)
        if data is not None:
            found = unpack(data)
            go_to(simulation, found["moment"])
            object_state.restore(found["samples"], looks)
        steps = STEPS if cut is None else cut if data is None else STEPS - cut
        simulation.run(steps=steps, recorders=[*looks.values(), *([EveryStep()] if data is not None else [])], judge="off")
        if cut is not None and data is None:
            for each in looks.values():
                if hasattr(each, "drain"):
                    each.drain(simulation)
            return pack({"moment": moment_of(simulation), "samples": object_state.captured(looks)})
        for each in looks.values():
            if hasattr(each, "finish"):
                each.finish(simulation)
        return bits(simulation), counts(simulation), pack(object_state.captured(looks))


# Recorders by name: what a run keeps beside its particles, as objects by name


def _table(simulation):
    table = TableRecorder(7)
    return {"table": table, "blow_up": BlowUpWatch(table), "watchdog": EnergyWatchdog(table)}


def _balance(simulation):
    simulation.keep_energy_balance()
    return _table(simulation)


def _events(simulation):
    return {"events": EventLogRecorder([wall.label for wall in simulation.phase.surfaces], 4)}


RECORDERS = {
    "none": lambda simulation: {},
    "table": _table,
    "energy balance": _balance,
    "expect": lambda simulation: {"watcher": Watcher(simulation.spec.expect, 5)},
    "speeds": lambda simulation: {"speeds": SpeedHistogram(simulation)},
    "panels": lambda simulation: {"panels": InspectionRecorder(Inspector(simulation, end=1.0), 3)},
    "events": _events,
    "modes": lambda simulation: {"modes": ModeRecorder(simulation, simulation.spec.modes, 5)},
}
PANELS = [{"x": "time", "y": {"kinetic_energy": {}}}, {"histogram": {"speed": {}}}]
EXPECTED = {
    "orbits": {"oscillation_period": {"of": 1, "axis": "x", "above": 0}, "relative_energy_error_max": {"below": 1}},
    "gas": {"pressure": {"above": 0}, "collision_rate": {"above": 0}, "kinetic_energy": {"above": 0, "when": "mean"}},
}


@dataclass(frozen=True)
class Case:
    """One cell of the matrix of all that goes on."""

    integrator: str
    plan: str
    precision: str
    solver: str = ""
    recorder: str = "none"
    forced: bool = False

    def __str__(self) -> str:
        """The words of the cell."""
        parts = (self.integrator, self.plan, self.precision, self.solver, "forced" if self.forced else "", self.recorder)
        return "-".join(part.replace(" ", "_") for part in parts if part)

    @property
    def scene(self):
        """The scene of this cell."""
        found = gas(self.solver, self.integrator, forced=self.forced) if self.solver else orbits(self.integrator)
        more = {"expect": EXPECTED["gas" if self.solver else "orbits"]} if self.recorder == "expect" else {}
        if self.recorder == "panels":
            more["inspect"] = PANELS
        if self.recorder == "modes":
            springs = [{"link": {"between": [k, (k + 1) % 3], "stiffness": 2 + k}} for k in range(3)]
            more |= {"springs": springs, "modes": {}}
        return found | more

    def goes_on(self, cut):
        """Whether it ends with the same bits, counts and samples after a cut."""
        return same_after_a_cut(self.scene, cut, self.recorder, precision=self.precision, plan=self.plan)


def matrix():
    """Every integrator, plan, precision, contact solver and recorder that go together; few of them are refused by a run."""
    found = []
    for integrator in component.names("integrators"):
        if not component.flag("integrators", integrator, "flies"):
            low = component.flag("integrators", integrator, "takes_low_parts")
            found += [
                Case(integrator, plan, precision, recorder=name)
                for plan in PLANS
                for precision in PRECISIONS
                for name in RECORDERS
                if name != "events" and (low or not carries_low_parts(precision))
            ]
    for solver in component.names("contacts"):
        logs, alone = (component.flag("contacts", solver, key) for key in ("can_log", "leads"))
        found += [
            Case(integrator, plan, precision, solver, name, forced)
            for integrator in integrators_of(solver)
            for plan in PLANS
            for precision in PRECISIONS
            for name in RECORDERS
            for forced in ((False,) if alone else (False, True))
            if name != "modes" and (logs or name != "events") and not carries_low_parts(precision)
        ]
    return found


def drawn(seed):
    """Cells of the matrix in a random order, and steps at which they are cut off; half of the first cells have contacts."""
    chance = random.Random(seed)
    cells = matrix()
    chance.shuffle(cells)
    with_contacts, others = [each for each in cells if each.solver], [each for each in cells if not each.solver]
    for pair in zip_longest(others, with_contacts):
        yield from ((each, chance.randrange(1, STEPS - 1)) for each in pair if each is not None)
