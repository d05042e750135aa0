"""Replicas: members with the same step run side by side, one thread each, many steps in one launch."""

from collections import OrderedDict
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mpp_taichi import component
from mpp_taichi.errors import MppError, StabilityError
from mpp_taichi.scene.timeline import whole_steps
from mpp_taichi.simulation.simulation import Simulation
from mpp_taichi.snapshot import springs_differ
from mpp_taichi.stability import StepGuard
from mpp_taichi.stability.network import drag_of
from mpp_taichi.start.tangent_copies import copies_of
from mpp_taichi.sweep.gauges import Gauges, stride_of
from mpp_taichi.sweep.member import DIVERGED, STALLED, Member, MemberRow, refused
from mpp_taichi.sweep.samples import MemberMoment

KEPT, KEPT_SMALL = 4, 16  # simulations whose kernels are kept for the next chunk, and where the last of them is small
FEW_PARTICLES = 5000
SIZES = (32, 256, 2048)  # of simulations with spare places
MOST_SPARE = 200_000  # particles of a simulation with spare places


@dataclass(frozen=True)
class MemberDevice:
    """Where members run."""

    backend: str
    precision: str
    threads: int | None = None


class Bench:
    """Simulations of this process, by the step that they have compiled and the number of replicas."""

    def __init__(self, device: MemberDevice, look: Callable[[], None] = lambda: None) -> None:
        """`look` is called between launches and may raise."""
        self.device, self.look = device, look
        self._kept: OrderedDict[Hashable, Simulation] = OrderedDict()

    def simulation(self, key: Hashable, members: Sequence[Member]) -> Simulation:
        """A simulation of these members at their starts, one replica each."""
        scenes, starts = [each.spec for each in members], [each.start for each in members]
        spare = places_for(members, on_cpu=self.device.backend == "cpu") - len(members)
        scenes += scenes[:1] * spare
        starts += starts[:1] * spare
        key = (key, len(starts), springs_differ(starts))
        known = self._kept.pop(key, None)
        if known is None:
            known = Simulation(
                members[0].spec,
                backend=self.device.backend,
                precision=self.device.precision,
                threads=self.device.threads,
                plan="replicas",
                replica_starts=tuple(starts),
            )
        self._keep(key, known)
        known.place_replicas(starts, scenes)
        known.phase.launcher.use(len(members) * known.phase.copies)
        return known

    def single(self, member: Member, key: Hashable | None) -> Simulation:
        """A simulation of one member at its start; one that was `kept` under the same key, if there is one."""
        known = None if key is None else self._kept.pop(key, None)
        if known is not None:
            known.place_replicas([member.start], [member.spec])
            return known
        device = self.device
        return Simulation(member.spec, backend=device.backend, precision=device.precision, threads=device.threads)

    def give_back(self, simulation: Simulation, key: Hashable | None) -> None:
        """Keep the simulation of a member that has ended for the next member with the same key; close it without a key."""
        if key is None:
            simulation.close()
        else:
            self._keep(key, simulation)

    def _keep(self, key: Hashable, simulation: Simulation) -> None:
        self._kept[key] = simulation
        most = KEPT if simulation.state.total_count > FEW_PARTICLES else KEPT_SMALL
        while len(self._kept) > most:
            self._kept.popitem(last=False)[1].close()


def places_for(members: Sequence[Member], *, on_cpu: bool) -> int:
    """Replicas of a simulation for these members: few sizes, so that few kernels are compiled.

    Spare places cost memory alone, but for methods whose launchers advance all replicas, and on a GPU.
    """
    count = max(2, len(members))
    spec, start = members[0].spec, members[0].start
    copies = copies_of(spec, start)
    method: Any = component.load("integrators", spec.integrator.name)
    for size in SIZES if on_cpu and method.launchers.replicas == "replicas" else ():
        if count <= size and size * copies * start.particle_count <= MOST_SPARE:
            return size
    return 1 << (count - 1).bit_length()


def run_together(key: Hashable, members: Sequence[Member], bench: Bench) -> list[MemberRow]:
    """The rows of members with the same structure, in their order.

    Each member has the bits that it has by itself: its steps, its samples and its end follow from its own motion alone.
    """
    spec = members[0].spec
    try:
        simulation = bench.simulation(key, members)
    except MppError as error:
        return [refused(each.number, error) for each in members]
    total, rest = _length(simulation)
    reasons = _refusals(members, simulation, total)
    if any(reasons):
        others = [each for each, why in zip(members, reasons, strict=True) if not why]
        rows = {row.number: row for row in (run_together(key, others, bench) if others else ())}
        return [rows.get(each.number) or refused(each.number, why) for each, why in zip(members, reasons, strict=True)]
    gauges = Gauges(members, stride_of(spec.run, total), simulation.device.precision)
    looks = _Looks(simulation, members, gauges)
    step = 0
    looks.look(step)
    while len(active := gauges.active) and step < total:
        bench.look()
        following = min(total, int(gauges.due[active].min()))
        simulation.try_steps(following - step, judged=False)
        step = following
        looks.look(step, everybody=step == total and rest == 0.0)
    if len(gauges.active) and rest > 0.0:
        simulation.try_steps(1, rest, judged=False)
        step += 1
        looks.look(step, everybody=True)
    gauges.end_all(simulation.time, step)
    return [row for row in gauges.rows if row is not None]


class _Looks:
    """Samples of the members that are still running."""

    def __init__(self, simulation: Simulation, members: Sequence[Member], gauges: Gauges) -> None:
        self.simulation, self.members, self.gauges = simulation, members, gauges
        self._mass = simulation.state.as_kept(np.stack([each.start.mass for each in members]))

    def look(self, step: int, *, everybody: bool = False) -> None:
        """Sample the members that are due, and end those that have broken down."""
        who = self.gauges.active
        if not everybody:
            who = who[self.gauges.due[who] <= step]
        moment = MemberMoment(self.simulation, self.members, self._mass)
        broken, stalled = moment.broken, self._stalled()
        for k in who[(broken[who] >= 0) | stalled[who]].tolist():
            if broken[k] >= 0:
                reason = f"the position or velocity of particle {broken[k]} is no finite number by t = {moment.time:.6g}"
                self.gauges.end(k, moment.time, step, status=DIVERGED, particle=int(broken[k]), reason=reason)
            else:
                reason = f"{self.simulation.integrator.standing_reason}, before t = {moment.time:.6g}"
                self.gauges.end(k, moment.time, step, status=STALLED, reason=reason)
        who = who[(broken[who] < 0) & ~stalled[who]]
        if len(who):
            self.gauges.look(moment.of(who), who, step, self.simulation.dt)

    def _stalled(self) -> np.ndarray:
        """Whether the method of each member stands still."""
        found = np.zeros(len(self.members), bool)
        standing = self.simulation.integrator.standing_replicas(self.simulation.state)
        found[standing[standing < len(found)]] = True
        return found


def _length(simulation: Simulation) -> tuple[int, float]:
    """Whole steps of a run, and the length of a shorter last step or 0."""
    run = simulation.spec.run
    if run.duration is None:
        return run.steps or 0, 0.0
    return whole_steps(run.duration, simulation.dt)


def _refusals(members: Sequence[Member], simulation: Simulation, steps: int) -> list[str]:
    """For each member why its springs and its drag do not allow the step, as before any run; empty where they do."""
    known: dict[Hashable, str] = {}
    found = []
    for each in members:
        springs = each.start.springs
        facts = (springs.stiffness.tobytes(), springs.damping.tobytes(), springs.rest_length.tobytes(), drag_of(each.spec))
        judged = (*facts, each.start.mass.tobytes() if len(springs) or drag_of(each.spec) else b"")
        if judged not in known:
            known[judged] = ""
            try:
                StepGuard(each.spec, each.start, simulation.integrator, force=False).check(simulation.dt, steps)
            except StabilityError as error:
                known[judged] = str(error)
        found.append(known[judged])
    return found
