"""Stretches: the phases of a problem, each with the part of the steps that it takes, and the steps of a run through them.

A run with `steps` steps in all divides them among the stretches in the ratio in which the scene itself divides its own steps:
by the length of a stretch over the step that the scene asks for there. Each stretch takes a whole number of equal steps, one
at least. A run with twice the steps takes twice the steps in every stretch, however short a stretch is, so that differences of
two runs show the errors of all stretches.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.simulation.course import Phase
from mpp_taichi.snapshot import Snapshot

LOOKS = 64  # samples of energies and positions in a run; the steps of a reference are a multiple of this number
ROUNDING = 1e-9  # of a step: the rounding error of a number of steps


@dataclass(frozen=True, eq=False)
class Stretch:
    """The part of a problem that lies in one phase.

    number        of the phase in the scene; 0 without a timeline
    began, ended  [time]
    particles     of the phase, placed as at the start of the run
    share         of the steps of a run; the shares of all stretches of a problem add up to 1
    changes       the paths of the parameters that the timeline sets at the beginning
    """

    number: int
    began: float
    ended: float
    spec: SceneSpec
    particles: Snapshot
    share: float = 1.0
    changes: tuple[str, ...] = ()

    @property
    def span(self) -> float:
        """Length [time]."""
        return self.ended - self.began


@dataclass(frozen=True, eq=False)
class Leg:
    """A stretch in equal steps: their number, and the steps after which samples are taken, beginning with 0."""

    stretch: Stretch
    steps: int
    stops: Sequence[int]

    @property
    def dt(self) -> float:
        """The length of a step [time]."""
        return self.stretch.span / self.steps

    def time(self, step: int) -> float:
        """The time after so many steps."""
        return self.stretch.began + step * self.dt


def own_step(spec: SceneSpec) -> float:
    """The step of a scene's own setting [time]; of a method that chooses its steps, the time between two samples."""
    return float(spec.integrator.parameters["dt"])


def stretches_of(phases: Sequence[Phase], began: float, ended: float) -> tuple[Stretch, ...]:
    """The stretches between two times."""
    ends = [*(phase.at for phase in phases[1:]), math.inf]
    found = []
    for number, (phase, end) in enumerate(zip(phases, ends)):
        first, last = max(began, phase.at), min(ended, end)
        if last > first:
            found.append((number, first, last, phase))
    weights = [(last - first) / own_step(phase.spec) for _, first, last, phase in found]
    return tuple(
        Stretch(number, first, last, phase.spec, phase.particles, weight / sum(weights), tuple(phase.changes))
        for (number, first, last, phase), weight in zip(found, weights)
    )


def legs(stretches: Sequence[Stretch], steps: int, looks: int = LOOKS) -> list[Leg]:
    """The legs of a run with about so many steps in all; exactly so many in a problem of one stretch. With so many samples."""
    if len(stretches) == 1:
        stops = sorted({round(k * steps / looks) for k in range(looks + 1)})
        return [Leg(stretches[0], steps, stops)]
    doublings = 0
    while steps % 2 == 0 and steps // 2 >= LOOKS:
        steps, doublings = steps // 2, doublings + 1
    found = []
    for stretch in stretches:
        fewest = max(1, math.ceil(steps * stretch.share - ROUNDING))
        mine = max(1, round(looks * stretch.share))
        stops = sorted({round(k * fewest / mine) * 2**doublings for k in range(mine + 1)})
        found.append(Leg(stretch, fewest * 2**doublings, stops))
    return found
