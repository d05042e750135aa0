"""Energy balance: the energy that friction dissipated, driving forces supplied and the method itself lost in a run."""

import copy
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from mpp_taichi.energy.energy_meter import PowerMeter
from mpp_taichi.energy.numerical_damping import OscillationCounter
from mpp_taichi.energy.running_integral import RunningIntegral
from mpp_taichi.errors import MppError


class EnergyBalance:
    """Kinetic + potential + dissipated energy − work − heat = constant; a residual is the error of the method.

    dissipated_energy   D = ∫ −Σ F·v dt over the forces that depend on velocity, drag and damping of springs, and the energy
                        that springs lost as they broke or yielded, and restitution or merging took in contacts [energy]
    work                W = ∫ Σ F·v dt over the other forces without a potential, the work of the agents that move bodies on
                        given paths, and of moving walls (booked by `swept`, `simultaneous` and `pairwise`), the energy that
                        `parameter_change` booked, and the change of the potential energy by merging, which changes masses
                        and places [energy]
    heat                Q, the energy that a bath of the method has given; there only where the method has a bath
    residual            E + D − W − Q − E₀, of the order of the method; energy that the method loses is −residual
    turnover            largest kinetic energy, D, |W| or |Q| so far: the scale of the residual, whatever the zero of the
                        potential is

    The powers are sampled after every step, summed in f64 (where the device has it) and integrated to fourth order, so that the
    residual of a method up to fourth order is an error of the method. In f32 the particles are rounded in every step, and the
    residual does not fall below some 2⁻²⁴ √steps of the turnover. Of several replicas the first is measured.
    """

    def __init__(self, meter: PowerMeter) -> None:
        """Bind the meter; the first sample is taken by `look` or `follow`."""
        if any(not force.conserves_energy for force in meter.total_force.pair_forces):
            raise MppError("there is no energy balance with a pair force that has no potential")
        self.meter = meter
        self.restart()

    def restart(self) -> None:
        """Begin a new balance at the next sample."""
        self._integral = RunningIntegral()
        self._booked = 0.0
        self._rods_elsewhere = 0.0  # work on rods in earlier phases, less the work before the first sample
        self._heat_elsewhere = 0.0  # of earlier phases, less the heat taken before the first sample
        self._lost_before = 0.0  # by springs before the first sample
        self._step: int | None = None
        self._kinetic = 0.0
        self._largest_kinetic = 0.0
        self.initial_energy = 0.0
        self.oscillations = OscillationCounter()

    def copied(self) -> dict[str, Any]:
        """The present balance, for `go_back`."""
        return {name: copy.deepcopy(value) for name, value in vars(self).items() if name != "meter"}

    def go_back(self, earlier: dict[str, Any]) -> None:
        """Return to a balance that `copied` gave; an empty one begins a new balance."""
        self.restart()
        vars(self).update(copy.deepcopy(earlier))

    @property
    def dissipated_energy(self) -> float:
        """Energy that forces which depend on velocity have dissipated so far."""
        return float(self._integral.value[0]) if self._step is not None else 0.0

    @property
    def work(self) -> float:
        """Energy that driving forces and changes of parameters have supplied so far."""
        return float(self._integral.value[1]) + self._booked if self._step is not None else 0.0

    @property
    def turnover(self) -> float:
        """The scale of the residual."""
        return max(self._largest_kinetic, abs(self.dissipated_energy), abs(self.work))

    def follow(self, simulation: Any, steps: int, dt: float) -> None:
        """After a launch: take the sample of each of its steps, at times that do not depend on the length of the launch."""
        for time, powers in zip(simulation.clock.ends_of(steps, dt), self.meter.kept(steps), strict=True):
            self._take(time, powers)
        self._step = simulation.step_count

    def look(self, simulation: Any) -> None:
        """Take a sample now, unless this step has a sample."""
        if self._step != simulation.step_count:
            powers = self._powers_now(simulation.time)
            if self._step is None:
                self.initial_energy = float(powers[2]) + simulation.energy_meter.potential_energy(simulation.time)
                self._heat_elsewhere, self._rods_elsewhere = -_heat(simulation.phase), -_work_on_rods(simulation.phase)
                self._lost_before = simulation.phase.lost_by_springs
            self._take(simulation.time, powers)
            self._step = simulation.step_count

    def _powers_now(self, time: float) -> np.ndarray:
        self.meter.keep(0, time)
        return self.meter.kept(1)[0]

    def _take(self, time: float, powers: np.ndarray) -> None:
        self._kinetic = float(powers[2])
        self._largest_kinetic = max(self._largest_kinetic, self._kinetic)
        self._integral.add(time, powers[:2])
        self.oscillations.add(time, self._kinetic)

    def account(self, simulation: Any, total_energy: float) -> dict[str, float]:
        """The present balance, to be shown beside `total_energy`."""
        self.look(simulation)
        dissipated = self.dissipated_energy + simulation.contact_report.dissipated_energy
        dissipated += simulation.phase.lost_by_springs - self._lost_before
        work = self.work + simulation.contact_report.potential_change + simulation.contact_report.wall_work
        work += self._rods_elsewhere + _work_on_rods(simulation.phase)
        heat = self._heat_elsewhere + _heat(simulation.phase)
        has_bath = simulation.phase.integrator.draws_random or heat != 0.0
        return {
            "dissipated_energy": dissipated,
            "work": work,
            **({"heat": heat} if has_bath else {}),
            "energy_balance_residual": (total_energy - self.initial_energy) + (dissipated - work - heat),
            "energy_turnover": max(self.turnover, abs(dissipated), abs(work), abs(heat)),
        }

    @contextmanager
    def parameter_change(self, simulation: Any) -> Iterator[None]:
        """A block in which parameters or particles change at one time; the change of the energy is booked as work.

        A caller that replaces fields or forces in the block also sets the `meter` of the new fields and forces.
        """
        self.look(simulation)
        before = self._kinetic + simulation.energy_meter.potential_energy(simulation.time)
        heat, on_rods = _heat(simulation.phase), _work_on_rods(simulation.phase)
        yield
        self._heat_elsewhere += heat - _heat(simulation.phase)
        self._rods_elsewhere += on_rods - _work_on_rods(simulation.phase)
        self._integral.cut()
        self._take(simulation.time, self._powers_now(simulation.time))
        self._booked += self._kinetic + simulation.energy_meter.potential_energy(simulation.time) - before


def _work_on_rods(phase: Any) -> float:
    """Work of the agents that move ends of rods, in this phase [energy]."""
    return float(phase.total_force.rods.work(phase.state)) if phase.total_force.has_rods else 0.0


def _heat(phase: Any) -> float:
    """Energy that a bath of the method has given in this phase [energy]."""
    return float(phase.integrator.heat(phase.state))
