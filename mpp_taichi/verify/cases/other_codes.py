"""The same scene in other codes: REBOUND, heyoka and SciPy, each where it is installed; else the row says what is missing."""

import importlib
import math
from typing import Any

import numpy as np

from mpp_taichi.errors import MissingPackageError
from mpp_taichi.missing_package import is_absent
from mpp_taichi.simulation.simulation import Simulation
from mpp_taichi.verify.bounds import grown, rounding
from mpp_taichi.verify.case import Found, case
from mpp_taichi.verify.cases._published import bodies, gravity
from mpp_taichi.verify.cases._two_bodies import orbit, period
from mpp_taichi.verify.place import Place, sound

REBOUND = "REBOUND, H. Rein and S.-F. Liu, Astron. Astrophys. 537 (2012) A128"
HEYOKA = "heyoka, F. Biscani and D. Izzo, Mon. Not. R. Astron. Soc. 504 (2021) 2614"
SCIPY = "SciPy's DOP853, P. Virtanen et al., Nature Methods 17 (2020) 261"

STEPS, IN_A_TURN = 2000, 100
ECCENTRICITY, TURNS = 0.8, 10.25
STAGES_OF_IAS15 = 14  # two passes of seven places in most of its steps
SPRING_STEPS, SHIFT = 3000, 1e-6
SPRING, LENGTH, PULL = 40.0, 1.0, 9.81
BOTH = 2.0  # rounding errors of two codes


def _solved(module: str, *precisions: str) -> tuple[str, ...]:
    """The precisions in which a row has to be solved: none where the other code is not installed."""
    return () if is_absent(module) else precisions


def _code(name: str) -> Any:
    package = name.partition(".")[0]
    if is_absent(package):
        raise MissingPackageError(f"{package} is not installed here; with `pip install {package}` the row is asked")
    return importlib.import_module(name)


def _planets(method: dict[str, Any]) -> dict[str, Any]:
    """A star with two planets, the second on an inclined orbit with 2.5 times the period of the first."""
    places = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.842, 0.03]]
    motions = [[0.0, -1e-3, 0.0], [0.0, 1.02, 0.0], [-0.74, 0.0, 0.02]]
    return gravity(bodies([1, 1e-3, 3e-4], places, motions), method)


def _in_rebound(simulation: Simulation, integrator: str) -> Any:
    other = _code("rebound").Simulation()
    other.integrator, other.G = integrator, 1.0
    start = simulation.start
    for m, x, v in zip(start.mass.tolist(), start.position.tolist(), start.velocity.tolist(), strict=True):
        other.add(m=m, x=x[0], y=x[1], z=x[2], vx=v[0], vy=v[1], vz=v[2])
    return other


def _apart(simulation: Simulation, theirs: Any) -> float:
    sound(simulation)
    return float(np.abs(simulation.snapshot().position - np.array(theirs, float)).max())


@case("leapfrog takes the steps of REBOUND's leapfrog", REBOUND, quick=True, solved_in=_solved("rebound", "f64", "f32"))
def leapfrog_is_rebounds(place: Place) -> Found:
    """Both are drift, kick, drift, so that only rounding is between them."""
    dt = period() / IN_A_TURN
    with place.simulation(_planets({"leapfrog": {"dt": dt}})) as simulation:
        other = _in_rebound(simulation, "leapfrog")
        other.dt = dt
        simulation.run(steps=STEPS)
        other.steps(STEPS)
        apart = _apart(simulation, [each.xyz for each in other.particles])
    bound, why = rounding(place, steps=STEPS, stages=1, phase=math.tau * STEPS / IN_A_TURN, leverage=1.0 / 0.9)
    return Found(apart, BOTH * bound, f"two codes with {why}")


@case("wisdom_holman takes the steps of REBOUND's WHFast", REBOUND, on=("f64",), solved_in=_solved("rebound", "f64"))
def wisdom_holman_is_whfast(place: Place) -> Found:
    """Both drift along Kepler's orbits in Jacobi's coordinates, without a corrector."""
    dt = period() / 20
    with place.simulation(_planets({"wisdom_holman": {"dt": dt, "corrector": 0}})) as simulation:
        other = _in_rebound(simulation, "whfast")
        other.dt, other.integrator.safe_mode = dt, 0
        simulation.run(steps=STEPS)
        other.steps(STEPS)
        other.synchronize()
        apart = _apart(simulation, [each.xyz for each in other.particles])
    bound, why = rounding(place, steps=STEPS, stages=4, phase=math.tau * STEPS / 20, leverage=1.0 / 0.9)
    return Found(apart, BOTH * bound, f"two codes with {why}")


@case("ias15 agrees with REBOUND's IAS15 on an eccentric orbit", REBOUND, on=("f64",), solved_in=_solved("rebound", "f64"))
def ias15_is_rebounds(place: Place) -> Found:
    """Both solve each step to rounding."""
    until = TURNS * period()
    with place.simulation(orbit(ECCENTRICITY, {"ias15": {}})) as simulation:
        other = _in_rebound(simulation, "ias15")
        simulation.run(until=until)
        other.integrate(until)
        apart, steps = _apart(simulation, [each.xyz for each in other.particles]), simulation.step_count
    return Found(apart, *_of_eccentric_orbit(place, steps, STAGES_OF_IAS15))


@case("taylor agrees with heyoka on an eccentric orbit", HEYOKA, on=("f64",), solved_in=_solved("heyoka", "f64"))
def taylor_is_heyokas(place: Place) -> Found:
    """Both solve each step to rounding, by a series in time."""
    until = TURNS * period()
    with place.simulation(orbit(ECCENTRICITY, {"taylor": {"dt": 0.05}})) as simulation:
        start, heyoka = simulation.start, _code("heyoka")
        system = heyoka.model.nbody(2, masses=start.mass.tolist(), Gconst=1.0)
        state = np.hstack([start.position, start.velocity]).ravel().tolist()
        other = heyoka.taylor_adaptive(system, state)
        simulation.run(until=until)
        other.propagate_until(until)
        apart, steps = _apart(simulation, np.reshape(other.state, (2, 6))[:, :3]), simulation.step_count
    return Found(apart, *_of_eccentric_orbit(place, steps, 1))


def _of_eccentric_orbit(place: Place, steps: int, stages: int) -> tuple[float, str]:
    bound, why = rounding(place, steps=steps, stages=stages, phase=math.tau * TURNS, leverage=1.0 / (1.0 - ECCENTRICITY))
    return BOTH * bound, f"two codes with {why}"


@case("two masses on springs swing as in SciPy", SCIPY, quick=True, solved_in=_solved("scipy", "f64", "f32"))
def springs_are_scipys(place: Place) -> Found:
    """A double pendulum of springs: large stretches and angles, of which no closed form is known."""
    hung = [[0.0, 0.0], [1.2, -0.3], [1.5, -1.4]]
    until = 3.0
    links = [{"link": {"between": [k, k + 1], "stiffness": SPRING, "rest_length": LENGTH}} for k in range(2)]
    scene = gravity(bodies([1, 1, 1], hung, np.zeros((3, 2))), {"kahan_li8": {"dt": until / SPRING_STEPS}})
    scene |= {"forces": [{"uniform_gravity": {"acceleration": [0, -PULL]}}], "springs": links}
    scene["particles"][0]["body"]["free"] = False
    with place.simulation(scene) as simulation:
        simulation.run(steps=SPRING_STEPS)
        sound(simulation)
        found = simulation.snapshot().position[1:, :2].ravel()
    start = np.array([*hung[1], *hung[2], 0, 0, 0, 0], float)
    theirs, coarser = (_in_scipy(start, until, tolerance) for tolerance in (3e-14, 3e-13))
    shifts = [np.abs(_in_scipy(start + SHIFT * axis, until, 3e-14) - theirs)[:4].max() / SHIFT for axis in np.eye(8)]
    growth = float(np.linalg.norm(shifts)) * float(np.abs(start).max())
    bound, why = grown(place, steps=SPRING_STEPS, stages=17, growth=growth, span=until * math.sqrt(2.0 * SPRING))
    theirs_off = float(np.abs(coarser - theirs)[:4].max())
    why = f"{why}, and SciPy's own error {theirs_off:.1g}, from a run with ten times the tolerance"
    return Found(float(np.abs(found - theirs[:4]).max()), bound + theirs_off, why)


def _in_scipy(start: np.ndarray, until: float, tolerance: float) -> np.ndarray:
    """Places and velocities of the two masses at the end, (8,)."""

    def pull(there: np.ndarray) -> np.ndarray:
        length = float(np.linalg.norm(there))
        pulled: np.ndarray = SPRING * (length - LENGTH) / length * there
        return pulled

    def rate(_: float, y: np.ndarray) -> np.ndarray:
        upper, lower = pull(-y[:2]), pull(y[:2] - y[2:4])
        down = np.array([0.0, -PULL])
        return np.concatenate([y[4:], upper - lower + down, lower + down])

    solve = _code("scipy.integrate").solve_ivp
    end: np.ndarray = solve(rate, (0.0, until), start, method="DOP853", rtol=tolerance, atol=tolerance).y[:, -1]
    return end
