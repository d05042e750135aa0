"""A reference by Gauss–Radau: compensated sums keep its round-off below the round-off of runs with equal steps."""

import itertools
from dataclasses import replace
from typing import Any

from mpp_taichi import component
from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.methods import LOOKS
from mpp_taichi.accuracy.reference import ReferenceSolution, distance
from mpp_taichi.accuracy.workbench import Machine

TOLERANCES = (1e-9, 3e-10, 1e-10)  # steps in the ratio 1 : 0.84 : 0.72: all reach round-off, with independent roundings
MIDDLE = 1


def method() -> str:
    """The integrator that gives the reference."""
    return component.marked("integrators", "reference_method")[0]


def finer(machine: Machine, known: ReferenceSolution, budget: Budget, *, add: Any) -> ReferenceSolution:
    """The reference by this method, or the known reference where the new one is no better or contradicts it.

    The error bar is the largest difference of three runs with different steps, whose roundings are independent; the run must
    lie within the bar of the known reference, which was computed by another method.
    """
    ends = []
    for tolerance in TOLERANCES:
        sample, _ = machine.run(machine.configuration(LOOKS, tolerance), budget)
        add(sample)
        if sample.end is None:
            return known
        ends.append(sample.end)
    pairs = [distance(one, other, known.size) for one, other in itertools.combinations(ends, 2)]
    bar, bar_rms = (max(pair[part] for pair in pairs) for part in (0, 1))
    agree = distance(ends[MIDDLE], known.end, known.size)[0] <= known.bar + bar
    if not agree or bar >= known.bar:
        return known
    return replace(
        known,
        integrator=method(),
        order=machine.order,
        steps=LOOKS,
        end=ends[MIDDLE],
        bar=max(bar, 2.0**-52),
        bar_rms=max(bar_rms, 2.0**-52),
        differences=[pair[0] for pair in pairs],
        control=machine.integrator.controlled_by,
        tolerance=TOLERANCES[MIDDLE],
    )
