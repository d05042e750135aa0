"""Families: kinds of scenes, the methods that promise to do well in them, and the methods that have one code in common.

A method says by its flag `promising_for` for which kinds of scenes it is made:

    encounters  bodies may come close to each other, under a force that grows without bound
    planets     all bodies orbit one heavy body
    stiffness   stability alone asks for very many explicit steps
"""

from collections.abc import Collection

from mpp_taichi.accuracy.methods import StudyMethod, promise
from mpp_taichi.accuracy.problem import Problem

ENCOUNTERS, PLANETS, STIFFNESS = "encounters", "planets", "stiffness"
MOST_BODIES = 1000  # that meet: of more bodies some are always close to each other, and a step for all of them is short
STIFF_STEPS = 10_000  # that the stability of an explicit method asks for


def meets(problem: Problem) -> bool:
    """Whether bodies may come close to each other under a force that grows without bound."""
    unbounded = any(
        force.flag("forces", "singular_at_zero_distance") and not force.parameters.get("softening")
        for stretch in problem.stretches
        for force in stretch.spec.forces
    )
    return unbounded and 2 <= problem.start.particle_count <= MOST_BODIES


def kinds_of(problem: Problem, found: Collection[StudyMethod]) -> set[str]:
    """The kinds of scenes to which a problem belongs; `found` are the methods that suit it."""
    kinds = {ENCOUNTERS} if meets(problem) else set()
    if any(PLANETS in method.promising_for for method in found):  # it suits no scene without a central body
        kinds.add(PLANETS)
    if max((method.fewest_steps for method in found), default=1) >= STIFF_STEPS:
        kinds.add(STIFFNESS)
    return kinds


def promised(problem: Problem, found: dict[str, StudyMethod]) -> set[str]:
    """The names of the methods that are made for a kind of scene to which the problem belongs."""
    kinds = kinds_of(problem, found.values())
    return {name for name, method in found.items() if kinds & set(method.promising_for)}


def representatives(found: Collection[StudyMethod]) -> set[str]:
    """The name of the method of each family by which the family is tried: made for some kind, and of the highest order."""
    best: dict[str, StudyMethod] = {}
    for method in sorted(found, key=lambda method: (bool(method.promising_for), promise(method))):
        best[method.family] = method
    return {method.name for method in best.values()}
