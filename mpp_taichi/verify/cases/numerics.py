"""Reproducible numbers: the same bits again, on any number of threads, there and back; effects of zero; numbers that end."""

import math
from typing import Any

import numpy as np

from mpp_taichi.device.thread_count import processors
from mpp_taichi.errors import MppError, StabilityError
from mpp_taichi.precision import PRECISIONS
from mpp_taichi.verify.bounds import rounding
from mpp_taichi.verify.case import Found, case
from mpp_taichi.verify.cases._random_bodies import random_bodies
from mpp_taichi.verify.cases._two_bodies import orbit, period
from mpp_taichi.verify.place import Place

BITS = "comparison of all bits"
EXACT = "no bit may differ"


def _cluster(count: int) -> dict[str, Any]:
    forces = [{"newtonian_gravity": {"strength": 1.0, "softening": 0.125}}]
    return {"particles": random_bodies(count), "forces": forces, "integrator": {"leapfrog": {"dt": 2.0**-8}}}


def _end(place: Place, scene: dict[str, Any], steps: int) -> np.ndarray:
    with place.simulation(scene) as simulation:
        simulation.run(steps=steps)
        end = simulation.snapshot()
    return np.concatenate([end.position, end.velocity])


def _differing(first: np.ndarray, second: np.ndarray) -> float:
    return float(np.count_nonzero(first.view(np.uint64) != second.view(np.uint64)))


@case("A run repeated has the same bits", BITS, quick=True, solved_in=PRECISIONS)
def repeated(place: Place) -> Found:
    """300 bodies, 20 steps, compiled and run twice."""
    ends = [_end(place, _cluster(300), 20) for _ in range(2)]
    return Found(_differing(*ends), 0.0, EXACT)


@case("The bits of a run do not depend on the number of threads", BITS, quick=True, solved_in=PRECISIONS)
def threads(place: Place) -> Found:
    """1,200 bodies, 5 steps, on one thread and on two, and on three where there are so many processors."""
    if place.backend != "cpu":
        return Found(0.0, 0.0, "a device has no number of threads to choose; see the case of a run repeated")
    ends = [
        _end(Place(place.backend, place.precision, count), _cluster(1200), 5)
        for count in (1, 2, *([3] if processors() > 2 else []))
    ]
    return Found(max(_differing(ends[0], each) for each in ends[1:]), 0.0, EXACT)


@case("A run in two parts has the bits of a run in one", BITS, solved_in=PRECISIONS)
def in_two_parts(place: Place) -> Found:
    """40 bodies, 100 steps at once, or 37 and 63."""
    with place.simulation(_cluster(40)) as simulation:
        simulation.run(steps=100)
        once = simulation.snapshot().position
        simulation.restart()
        simulation.run(steps=37)
        simulation.run(steps=63)
        return Found(_differing(once, simulation.snapshot().position), 0.0, EXACT)


@case("An effect of strength zero changes no bit", BITS, quick=True, solved_in=PRECISIONS)
def nothing(place: Place) -> Found:
    """Charges with a constant of zero, and a drag of zero, beside gravity."""
    plain = _cluster(40)
    more = plain | {"forces": [*plain["forces"], {"coulomb": {"coulomb_constant": 0.0}}, {"linear_drag": {"coefficient": 0.0}}]}
    return Found(_differing(_end(place, plain, 50), _end(place, more, 50)), 0.0, EXACT)


@case(
    "A reversible method returns after 10⁴ steps there and back",
    "reversibility of the leapfrog",
    quick=True,
    solved_in=PRECISIONS,
)
def there_and_back(place: Place) -> Found:
    """An orbit of eccentricity 0.5, 100 revolutions of 100 steps forwards, and as many backwards."""
    steps = 10_000
    with place.simulation(orbit(0.5, {"leapfrog": {"dt": period() / 100}})) as simulation:
        begin = simulation.snapshot().position
        simulation.run(steps=steps)
        simulation.dt = -simulation.dt
        simulation.run(steps=steps)
        back = float(np.abs(simulation.snapshot().position - begin).max())
    bound, why = rounding(place, steps=2 * steps, stages=1, phase=2.0 * math.pi * 200, leverage=2.0)
    return Found(back, bound, why)


@case("The time after n steps is n steps", "t = n dt", quick=True, solved_in=PRECISIONS)
def time(place: Place) -> Found:
    """30,000 steps of 0.1 of a body that flies alone."""
    body = {"body": {"mass": 1.0, "position": [0, 0, 0], "velocity": [0.5, 0, 0]}}
    with place.simulation({"particles": [body], "integrator": {"leapfrog": {"dt": 0.1}}}) as simulation:
        simulation.run(steps=30_000)
        off = abs(simulation.time - 3_000.0)
    return Found(off, 2.0**-53 * 3_000.0, "one rounding of the product n dt in double precision")


@case(
    "A number that is no longer finite is told with its particle",
    "an explicit step beyond the limit of a spring",
    quick=True,
    solved_in=PRECISIONS,
)
def not_finite(place: Place) -> Found:
    """The amplitude grows (2.6 times in a step) until numbers overflow; the run has to stop there, or to be refused before."""
    bodies = [
        {"body": {"name": "wall", "mass": 1.0, "position": [0, 0, 0], "free": False}},
        {"body": {"name": "ball", "mass": 1.0, "position": [1.5, 0, 0]}},
    ]
    link = {"link": {"between": ["wall", "ball"], "stiffness": 1.0, "rest_length": 1.0}}
    scene = {"particles": bodies, "springs": [link], "integrator": {"leapfrog": {"dt": 2.2}}}
    try:
        with place.simulation(scene) as simulation:
            simulation.run(steps=2000)
            ended = np.isfinite(simulation.snapshot().position).all() and simulation.verdict.is_sound
    except StabilityError as error:
        named = error.particle == 1 or "ball" in str(error) or "limit" in str(error)
        return Found(
            0.0 if named else math.inf, 0.5, "0: the run ends with the particle or the limit; infinite: neither is named"
        )
    except MppError:
        return Found(0.0, 0.5, "0: the step is refused in words before the run")
    return Found(math.inf if ended else 0.0, 0.5, "0: the run calls itself inaccurate; infinite: nothing is said")
