"""The longest stable step of every integrator on a spring, found by trying steps, beside the step that the program advises."""

import contextlib
import logging
import math
from collections.abc import Iterator

import numpy as np

from mpp_taichi.errors import StabilityError
from mpp_taichi.simulation.simulation import Simulation
from mpp_taichi.verify.case import Case, Found
from mpp_taichi.verify.cases._methods import with_steps
from mpp_taichi.verify.place import Place

START = 1e-9  # displacement of a mass at the end of a spring of length 1: the motion is linear until it grows a millionfold
STEPS, SAMPLED_EVERY = 4000, 200
GROWN = 1e3  # in amplitude; below its limit by a thousandth leapfrog swings by 22 times the displacement
OUTSIDE = (1.0001, 1.001, 1.01, 1.1)  # of the limit: an accurate method may be stable again beyond a narrow gap
HALVINGS = 12
UNSTABLE = 0.5  # radians in a step of a method without a stable step
INSIDE, FAR = 0.999, 1.1
RESOLVED = 1e-4  # of the limit: four times the last interval of the search
LONG = 100.0  # radians in a step of a method without a limit
SOURCE = "eigenvalues of a step of the oscillator x″ = −x; Hairer, Lubich, Wanner, Geometric Numerical Integration (2006)"


def _limit_of(name: str) -> Case:
    def ask(place: Place) -> Found:
        scene = {
            "particles": [
                {"body": {"mass": 1, "position": [0, 0, 0], "free": False}},
                {"body": {"mass": 1, "position": [1 + START, 0, 0], "free": [True, False, False]}},
            ],
            "springs": [{"link": {"between": [0, 1], "stiffness": 1, "rest_length": 1}}],
            "integrator": {name: {"dt": 1.0}},
        }
        with place.simulation(scene, force=True) as simulation, _unadvised():
            advice = simulation.step_advice
            limit = math.inf if advice is None else advice.placed_limit
            if math.isinf(limit):
                return Found(_growth(simulation, LONG), GROWN, f"no limit is advised: {STEPS} steps of {LONG:g}/ω grow by less")
            if limit == 0.0:
                growth = _growth(simulation, UNSTABLE)
                return Found(1.0 / growth, 1.0 / GROWN, f"every step is unstable: {STEPS} steps of {UNSTABLE:g}/ω grow by more")
            expected = _expected(simulation, limit)
            if expected > FAR * limit:
                growth = _growth(simulation, INSIDE * limit)
                return Found(
                    growth, GROWN, f"{INSIDE:g} of the limit advised, {limit:.6g}/ω; growth beyond it is too slow to see"
                )
            found = _search(simulation, limit)
        late = expected / limit - 1.0
        why = (
            f"the limit found is {found:.6g}/ω and the limit advised {limit:.6g}/ω; by the eigenvalues the amplitude grows "
            f"{GROWN:g} times in {STEPS} steps from {expected:.6g}/ω on; {RESOLVED:g} for the search, and half of the excess "
            f"{late:.2g} for the start, which need not lie along the growing mode"
        )
        return Found(abs(found / expected - 1.0), RESOLVED + 0.5 * abs(late), why)

    title = f"{name} becomes unstable on a spring where the program says"
    return Case(f"limit_of_{name}", "stability_limits", title, SOURCE, ask, name in ("leapfrog", "rk4"), ("f64",), ("f64",))


@contextlib.contextmanager
def _unadvised() -> Iterator[None]:
    """Without the warnings about steps beyond a limit, of which a search takes a dozen."""
    log = logging.getLogger("mpp_taichi")
    level = log.level
    log.setLevel(logging.ERROR)
    try:
        yield
    finally:
        log.setLevel(level)


def _search(simulation: Simulation, limit: float) -> float:
    """The longest stable step, by bisection between nine tenths of the limit and the first unstable step beyond it."""
    low = 0.9 * limit
    if _growth(simulation, low) > GROWN:
        return 0.0
    high = next((part * limit for part in OUTSIDE if _growth(simulation, part * limit) > GROWN), math.inf)
    for _ in range(HALVINGS if math.isfinite(high) else 0):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if _growth(simulation, middle) > GROWN else (middle, high)
    return 0.5 * (low + high)


def _expected(simulation: Simulation, limit: float) -> float:
    """The step from which on the spectral radius of a step of x″ = −x makes the amplitude grow so much; infinite if far."""

    def grows(dt: float) -> bool:
        radius = float(np.abs(np.linalg.eigvals(simulation.integrator.amplification(dt, 0.0))).max())
        return STEPS * math.log(radius) > math.log(GROWN)

    steps = (part * limit for part in np.geomspace(1.00001, FAR, 1000))
    low, high = limit, next((dt for dt in steps if grows(dt)), math.inf)
    for _ in range(40 if math.isfinite(high) else 0):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if grows(middle) else (middle, high)
    return float(high)


def _growth(simulation: Simulation, dt: float) -> float:
    """The largest amplitude of twenty samples of a run, divided by the amplitude of the start; infinite where it overflows."""
    simulation.dt = dt
    simulation.restart()
    largest = 1.0
    for _ in range(STEPS // SAMPLED_EVERY):
        try:
            simulation.run(steps=SAMPLED_EVERY, judge="off")
        except StabilityError:
            return math.inf
        end = simulation.snapshot()
        amplitude = math.hypot(end.position[1, 0] - 1.0, end.velocity[1, 0]) / START
        largest = max(largest, amplitude if math.isfinite(amplitude) else math.inf)
        if largest > GROWN:
            break
    return largest


LIMITS = [_limit_of(name) for name in with_steps()]
