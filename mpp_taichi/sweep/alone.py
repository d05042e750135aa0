"""Alone: a member that cannot share a launch with others is run as a simulation of its own."""

from functools import cached_property
from typing import Any

import numpy as np

from mpp_taichi.errors import MppError, StabilityError
from mpp_taichi.recorders._simulation_sample import SimulationSample
from mpp_taichi.scene.timeline import step_count
from mpp_taichi.simulation.simulation import Simulation
from mpp_taichi.state.tangent_growth import TangentGrowth
from mpp_taichi.sweep.gauges import Gauges, stride_of
from mpp_taichi.sweep.member import DIVERGED, REFUSED, Member, MemberRow, one_line, refused
from mpp_taichi.sweep.replicas import Bench
from mpp_taichi.sweep.samples import MemberParticles
from mpp_taichi.sweep.structure import key_alone


class _Ended(Exception):
    """The member has ended, and with it its run."""


class AloneSample:
    """A single simulation as the only one of several copies."""

    def __init__(self, simulation: Simulation) -> None:
        """Read it before the simulation goes on."""
        self._sample = SimulationSample(simulation)
        self.time = self._sample.time

    @cached_property
    def snapshot(self) -> MemberParticles:
        """The particles, as arrays with one entry."""
        found = self._sample.snapshot
        return MemberParticles(found.position[None], found.velocity[None], found.mass[None])

    @cached_property
    def potential_energy(self) -> np.ndarray:
        """The potential energy, (1,)."""
        return np.array([self._sample.potential_energy])

    @property
    def tangent(self) -> TangentGrowth:
        """The growth of a small deviation."""
        return self._sample.tangent

    def one(self, number: int) -> SimulationSample:
        """The simulation itself."""
        return self._sample


class _Looker:
    """The recorder that samples the member when it is due."""

    def __init__(self, gauges: Gauges, look: Any) -> None:
        self.gauges, self._look = gauges, look
        self._seen = -1

    def steps_until_due(self, simulation: Simulation) -> int:
        """Steps until the member wants its next sample."""
        return max(0, int(self.gauges.due[0]) - simulation.step_count)

    def record(self, simulation: Simulation) -> None:
        """Take the sample, and end the run where the member ends with it."""
        self._look()
        self._seen = simulation.step_count
        self.gauges.look(AloneSample(simulation), np.array([0]), simulation.step_count, simulation.dt)
        if self.gauges.rows[0] is not None:
            raise _Ended

    def finish(self, simulation: Simulation) -> None:
        """Take the last sample, unless it was taken."""
        if simulation.step_count != self._seen:
            self.gauges.look(AloneSample(simulation), np.array([0]), simulation.step_count, simulation.dt)


def run_alone(member: Member, bench: Bench) -> MemberRow:
    """The row of a member."""
    spec, key = member.spec, key_alone(member.spec, member.start)
    try:
        simulation = bench.single(member, key)
    except MppError as error:
        return refused(member.number, error)
    is_sound = False
    try:
        total = spec.run.steps if spec.run.duration is None else step_count(spec, spec.run.duration)
        gauges = Gauges([member], stride_of(spec.run, total or 0), simulation.device.precision)
        looker = _Looker(gauges, bench.look)
        try:
            simulation.run(recorders=[looker], judge="off")
            looker.finish(simulation)
            if gauges.rows[0] is None:
                gauges.end(0, simulation.time, simulation.step_count)
        except _Ended:
            pass
        except StabilityError as error:
            status = DIVERGED if simulation.step_count > 0 or gauges.due[0] > 0 else REFUSED
            gauges.end(0, simulation.time, simulation.step_count, status=status, reason=one_line(error))
        row = gauges.rows[0]
        assert row is not None
        is_sound = row.status != DIVERGED
        return row
    finally:
        bench.give_back(simulation, key if is_sound else None)
