"""Scaling: scenes with the same effects and more and more particles, and the size at which one backend overtakes another."""

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any

from mpp_taichi.compare.busy import QUIET_SPREAD
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot

COUNTS = tuple(2 * 4**k for k in range(12))  # 2, 8, 32, … 8,388,608
LONGEST_STEP = 2.0  # seconds: larger sizes, with longer steps, are not run
STEPS_WANTED = 4.0  # steps that a size takes, besides compilation: one to compile and two to time
DT = 1e-9  # [time]: nothing moves, so that every backend and size does the same work


def refusal(spec: SceneSpec) -> str | None:
    """The reason why no scenes like this one are generated; None where they are."""
    if spec.limited_springs:
        return "scenes with springs that break or yield are not generated"
    return "scenes with contacts are not generated" if spec.contacts is not None or spec.walls else None


def scene_of(spec: SceneSpec, start: Snapshot, count: int) -> dict[str, Any]:
    """A scene with about `count` particles, as a mapping: a square lattice with springs, or else a Plummer sphere."""
    forces = [
        {force.name: {key: value for key, value in force.parameters.items() if key != "of" and value is not None}}
        for force in spec.forces
    ]
    scene: dict[str, Any] = {
        "title": f"{count} particles",
        "forces": forces,
        "integrator": {spec.integrator.name: {**spec.integrator.parameters, "dt": DT}},
    }
    if not len(start.springs):
        return {**scene, "particles": [{"plummer": {"count": count}}]}
    side = max(2, round(math.sqrt(count)))
    springs = start.springs
    stiffness, damping = float(springs.stiffness.max()), float(springs.damping.max())
    return {
        **scene,
        "particles": [
            {"lattice": {"name": "net", "shape": [side, max(1, count // side)], "lower": [0, 0, 0], "upper": [side, side, 0]}}
        ],
        "springs": [
            {"lattice_links": {"of": "net", "stiffness": stiffness, "damping": damping}},
            *(
                [{"lattice_links": {"of": "net", "neighbors": "diagonal", "stiffness": stiffness, "damping": damping}}]
                if count // side > 1
                else []
            ),
        ],
    }


def fits(seen: Sequence[tuple[int, float]], walls: Sequence[float], count: int, seconds: float) -> bool:
    """Whether the next size can be made and timed in the given seconds, if steps keep growing as before, at worst as N².

    `walls` are the total seconds of each size so far; their increase grows fourfold, as the sizes do.
    """
    if seconds <= 0.0:
        return False
    if not seen:
        return True
    growth = walls[-1] - walls[-2] if len(walls) > 1 else 0.0
    if walls[-1] + 4.0 * max(0.0, growth) > seconds:
        return False
    last, taken = seen[-1]
    power = 1.0
    if len(seen) > 1:
        earlier, before = seen[-2]
        power = min(2.0, max(0.0, math.log(taken / before) / math.log(last / earlier)))
    predicted = taken * (count / last) ** power
    return predicted < LONGEST_STEP and STEPS_WANTED * predicted < seconds


def crossovers(curves: Mapping[str, Sequence[tuple[int, float]]]) -> list[dict[str, Any]]:
    """The sizes at which one row becomes faster than another of its precision, interpolated between two sizes in logarithms.

    Sizes at which both rows take the same time, within the spread of their repeats, are skipped.
    """
    found = []
    for (one, first), (other, second) in itertools.combinations(curves.items(), 2):
        if one.split()[-1] != other.split()[-1]:
            continue
        seconds = dict(second)
        ratios = [(count, math.log(taken / seconds[count])) for count, taken in first if count in seconds]
        common = [(count, ratio) for count, ratio in ratios if abs(ratio) > QUIET_SPREAD]
        for (low, before), (high, after) in itertools.pairwise(common):
            if before * after < 0.0:
                place = math.log(low) + (math.log(high) - math.log(low)) * before / (before - after)
                faster = one if after < 0.0 else other
                found.append({"faster": faster, "than": other if faster == one else one, "from": round(math.exp(place))})
    return found
