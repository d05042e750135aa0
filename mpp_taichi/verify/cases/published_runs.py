"""Published runs: the five planets of a course in programming, and the planet of Kepler-16 around two stars."""

import math
from functools import cache, partial

import numpy as np

from mpp_taichi.scene.load import load_scene
from mpp_taichi.start.assemble import assemble
from mpp_taichi.verify.bounds import half_digit, rounding
from mpp_taichi.verify.case import Found, case
from mpp_taichi.verify.cases._published import DOUBLE_ONLY, against, bodies, gravity, row
from mpp_taichi.verify.place import Place, sound

# Five planets of a course

COURSE = {
    "earth": (5.974e24, (1.496e11, 0.0), (0.0, 2.980e4)),
    "mars": (6.419e23, (2.279e11, 0.0), (0.0, 2.410e4)),
    "mercury": (3.302e23, (5.790e10, 0.0), (0.0, 4.790e4)),
    "sun": (1.989e30, (0.0, 0.0), (0.0, 0.0)),
    "venus": (4.869e24, (1.082e11, 0.0), (0.0, 3.500e4)),
}
"""Mass [kg], place [m], velocity [m/s]; G = 6.67e-11."""
COURSE_END = {
    "earth": ("1.4925e+11", "-1.0467e+10", "2.0872e+03", "2.9723e+04"),
    "mars": ("-1.1055e+11", "-1.9868e+11", "2.1060e+04", "-1.1827e+04"),
    "mercury": ("-1.1708e+10", "-5.7384e+10", "4.6276e+04", "-9.9541e+03"),
    "sun": ("2.1709e+05", "3.0029e+07", "4.5087e-02", "5.1823e-02"),
    "venus": ("6.9283e+10", "8.2658e+10", "-2.6894e+04", "2.2585e+04"),
}
"""x, y, u and w after 157,788,000 s in steps of 25,000 s, as the course prints them."""
PRINCETON = (
    "R. Sedgewick and K. Wayne, Princeton University COS 126, assignment N-Body Simulation, planets.txt after 157788000 s"
)


@cache
def _course(place: Place) -> dict[str, np.ndarray]:
    """x, y, u, w of each body at the end, by the course's method: all velocities first, then all places with them."""
    masses, x, v = zip(*COURSE.values(), strict=True)
    scene = gravity(bodies(masses, x, v), {"symplectic_euler": {"dt": 25_000.0}}, 6.67e-11)
    with place.simulation(scene) as simulation:
        simulation.run(steps=math.ceil(157_788_000 / 25_000))  # the course's loop runs while the time is less than the end
        sound(simulation)
        end = simulation.snapshot()
    return {name: np.r_[x[:2], v[:2]] for name, x, v in zip(COURSE, end.position, end.velocity, strict=True)}


def _course_body(name: str, place: Place) -> Found:
    """The largest error, in units of half of the last printed digit of its number."""
    units = np.array([half_digit(each) for each in COURSE_END[name]])
    off = np.abs(_course(place)[name] - np.array([float(each) for each in COURSE_END[name]])) / units
    bound, why = rounding(place, steps=6312, stages=1, phase=42.0 * math.pi, leverage=1.0)  # Mercury's 21 turns
    size = 1.5e11 * bound / units[0]
    return Found(float(off.max()), 1.0 + size, f"1, half a unit of the last digit of each number, and {size:.1g}: {why}")


def _course_case(name: str, **more):
    title = f"The {name} of a course's five bodies ends where the course prints it"
    return row(
        __name__,
        f"course_{name}",
        title.replace("The m", "M").replace("The v", "V"),
        PRINCETON,
        partial(_course_body, name),
        **more,
    )


course_earth = _course_case("earth", quick=True)
course_mars = _course_case("mars", quick=True)
course_mercury = _course_case("mercury", quick=True)
course_sun = _course_case("sun", quick=True)
course_venus = _course_case("venus")

# A planet around two stars

GAUSS = 0.0172
STAR_A, STAR_B, APART, PLANET = 0.6897, 0.2026, 0.2243, 0.318e-3
BINARY_PERIOD = 2.0 * math.pi * math.sqrt(APART**3 / (STAR_A + STAR_B)) / GAUSS
PERIODS = 300  # of the binary, for which planets are watched: Holman and Wiegert watch 10⁴
PHASES = (0.0, 90.0, 180.0, 270.0)  # of the planet at the start [degrees]
INSIDE, DISTANCES = (0.35, 0.40, 0.45), (0.35, 0.40, 0.45, 0.55, 0.60, 0.7048)
DOYLE = "L. R. Doyle et al., Science 333 (2011) 1602"
WIEGERT = (
    "M. J. Holman and P. A. Wiegert, Astron. J. 117 (1999) 621, eq. (3): 1.60 + 4.12 μ − 5.09 μ² binary separations, 0.51 AU; "
    "classified by 300 periods of the binary of the 10⁴ of the paper"
)


def _stars(distance: float, phase: float):
    """Two stars on circles, and a planet at this distance [AU] and phase [degrees] on what would be a circle about one star."""
    both = STAR_A + STAR_B
    speed, slow = GAUSS * math.sqrt(both / APART), GAUSS * math.sqrt(both / distance)
    c, s = math.cos(math.radians(phase)), math.sin(math.radians(phase))
    x = [[APART * STAR_B / both, 0.0], [-APART * STAR_A / both, 0.0], [distance * c, distance * s]]
    v = [[0.0, speed * STAR_B / both], [0.0, -speed * STAR_A / both], [-slow * s, slow * c]]
    return gravity(bodies([STAR_A, STAR_B, PLANET], x, v), {"yoshida4": {"dt": 0.1}}, GAUSS**2)


@cache
def _lost(place: Place) -> dict[float, int]:
    """By distance: how many planets of the four phases are farther than 3 AU and faster than the speed of escape at the end."""
    starts = [assemble(load_scene(_stars(distance, phase))) for distance in DISTANCES for phase in PHASES]
    with place.simulation(_stars(DISTANCES[0], 0.0), replica_starts=starts) as simulation:
        simulation.run(duration=PERIODS * BINARY_PERIOD)
        ends = [simulation.snapshot(replica=number) for number in range(len(starts))]
    gone = np.array([_is_gone(end) for end in ends]).reshape(len(DISTANCES), len(PHASES))
    return dict(zip(DISTANCES, gone.sum(axis=1).tolist(), strict=True))


def _is_gone(end) -> bool:
    share = np.array([STAR_A, STAR_B]) / (STAR_A + STAR_B)
    x, v = (each[2] - share @ each[:2] for each in (end.position, end.velocity))
    r = float(np.linalg.norm(x))
    return r > 3.0 and 0.5 * float(v @ v) > GAUSS**2 * (STAR_A + STAR_B) / r


def _kept(distance: float, place: Place) -> Found:
    lost = _lost(place)[distance]
    return Found(lost, 0.0, f"a count: {lost} of 4 planets are lost, none in the run of IAS15 of REBOUND 5.2")


@case(
    "At each of 0.35, 0.40 and 0.45 AU, within the critical distance of Kepler-16, planets are thrown out",
    WIEGERT,
    on=DOUBLE_ONLY,
)
def kepler16_inside(place: Place) -> Found:
    """The number of these distances at which no planet is lost; which of the four is lost is chaotic."""
    lost = [_lost(place)[distance] for distance in INSIDE]
    words = ", ".join(map(str, lost))
    return Found(lost.count(0), 0.0, f"a count: {words} of 4 planets are lost; 2, 4 and 3 in runs of IAS15 of REBOUND 5.2")


kepler16_outside = row(
    __name__, "kepler16_outside", "Beyond the critical distance of Kepler-16, at 0.55 AU, none of four planets is thrown out",
    WIEGERT, partial(_kept, 0.55),
)  # fmt: skip
kepler16_farther = row(
    __name__, "kepler16_farther", "At 0.60 AU from the centre of Kepler-16 none of four planets is thrown out", WIEGERT,
    partial(_kept, 0.60),
)  # fmt: skip
kepler16_planet = row(
    __name__, "kepler16_planet", "The planet of Kepler-16 at 0.7048 AU stays", f"{DOYLE}, table 1", partial(_kept, 0.7048)
)


@case(
    "The stars of Kepler-16 go around each other in 41.079 days",
    f"{DOYLE}, table 1: 41.079220 days, 0.22431 AU",
    on=DOUBLE_ONLY,
)
def kepler16_period(place: Place) -> Found:
    """From the angle after a period, with the published masses and semi-major axis, which have five digits."""
    gauss, axis, masses, printed, steps = 0.01720209895, "0.22431", (0.6897, 0.20255), "41.079220", 200
    both = sum(masses)
    speed = gauss * math.sqrt(both / float(axis))
    x = [[float(axis) * masses[1] / both, 0.0], [-float(axis) * masses[0] / both, 0.0]]
    v = [[0.0, speed * masses[1] / both], [0.0, -speed * masses[0] / both]]
    scene = gravity(bodies(masses, x, v), {"kahan_li8": {"dt": float(printed) / steps}}, gauss**2)
    with place.simulation(scene) as simulation:
        simulation.run(steps=steps)
        sound(simulation)
        apart, time = np.subtract(*simulation.snapshot().position), simulation.time
    period = time / (1.0 + math.atan2(apart[1], apart[0]) / (2.0 * math.pi))
    of_digits = 1.5 * half_digit(axis) / float(axis) + 0.5 * (half_digit("0.6897") + half_digit("0.20255")) / both
    bound, why = rounding(place, steps=steps, stages=17, phase=2.0 * math.pi, leverage=1.0)
    return against(
        period, printed, float(printed) * (of_digits + bound), f"the last digits of the axis and of the masses, and {why}"
    )
