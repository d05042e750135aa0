"""Families of a GPU round: a scene with any number of particles, the unit of its rate, and the work of a step."""

import math
from collections.abc import Callable
from dataclasses import dataclass

SOFTENING = 0.01
PACKING = 0.2  # part of the volume that spheres fill
DT = 1e-6  # [time]: hardly anything moves, so that each step does the same work
STAR, PLANET = 1.0, 1e-3
REPLICA_FLOPS = 3 * 20.0 + 3 * 3 * 4.0  # three pairs by the convention of the table, and four operations for each coordinate


def _cluster(count, **solver):
    return {
        "particles": [{"plummer": {"count": count}}],
        "forces": [{"newtonian_gravity": {"softening": SOFTENING, **solver}}],
        "integrator": {"leapfrog": {"dt": DT}},
    }


def _side(count):
    return max(2, round(math.sqrt(count)))


def springs_of(count):
    """Springs of the membrane: those along its rows and columns."""
    side = _side(count)
    return 2 * side * (side - 1)


def _membrane(count):
    side = _side(count)
    return {
        "particles": [{"lattice": {"name": "net", "shape": [side, side], "lower": [0, 0, 0], "upper": [side, side, 0]}}],
        "springs": [{"lattice_links": {"of": "net", "stiffness": 100.0}}],
        "integrator": {"leapfrog": {"dt": DT}},
    }


def _spheres(count):
    edge = (4 / 3 * math.pi * count / PACKING) ** (1 / 3)
    return {
        "particles": [{"gas": {"count": count, "lower": [0, 0, 0], "upper": [edge] * 3, "radius": 1.0, "temperature": 1.0}}],
        "contacts": {"hard_spheres": {"solver": "pairwise"}},
        "walls": [{"box": {"lower": [0, 0, 0], "upper": [edge] * 3}}],
        "integrator": {"leapfrog": {"dt": 1e-3}},
    }


def _three_bodies(method):
    def scene(count):
        bodies = ((STAR, 0.0, 0.0), (PLANET, 1.0, 1.0), (PLANET, 5.0, 0.44))
        return {
            "particles": [{"body": {"mass": m, "position": [x, 0, 0], "velocity": [0, v, 0]}} for m, x, v in bodies],
            "forces": [{"newtonian_gravity": {}}],
            "integrator": {method: {"dt": 0.01 if method == "leapfrog" else 0.2}},
        }

    return scene


@dataclass(frozen=True)
class Family:
    """One kind of scene. `copies`: the count is that of copies of one small scene, a thread for each.

    unit       what a rate counts in a second
    counts     the sizes, from the smallest on
    precisions those in which the family is measured, on a device that has them
    scene      the scene of a count, as a mapping
    amount     what a step of a count has of the unit
    """

    name: str
    unit: str
    counts: tuple[int, ...]
    precisions: tuple[str, ...]
    scene: Callable
    amount: Callable = lambda count: count
    copies: bool = False


def _from(least, sizes):
    return tuple(least * 4**k for k in range(sizes))


ALL = ("f32", "ds", "f64")
TWO = ("f32", "f64")
FAMILIES = {
    each.name: each
    for each in (
        Family("pairs", "pair interactions/s", _from(1024, 7), ALL, _cluster, lambda count: count * count),
        Family("tree", "bodies/s", _from(16_384, 6), TWO, lambda count: _cluster(count, solver="tree")),
        Family("springs", "springs/s", _from(1024, 8), ALL, _membrane, springs_of),
        Family("spheres", "sphere steps/s", _from(1024, 6), TWO, _spheres),
        Family("replicas", "three-body steps/s", _from(1024, 6), ALL, _three_bodies("leapfrog"), copies=True),
        Family("adaptive", "steps of members/s", _from(1024, 4), ("f64",), _three_bodies("ias15"), copies=True),
    )
}
