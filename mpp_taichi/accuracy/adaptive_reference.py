"""A reference by an adaptive method: compensated sums keep its round-off below the round-off of runs with equal steps.

Three runs with different steps have independent rounding errors. The error bar is SEEN times the largest difference of their
ends. As the steps of all three are so short that nothing but rounding is left, runs that part tell the time at which
rounding errors have grown to the size of the system: the horizon of positions.
"""

import itertools
from collections.abc import Callable
from dataclasses import replace

from mpp_taichi import component
from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.machine import Machine
from mpp_taichi.accuracy.methods import LOOKS, StudyMethod
from mpp_taichi.accuracy.reference import MEANING, ReferenceSolution, distance, lost_at, size_of
from mpp_taichi.accuracy.sample import Sample
from mpp_taichi.accuracy.trace import Trace

MIDDLE = 1  # of three tolerances
# Of three normally distributed errors one exceeds their range in 12.5 % of all cases, and twice their range in 2.5 %.
SEEN = 2.0
ROUNDED = 1e-9  # of the size: after the first sample runs that differ by less differ by rounding errors alone


def candidates(found: dict[str, StudyMethod]) -> list[str]:
    """The methods of a scene that can give the reference, those that compile fast first."""
    named = [name for name in component.marked("integrators", "reference_tolerances") if name in found]
    return sorted(named, key=lambda name: found[name].slow_to_compile)


def tolerances(name: str) -> tuple[float, ...]:
    """The tolerances of the three runs, coarse to fine."""
    return tuple(component.flag("integrators", name, "reference_tolerances"))


def alone(machine: Machine, budget: Budget, *, add: Callable[[Sample], None]) -> ReferenceSolution | None:
    """The reference by this method without another method beside it; None where a run breaks off."""
    runs: list[tuple[Sample, Trace]] = []
    for tolerance in tolerances(machine.name):
        sample, trace = machine.run(machine.configuration(LOOKS, tolerance), budget, follow=True)
        add(sample)
        if trace is None:
            return None
        runs.append((sample, trace))
    size = size_of(runs[MIDDLE][1]) or 1.0
    traces = [trace for _, trace in runs]
    pairs = list(itertools.combinations(traces, 2))
    lost = [time for one, other in pairs if (time := lost_at(one, other, size)) is not None]
    # Where any two runs agree to the end, rounding errors have not grown so far: the others differ by their tolerances.
    parted = len(lost) == len(pairs)
    early = max(distance(one.position[1], other.position[1], size)[0] for one, other in pairs)
    bar, bar_rms, differences = _bars(runs, size)
    middle = runs[MIDDLE][0]
    assert middle.end is not None
    return ReferenceSolution(
        integrator=machine.name,
        order=machine.order,
        steps=LOOKS,
        end=middle.end,
        size=size,
        bar=bar,
        bar_rms=bar_rms,
        trusted=bar < MEANING,
        differences=differences,
        meaning=max(lost) if parted else min(lost, default=None),
        by_rounding=parted and early < ROUNDED,
        control=machine.integrator.controlled_by,
        tolerance=tolerances(machine.name)[MIDDLE],
    )


def finer(machine: Machine, known: ReferenceSolution, budget: Budget, *, add: Callable[[Sample], None]) -> ReferenceSolution:
    """The reference by this method, or the known reference where the new one is no better or contradicts it.

    The run must lie within the bar of the known reference, which was computed by another method.
    """
    found = alone(machine, budget, add=add)
    if found is None or found.bar >= known.bar:
        return known
    if distance(found.end, known.end, known.size)[0] > known.bar + found.bar:
        return known
    return replace(found, size=known.size, meaning=known.meaning)


def _bars(runs: list[tuple[Sample, Trace]], size: float) -> tuple[float, float, list[float]]:
    """The largest differences of the ends, largest and root mean square over the particles, and the former of each pair."""
    ends = [sample.end for sample, _ in runs if sample.end is not None]
    found = [distance(one, other, size) for one, other in itertools.combinations(ends, 2)]
    largest, rms = ([pair[part] for pair in found] for part in (0, 1))
    return max(SEEN * max(largest), 2.0**-52), max(SEEN * max(rms), 2.0**-52), largest
