"""Blow-up: a run that gains energy without a source is stopped, and taken back to the step at which the gain began."""

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from mpp_taichi import component
from mpp_taichi.errors import StabilityError
from mpp_taichi.recorders.table import TableRecorder
from mpp_taichi.simulation import first_bad_step
from mpp_taichi.simulation.massless_watch import MasslessWatch
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.stability.network import SpringNetwork
from mpp_taichi.wording.told_apart import told_apart

if TYPE_CHECKING:
    from mpp_taichi.simulation.saved_state import Mark
    from mpp_taichi.simulation.simulation import Simulation

ALARM = 1000.0  # times the energy that the run could turn over, gained without a source: the energy will not return
ONSET = 0.1  # share of a gain, equal to the relative error above which a conserved energy is called inaccurate
STRAIN_SHARE = 1e-3  # of Σ ½ D L², all springs, and spheres that yield, strained by 1: no alarm below a mean strain of 3 %
ROUNDING = 64.0  # machine epsilons of the energies, by which their difference may be rounded
LOOKS = 250
LONGEST = 1000.0  # extents of the system at the start: a longer spring is a blow-up under any drive


class BlowUpWatch:
    """Reads the table as it grows, and keeps the last state with a sound energy.

    Where forces conserve or brake, E(t) ≤ E(0): the method is the cause of any gain of E. The gain is compared with the energy
    that the run could turn over, K₀ + max (U₀ − U), the kinetic energy at the start and the potential energy released. Springs
    at rest that nothing moves, and spheres that lie and yield, have neither, so a share of their energy at strain 1 is added.
    Beyond `ALARM` the run is taken back to the last sound sample and bisected to the first step that gains more than `ONSET`.
    Where a drive may add energy, only the length of the springs and finite numbers are watched. The watch costs a copy of
    the state for each sample. Massless particles have no part in this energy, and a watch of their own.

    It must come after its table in the list of recorders.
    """

    def __init__(self, table: TableRecorder) -> None:
        """Watch a table."""
        self.table = table
        self._massless = MasslessWatch()
        self.restart()

    def restart(self) -> None:
        """Watch from the next sample on, which becomes the start: after a restart, or when a parameter was changed."""
        self._seen = 0
        self._start: dict[str, Any] | None = None
        self._released = 0.0
        self._sound: Mark | None = None
        self._elastic = 0.0
        self._has_springs = False
        self._extent = 0.0
        self._epsilon = 0.0
        self._massless.restart()

    def steps_until_due(self, simulation: "Simulation") -> int:
        """Now, when the table has grown."""
        return 0 if len(self.table.rows) > self._seen else self.table.steps_until_due(simulation)

    def record(self, simulation: "Simulation") -> None:
        """Judge the newest sample.

        Raises:
            StabilityError: the run has blown up; the simulation stands at the last sound step.
        """
        self._seen = len(self.table.rows)
        if not self.table.rows:
            return
        row = self.table.rows[-1]
        if self._start is None:
            self._begin(simulation, row)
        if self._is_alarming(simulation, row):
            raise self._trace(simulation, row)
        self._massless.record(simulation)
        self._released = max(self._released, self._release(row))
        if self._is_sound(simulation, row):
            self._sound = simulation.mark(whole=False)

    def explain(self, error: StabilityError, simulation: "Simulation") -> StabilityError:
        """The error for a run that a number not finite has stopped: where a blow-up began, or the given error."""
        if self._start is None or self._sound is None or error.step is None or not simulation.phase.gains_no_energy:
            return error
        row = _look(simulation)
        return self._trace(simulation, row) if self._is_alarming(simulation, row) else error

    def _begin(self, simulation: "Simulation", row: dict[str, Any]) -> None:
        start = simulation.snapshot()
        springs = start.springs
        self._start = row
        self._has_springs = len(springs) > 0
        self._elastic = float(0.5 * springs.stiffness @ springs.rest_length**2) + _elastic_of_contacts(simulation, start)
        self._extent = float(np.ptp(start.position, axis=0).max() + springs.rest_length.sum())
        self._epsilon = 2.0**-53 if simulation.device.precision == "f64" else 2.0**-24
        self._sound = simulation.mark(whole=False)

    def _start_energy(self, name: str) -> float:
        assert self._start is not None
        return self._start[name]

    def _gain(self, row: dict[str, Any]) -> float:
        return row["total_energy"] - self._start_energy("total_energy")

    def _turnover(self, row: dict[str, Any]) -> float:
        return self._start_energy("kinetic_energy") + max(self._released, self._release(row))

    def _release(self, row: dict[str, Any]) -> float:
        return self._start_energy("potential_energy") - row["potential_energy"]

    def _rounding(self, row: dict[str, Any]) -> float:
        sizes = (self._start_energy("potential_energy"), row["potential_energy"], row["kinetic_energy"])
        return ROUNDING * self._epsilon * sum(map(abs, sizes))

    def _is_alarming(self, simulation: "Simulation", row: dict[str, Any]) -> bool:
        if not math.isfinite(row["total_energy"]):
            return True
        if simulation.phase.gains_no_energy:
            limit = ALARM * (self._turnover(row) + self._rounding(row)) + STRAIN_SHARE * self._elastic
            return self._gain(row) > limit
        return self._has_springs and _longest_spring(simulation) > LONGEST * self._extent

    def _is_sound(self, simulation: "Simulation", row: dict[str, Any]) -> bool:
        if simulation.phase.gains_no_energy:
            return self._gain(row) <= ONSET * self._turnover(row) + self._rounding(row)
        return not self._is_alarming(simulation, row)

    def _trace(self, simulation: "Simulation", row: dict[str, Any]) -> StabilityError:
        """Go back to the last sound step; the error says at which step, and how, the run left it.

        An oscillation that a step hardly resolves swings in its energy, so that sound and unsound steps may alternate at first.
        The run is therefore followed again, in `LOOKS` strides, to the last sound sample before the alarm, and bisected there.
        """
        assert self._sound is not None and self._start is not None
        stored = [self._sound]

        def advance(count: int) -> bool:
            return simulation.try_steps(count) and self._is_sound(simulation, _look(simulation))

        def keep() -> None:
            stored[0] = simulation.mark(whole=False)

        def rewind() -> None:
            simulation.return_to(stored[0])

        steps = max(1, row["step"] - self._sound.step)
        with np.errstate(over="ignore", invalid="ignore"):
            rewind()
            for stride in _strides(steps):
                sound = advance(stride)
                now = _look(simulation)
                if self._is_alarming(simulation, now):
                    row = now
                    break
                self._released = max(self._released, self._release(now))
                if sound:
                    keep()
            worst = simulation.snapshot()
            first_bad_step.first_bad_step(max(1, worst.step - stored[0].step), advance, keep, rewind)
        return _describe(simulation, self._start, row, worst)


def _strides(steps: int) -> list[int]:
    """Steps in about `LOOKS` parts."""
    stride = -(-steps // LOOKS)
    return [min(stride, steps - done) for done in range(0, steps, stride)]


def _look(simulation: "Simulation") -> dict[str, Any]:
    with np.errstate(over="ignore", invalid="ignore"):
        return simulation.mechanics()


def _elastic_of_contacts(simulation: "Simulation", snapshot: Snapshot) -> float:
    """Σ ½ (2 r)²/c where contacts yield: the energy that they give back is no gain without a source."""
    compliance = getattr(simulation.contacts, "compliance", 0.0)
    return float(0.5 * np.sum((2.0 * snapshot.radius) ** 2)) / compliance if compliance > 0.0 else 0.0


def _lengths(snapshot: Snapshot) -> np.ndarray:
    ends = snapshot.position[snapshot.springs.between]
    return np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)


def _longest_spring(simulation: "Simulation") -> float:
    with np.errstate(over="ignore", invalid="ignore"):
        return float(_lengths(simulation.snapshot()).max())


def _describe(simulation: "Simulation", start: dict[str, Any], row: dict[str, Any], worst: Snapshot) -> StabilityError:
    """The error for a run; the simulation stands at its last sound state, `row` and `worst` are of its alarm."""
    if simulation.phase.gains_no_energy:
        first, last = told_apart(start["total_energy"], row["total_energy"])
        why = f"the energy, which no force adds to, rises from {first} to {last}"
    else:
        why = "springs grow beyond reason"
    particle, where = _worst(simulation, worst)
    step, time = simulation.step_count + 1, simulation.time + simulation.dt
    error = StabilityError(
        f"step {step}, time {time:.9g}: from here the run blows up: {why} at time {row['time']:.6g}; worst is {where}; "
        f"{_cure(simulation)}"
    )
    error.step, error.time, error.particle = step, time, particle
    return error


def _worst(simulation: "Simulation", state: Snapshot) -> tuple[int, str]:
    """The particle with most of the energy, or an end of the spring with most of it; and the words for it."""
    springs = state.springs
    with np.errstate(over="ignore", invalid="ignore"):
        kinetic = np.nan_to_num(state.mass * np.sum(state.velocity**2, axis=1), nan=np.inf)
        if len(springs):
            length = _lengths(state)
            index = int(np.argmax(np.nan_to_num(springs.stiffness * (length - springs.rest_length) ** 2, nan=np.inf)))
            moving = int(max(springs.between[index], key=lambda end: kinetic[end]))
            change = f"{length[index]:.3g} long there, at rest {springs.rest_length[index]:.3g}"
            return moving, f"{SpringNetwork(simulation.spec, state).describe_spring(index)}, {change}"
        particle = int(np.argmax(kinetic))
        return particle, f"{first_bad_step.label(state, particle)} at speed {np.linalg.norm(state.velocity[particle]):.3g}"


def _cure(simulation: "Simulation") -> str:
    advice = simulation.step_advice
    if advice is None:
        return f"the step is too large for what happens there: try dt = {0.5 * simulation.dt:.3g}, or a softening"
    if advice.never_stable:
        instead = " or ".join(component.proposed("integrators", "oscillation"))
        return f"no step of {advice.integrator} keeps an oscillation: take {instead}"
    if not advice.is_unlimited and simulation.dt > advice.safe_limit:
        return f"{advice.integrator} allows {advice.limit:.6g}; dt = {advice.holding_step:.6g} holds"
    return f"the springs allow dt = {simulation.dt:.6g}, something else does not: try {advice.holding_step:.6g}"
