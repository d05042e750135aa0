"""Particles on a device, and the integrators that move them: the order in which kernels are launched."""

from typing import Any

import numpy as np

from mpp_taichi.snapshot import Snapshot

from . import springs
from .bonds import bonds_text
from .coverage import Problem
from .devices import Device
from .fields import fields_text
from .formula import bits
from .hard_spheres import HardSpheres
from .n_body import PairSum
from .program import Memory, build, definition
from .tuning import fastest

GROUPS = (16, 64, 256)  # work-items of a group that are tried
USUAL_GROUP = 64
WORTH_TRYING = 1024  # particles
STEPS_PER_FLUSH = 16
# Nodes, weights and those of positions (A·A) of the stages of the classical Runge-Kutta method, in Nyström's form.
STAGES = (
    (0.5, (0.5, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
    (0.5, (0.0, 0.5, 0.0, 0.0), (0.25, 0.0, 0.0)),
    (1.0, (0.0, 0.0, 1.0, 0.0), (0.0, 0.5, 0.0)),
    (1.0, (1 / 6, 1 / 3, 1 / 3, 1 / 6), (1 / 6, 1 / 6, 1 / 6)),
)


class Motion:
    """Positions and velocities of a problem on a device, and `advance`.

    Drifts that follow each other are one, and so are kicks by the same force where none depends on velocity. The force that a
    step of velocity Verlet ends with serves the next.
    """

    def __init__(self, memory: Memory, device: Device, problem: Problem, snapshot: Snapshot, variant: str | None):
        """Copy to the device, compile, and find the fastest variants."""
        self.memory, self.problem, self.count = memory, problem, snapshot.particle_count
        self.pairs = PairSum(memory, device, problem.pairs, variant=variant) if problem.pairs else None
        self._compile(snapshot)
        self.contacts = HardSpheres(memory, device, problem.contacts) if problem.contacts is not None else None
        self.write(snapshot)
        if self.pairs is not None:
            self.pairs.tune()
        self._tune(device)
        self.write(snapshot)

    def _compile(self, snapshot: Snapshot) -> None:
        import pyopencl

        problem, memory = self.problem, self.memory
        names = ("GRAVITY_X", "GRAVITY_Y", "GRAVITY_Z", "DRAG")
        known: dict[str, Any] = {
            name: definition(value, problem.precision) for name, value in zip(names, (*problem.gravity, problem.drag))
        }
        known["SPRING_DAMPING"] = springs.DAMPING[problem.spring_damping]
        flags = {
            "SPRINGS": problem.has_springs,
            "PAIRS": problem.pairs,
            "HELD": problem.held,
            "DRAGGED": problem.drag > 0.0,
        }
        self._formulas = bonds_text(problem.bonds) + fields_text(problem.fields)
        program = build(
            memory.context,
            ("springs", "motion"),
            problem.precision,
            known | {name: None for name, there in flags.items() if there},
            self._formulas,
        )
        kernels = ("note_places", "drift", "kick_and_drift", "stage", "accelerate", "first_half", "second_half")
        self._kernels = {name: pyopencl.Kernel(program, name) for name in kernels}
        self._group = USUAL_GROUP
        with np.errstate(divide="ignore"):
            inverse_mass = np.where(snapshot.mass > 0.0, 1.0 / snapshot.mass, 0.0)
        nothing = memory.room(1)
        self._forces = (
            np.int32(self.count),
            np.int32(self.pairs.stride if self.pairs else 0),
            memory.reals(inverse_mass),
            memory.reals(memory.padded(snapshot.free)) if problem.held else memory.room(4),
            self.pairs.sum if self.pairs else nothing,
            self.pairs.columns if self.pairs else nothing,
            *(self._quantities(snapshot) if problem.fields else ()),
            *springs.rows(memory, snapshot, problem.bonds),
        )
        self.position, self.other, self.velocity, self.middle, self.acceleration = (
            memory.room(4 * self.count) for _ in range(5)
        )
        if problem.integrator == "rk4":
            self._places = [memory.room(4 * self.count), self.other]
            self._speeds = [memory.room(4 * self.count), self.middle]
            self._slopes = memory.room(16 * self.count)

    def _quantities(self, snapshot: Snapshot) -> tuple[Any, Any]:
        """Buffers of mass, charge and radius, and of the bits of the fields that each particle feels."""
        numbers = np.stack([snapshot.mass, snapshot.charge, snapshot.radius], axis=1)
        return self.memory.reals(self.memory.padded(numbers)), self.memory.buffer(bits(self.problem.fields, self.count))

    # --- the state ------------------------------------------------------------------------------------------------------

    def write(self, snapshot: Snapshot) -> None:
        """Set positions and velocities; what is held stands still."""
        flat = np.arange(3) < self.problem.dimensions
        self.memory.write(self.position, self.memory.padded(snapshot.position * flat))
        self.memory.write(self.velocity, self.memory.padded(snapshot.velocity * snapshot.free * flat))
        self.placed()
        if self.contacts is not None:
            self.contacts.forget()

    def placed(self) -> None:
        """The particles are elsewhere: where there are pairs, note it; forces have to be summed anew."""
        self._summed = False
        if self.pairs is not None:
            self._run("note_places", self.position)

    def read(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities, float64."""
        found = (self.memory.read(source, (self.count, 4))[:, :3] for source in (self.position, self.velocity))
        position, velocity = (values.astype(np.float64) for values in found)
        return position, velocity

    def accelerations(self) -> np.ndarray:
        """By all forces, of the present state, float64."""
        self._sum_pairs()
        self._run("accelerate", self.position, self.velocity, self.acceleration)
        return self.memory.read(self.acceleration, (self.count, 4))[:, :3].astype(np.float64)

    # --- steps ----------------------------------------------------------------------------------------------------------

    @property
    def launches_per_step(self) -> int:
        """Kernel launches of one step among many."""
        problem, pairs = self.problem, self.pairs.launches if self.pairs else 0
        if problem.integrator == "rk4":
            return len(STAGES) * (pairs + 1)
        kick = 2 if problem.spring_damping != "none" else 1
        leapfrog = problem.integrator == "leapfrog"
        if self.contacts is None:
            return pairs + kick * (2 if self._brakes and not leapfrog else 1)
        drift = self.contacts.launches + (self.pairs is not None)
        kicks, drifts = (1, 2) if leapfrog else (2, 1)
        return pairs + drifts * drift + (kicks * kick if problem.has_forces else 0)

    @property
    def _brakes(self) -> bool:
        """Whether a force depends on velocity."""
        return self.problem.drag > 0.0 or self.problem.spring_damping != "none"

    def advance(self, steps: int, time: float) -> None:
        """Advance by so many steps from `time` on, and wait for the end."""
        if steps <= 0:
            return
        if self.contacts is not None:
            self._among_contacts(steps, time)
        elif self.problem.integrator == "leapfrog":
            self._leapfrog(steps)
        elif self.problem.integrator == "velocity_verlet":
            self._velocity_verlet(steps)
        else:
            self._rk4(steps)
        self.memory.queue.finish()

    def _leapfrog(self, steps: int) -> None:
        dt = self.problem.dt
        self._run("drift", self.position, self.velocity, self._real(dt / 2))
        self._summed = False
        for s in self._counted(steps):
            self._kick(dt, dt / 2 if s == steps - 1 else dt)

    def _velocity_verlet(self, steps: int) -> None:
        dt = self.problem.dt
        if self._brakes:
            for _ in self._counted(steps):
                self._kick(dt / 2, dt)
                self._kick(dt / 2, 0.0)
            return
        self._kick(dt / 2, dt)
        for _ in self._counted(steps - 1):
            self._kick(dt, dt)
        self._kick(dt / 2, 0.0)

    def _rk4(self, steps: int) -> None:
        real, dt = self._real, self.problem.dt
        for _ in self._counted(steps):
            x, v = self.position, self.velocity
            for k, (node, weights, bars) in enumerate(STAGES):
                self._sum_pairs()
                numbers = (real(dt), *(real(number) for number in (node, *weights, *bars)))
                into, to = self._places[k % 2], self._speeds[k % 2]
                arguments = (x, v, self.position, self.velocity, into, to, self._slopes, np.int32(k), *numbers)
                self._run("stage", *arguments)
                x, v = into, to
                self._summed = False
            self.position, self._places[1] = self._places[1], self.position
            self.velocity, self._speeds[1] = self._speeds[1], self.velocity

    def _among_contacts(self, steps: int, time: float) -> None:
        """Drifts are those of the contact solver."""
        problem, dt = self.problem, self.problem.dt
        for s in self._counted(steps):
            now = time + s * dt
            if problem.integrator == "leapfrog":
                self._drift_among_contacts(now, dt / 2)
                self._kick_if_forced(dt)
                self._drift_among_contacts(now + dt / 2, dt / 2)
            else:
                self._kick_if_forced(dt / 2)
                self._drift_among_contacts(now, dt)
                self._kick_if_forced(dt / 2)

    def _drift_among_contacts(self, time: float, span: float) -> None:
        assert self.contacts is not None
        self.contacts.drift(self.position, self.velocity, time, span)
        self.placed()

    def _kick_if_forced(self, kick: float) -> None:
        if self.problem.has_forces:
            self._kick(kick, 0.0)

    def _kick(self, kick: float, drift: float) -> None:
        """A kick by the force where the particles are, and the drift after it."""
        self._sum_pairs()
        self._kick_by_sum(kick, drift)
        self._summed = self._summed and drift == 0.0

    def _kick_by_sum(self, kick: float, drift: float) -> None:
        """The same, pairs summed before."""
        spans = self._real(kick), self._real(drift)
        if self.problem.spring_damping != "none":
            self._run("first_half", self.position, self.velocity, self.middle, self.acceleration, spans[0])
            moving = (self.position, self.other, self.velocity, self.middle, self.acceleration)
            self._run("second_half", *moving, *spans)
        else:
            self._run("kick_and_drift", self.position, self.other, self.velocity, *spans)
        self.position, self.other = self.other, self.position

    def _sum_pairs(self) -> None:
        """Unless they have been summed where the particles are."""
        if self.pairs is not None and not self._summed:
            self.pairs.enqueue()
            self._summed = True

    def _counted(self, steps: int) -> Any:
        """Numbers of the steps; the device begins while others are still enqueued."""
        for s in range(steps):
            yield s
            if s % STEPS_PER_FLUSH == 0:
                self.memory.queue.flush()

    def _run(self, name: str, *arguments: Any) -> None:
        self.memory.launch(self._kernels[name], self.count, self._group, *self._forces, *arguments)

    def _real(self, number: float) -> Any:
        return self.memory.real(number)

    # --- tuning ---------------------------------------------------------------------------------------------------------

    def _tune(self, device: Device) -> None:
        """Find the fastest size of a group for the loops over particles; the state is not what it was afterwards."""
        problem = self.problem
        if not problem.has_forces or self.count < WORTH_TRYING:
            return

        def attempt(group: int) -> None:
            self._group = group
            if problem.integrator == "rk4":
                self._run("accelerate", self.position, self.velocity, self.acceleration)
            else:
                self._kick_by_sum(problem.dt, problem.dt)
            self.memory.queue.finish()

        effects = (problem.has_springs, problem.spring_damping, bool(problem.pairs), self._formulas)
        key = ("motion", device.id, problem.precision, problem.integrator, effects, self.count)
        self._group = fastest(key, [size for size in GROUPS if size <= device.handle.max_work_group_size], attempt)

    @property
    def variant(self) -> str:
        """What was chosen, in words."""
        parts = [f"pairs: {self.pairs.variant}"] if self.pairs is not None else []
        if self.contacts is not None:
            parts.append(f"contacts: {self.contacts.variant}")
        return "; ".join([*parts, f"motion: groups of {self._group}"])
