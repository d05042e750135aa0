"""The reference of a scene with contacts: event-driven flight, compared with a flight from a slightly shifted start."""

import numpy as np

from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.machine import Machine
from mpp_taichi.accuracy.methods import LOOKS
from mpp_taichi.accuracy.reference import MEANING, ReferenceSolution, distance, lost_at, size_of
from mpp_taichi.accuracy.sample import Sample

SHIFT = 1e-14  # of the size of the system: some 50 roundings, more than the few of a flight between two collisions
SEED = 20261121


def fly(machine: Machine, budget: Budget) -> tuple[ReferenceSolution, Sample] | None:
    """Positions at the end, and the run; their error bar is the effect of a random shift of the start by ±SHIFT.

    A collision enlarges a shift by the free path over the radius, some tens to hundreds of times, so that positions in a gas
    soon lose their meaning, however exact the flight is. None where the flight itself breaks off.
    """
    start = machine.problem.start
    configuration = machine.configuration(LOOKS)
    sample, trace = machine.run(configuration, budget, follow=True)
    if sample.end is None or trace is None:
        return None
    size = size_of(trace) or 1.0
    shift = SHIFT * size * np.random.default_rng(SEED).uniform(-1.0, 1.0, start.position.shape) * start.free
    shift[:, machine.problem.spec.dimensions :] = 0.0
    differences, lost = [], []
    for sign in (1.0, -1.0):  # one of the signs changes the order of contacts at one instant
        beside = (start.position + sign * shift, start.velocity * start.free)
        other, shifted = machine.run(configuration, budget, follow=True, start=beside)
        if other.end is None or shifted is None:
            return None
        differences.append(distance(other.end, sample.end, size))
        lost.append(lost_at(trace, shifted, size))
    largest, rms = (max(pair[part] for pair in differences) for part in (0, 1))
    found = ReferenceSolution(
        integrator=machine.name,
        order=0,
        steps=LOOKS,
        end=sample.end,
        size=size,
        bar=max(largest, SHIFT),
        bar_rms=max(rms, SHIFT),
        trusted=largest < MEANING,
        differences=[pair[0] for pair in differences],
        meaning=min((time for time in lost if time is not None), default=None),
        by_rounding=True,
    )
    return found, sample
