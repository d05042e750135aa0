"""Orders, reversibility and conservation of every integrator, on an orbit about a heavy body, in double precision."""

import math

import numpy as np

from mpp_taichi import component
from mpp_taichi.device.backends import import_taichi
from mpp_taichi.errors import StabilityError
from mpp_taichi.simulation.simulation import Simulation
from mpp_taichi.verify.bounds import rounding
from mpp_taichi.verify.case import Case, Found
from mpp_taichi.verify.cases._methods import with_steps
from mpp_taichi.verify.cases._two_bodies import orbit, period, separation
from mpp_taichi.verify.place import DOUBLE, Place

KEPLER = "Kepler's equation, solved by Newton's method in double precision"
ORDER_ECCENTRICITY, DRIFT_ECCENTRICITY, BACK_ECCENTRICITY = 0.6, 0.3, 0.5
PART = 0.4  # of a revolution from pericentre: no second pericentre cancels the error of the first
COARSEST, FINEST, FINEST_IMPLICIT = 10, 1 << 16, 1 << 11  # steps in this part; an implicit step is many launches on devices
APART = 1.25  # steps of a rung over those of the rung before
RUNGS = 5
SLOPE_OFF = 0.1
FINE_ENOUGH = 2e-11  # an error at which the ladder ends
FLOOR = 5e-13  # times the square root of the steps: errors below it may be rounding
BACK_STEPS, BACK_IN_A_TURN = 1000, 300
DRIFT_STEPS, DRIFT_IN_A_TURN = 100_000, 250
DRIFT_STEPS_OF_LAUNCHES = 10_000  # where each stage is a launch; with more, software devices would take minutes
DOUBLES = {"solved_in": ("f64",), "on": ("f64",)}
QUICK = ("leapfrog", "velocity_verlet", "rk4", "yoshida4", "pefrl", "hermite4", "implicit_midpoint", "dop853")


def _declared(name: str, attribute: str) -> float:
    import_taichi()  # the class of a method may compute what it declares
    found: float = getattr(component.build("integrators", name, {"dt": 1.0}), attribute)
    return found


def _is_implicit(name: str) -> bool:
    import_taichi()
    from mpp_taichi.integrators._implicit import Implicit

    return issubclass(component.load("integrators", name), Implicit)


def _stages(name: str) -> int:
    return max(1, int(_declared(name, "evaluations")))


def _order_of(name: str) -> Case:
    def ask(place: Place) -> Found:
        time, order = PART * period(), _declared(name, "order")
        finest = FINEST_IMPLICIT if _is_implicit(name) else FINEST
        found: list[tuple[int, float]] = []
        with place.simulation(orbit(ORDER_ECCENTRICITY, {name: {"dt": time / COARSEST}})) as simulation:
            count = COARSEST
            while count <= finest and (not found or found[-1][1] > FINE_ENOUGH):
                error = _error_after(simulation, time, count)
                if error < FLOOR * math.sqrt(count):
                    break
                found.append((count, error))
                count = round(count * APART)
        if len(found) < RUNGS:
            return Found(math.inf, SLOPE_OFF, "the errors reach rounding before five of them lie on a line")
        steps, errors = np.array(found[-RUNGS:]).T
        slope = -float(np.polyfit(np.log(steps), np.log(errors), 1)[0])
        why = (
            f"slope {slope:.3f} over {int(steps[0])} to {int(steps[-1])} steps, order {order:g}; the next term of the error, "
            f"up to a tenth of the first, lowers the slope by less than {SLOPE_OFF}; a small first term raises it by up to 1"
        )
        return Found(max(order - slope, slope - order - 1.0, 0.0), SLOPE_OFF, why)

    title = f"{name} has the order that it declares"
    return Case(f"order_of_{name}", "orders", title, KEPLER, ask, name in QUICK, **DOUBLES)


def _error_after(simulation: Simulation, time: float, count: int) -> float:
    """The error of the place after so many steps; infinite where the steps are too long for the method."""
    simulation.dt = time / count
    simulation.restart()
    try:
        simulation.run(steps=count)
    except StabilityError:
        return math.inf
    position = simulation.snapshot().position
    return float(np.linalg.norm(position[1] - position[0] - separation(ORDER_ECCENTRICITY, 2.0 * math.pi * PART)))


def _return_of(name: str) -> Case:
    def ask(place: Place) -> Found:
        with place.simulation(orbit(BACK_ECCENTRICITY, {name: {"dt": period() / BACK_IN_A_TURN}})) as simulation:
            begin = simulation.snapshot().position
            simulation.run(steps=BACK_STEPS)
            simulation.dt = -simulation.dt
            simulation.run(steps=BACK_STEPS)
            back = float(np.abs(simulation.snapshot().position - begin).max())
        steps, turns = 2 * BACK_STEPS, 2 * BACK_STEPS / BACK_IN_A_TURN
        return Found(
            back,
            *rounding(
                place, steps=steps, stages=_stages(name), phase=2.0 * math.pi * turns, leverage=1.0 / (1.0 - BACK_ECCENTRICITY)
            ),
        )

    title = f"{name} returns to its start when the time is reversed"
    return Case(f"return_of_{name}", "orders", title, "time reversibility", ask, name == "leapfrog", **DOUBLES)


def _drift_of(name: str) -> Case:
    def ask(place: Place) -> Found:
        with place.simulation(orbit(DRIFT_ECCENTRICITY, {name: {"dt": period() / DRIFT_IN_A_TURN}})) as simulation:
            first = _energies_of_a_turn(simulation)
            steps = DRIFT_STEPS if place.backend == "cpu" else DRIFT_STEPS_OF_LAUNCHES
            simulation.run(steps=steps - 2 * DRIFT_IN_A_TURN)
            last = _energies_of_a_turn(simulation)
        swing = float(np.ptp(first) / abs(np.mean(first)))
        number = steps * _stages(name)
        rounded = 3.0 * 2.0 / (1.0 - DRIFT_ECCENTRICITY) * math.sqrt(3.0 * number) * DOUBLE
        why = (
            f"one of {DRIFT_IN_A_TURN} samples of an energy that swings by {swing:.1g}, by which two turns may differ, and "
            f"three standard deviations of √(3 n) roundings of 2u/(1 − e), n = {number:,} stages"
        )
        return Found(float(abs(np.mean(last) / np.mean(first) - 1.0)), swing / DRIFT_IN_A_TURN + rounded, why)

    title = f"The energy of {name} has no drift in 10⁵ steps"
    source = "symplectic methods keep an energy near the true energy"
    return Case(f"drift_of_{name}", "orders", title, source, ask, name == "leapfrog", **DOUBLES)


def _energies_of_a_turn(simulation: Simulation) -> np.ndarray:
    """The total energy after each step of about a revolution."""
    found = []
    for _ in range(DRIFT_IN_A_TURN):
        simulation.run(steps=1)
        found.append(simulation.diagnostics()["total_energy"])
    return np.array(found)


ORDERS = [_order_of(name) for name in with_steps()]
RETURNS = [_return_of(name) for name in with_steps() if _declared(name, "time_reversible")]
DRIFTS = [_drift_of(name) for name in with_steps() if _declared(name, "symplectic")]
