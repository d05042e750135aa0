"""Published numbers of the Solar System: periods of the planets, and their places in an ephemeris."""

import math
from functools import cache, partial

import numpy as np

from mpp_taichi.verify.bounds import half_digit, rounding
from mpp_taichi.verify.case import Found, case
from mpp_taichi.verify.cases import _solar_system as table
from mpp_taichi.verify.cases._published import EVERYWHERE, against, bodies, gravity, row
from mpp_taichi.verify.place import Place, sound

GAUSS = 0.01720209895
ADAPTIVE, TERMS = {"taylor": {"dt": 5.0}}, 20

# Kepler's third law

PLANETS = {
    "mercury": ("0.38709893", 6023600.0, "87.969"),
    "venus": ("0.72333199", 408523.5, "224.701"),
    "earth": ("1.00000011", 328900.5, "365.256"),
    "mars": ("1.52366231", 3098710.0, "687.0"),
    "jupiter": ("5.20336301", 1047.355, "4333"),
    "saturn": ("9.53707032", 3498.5, "1.076e4"),
}
"""Semi-major axis [AU], Sun's mass over the planet's, and sidereal period [days]."""
PERIODS = (
    "Explanatory Supplement to the Astronomical Almanac (1992) table 5.8.1, and JPL's sidereal periods, from Mars on "
    "with the digits that the pull of the other planets leaves: mean elements contain it"
)
MOST_STEPS = 4000  # of the adaptive method in 122 turns of Mercury


@cache
def _periods(place: Place) -> dict[str, float]:
    """Periods [days] of massless planets about the Sun; the mass of each stands in its distance, a/(1 + m)^(1/3)."""
    x, v = [[0.0, 0.0]], [[0.0, 0.0]]
    for axis, ratio, _ in PLANETS.values():
        distance = float(axis) / (1.0 + 1.0 / ratio) ** (1.0 / 3.0)
        x.append([distance, 0.0])
        v.append([0.0, GAUSS / math.sqrt(distance)])
    scene = gravity(bodies([1.0, *[0.0] * len(PLANETS)], x, v), ADAPTIVE, GAUSS**2)
    found = {}
    with place.simulation(scene) as simulation:
        for number, (name, (_, _, printed)) in enumerate(PLANETS.items()):
            simulation.run(until=float(printed))
            at = simulation.snapshot().position[number + 1]
            found[name] = simulation.time / (1.0 + math.atan2(at[1], at[0]) / (2.0 * math.pi))
        sound(simulation)
    return found


def _period(name: str, place: Place) -> Found:
    axis, _, printed = PLANETS[name]
    period = float(printed)
    bound, why = rounding(place, steps=MOST_STEPS, stages=TERMS, phase=2.0 * math.pi, leverage=1.0)
    of_axis = 1.5 * half_digit(axis) / float(axis)
    return against(
        _periods(place)[name], printed, period * (bound / (2.0 * math.pi) + of_axis), f"1.5 of the axis' last digit, {why}"
    )


def _period_case(name: str, **more):
    title = f"{name.capitalize()} goes around the Sun in {PLANETS[name][2]} days"
    return row(__name__, f"year_of_{name}", title, PERIODS, partial(_period, name), **more)


year_of_mercury = _period_case("mercury")
year_of_venus = _period_case("venus")
year_of_earth = _period_case("earth")
year_of_mars = _period_case("mars")
year_of_jupiter = _period_case("jupiter")
year_of_saturn = _period_case("saturn")


@case(
    "A body without mass goes around the Sun at 1 AU in the Gaussian year, 365.2568983 days",
    "C. F. Gauss, Theoria motus (1809) §1: k = 0.01720209895",
    quick=True,
    **EVERYWHERE,
)
def gaussian_year(place: Place) -> Found:
    """From the angle after that many days, by an eighth-order splitting."""
    printed, steps, stages = "365.2568983", 200, 17
    integrator = {"kahan_li8": {"dt": float(printed) / steps}}
    with place.simulation(
        gravity(bodies([1.0, 0.0], [[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [0.0, GAUSS]]), integrator, GAUSS**2)
    ) as simulation:
        simulation.run(steps=steps)
        sound(simulation)
        at, time = simulation.snapshot().position[1], simulation.time
    year = time / (1.0 + math.atan2(at[1], at[0]) / (2.0 * math.pi))
    bound, why = rounding(place, steps=steps, stages=stages, phase=2.0 * math.pi, leverage=1.0)
    start = 2.0 * place.u + place.force_u  # of the speed and of k² as they are rounded, with 1.5 times as much in the period
    return against(year, printed, float(printed) * (bound / (2.0 * math.pi) + 3.0 * start), f"3 roundings of the start, {why}")


# The ephemeris DE421

LIGHT = 299_792_458.0 * 86_400.0 / 149_597_870_699.6  # [AU/day]
EINSTEIN = 6.0 * table.DE421_STRENGTH / LIGHT**2
DAYS = 30.0
TURN = {"mercury": 87.97, "venus": 224.70, "earth": 365.26, "moon": 365.26, "mars": 686.98, "jupiter": 4332.6,
        "saturn": 10759.0, "uranus": 30685.0, "neptune": 60190.0, "pluto": 90560.0}  # fmt: skip
STANDISH = "JPL's ephemeris DE421 (W. M. Folkner, J. G. Williams and D. H. Boggs, IPN Progress Report 42-178, 2009)"
FLATTENING = 1.5 * 1.083e-3 * (6378.0 / 384_400.0) ** 2  # of the Earth's pull on the Moon


@cache
def _later(place: Place) -> dict[str, float]:
    """Distance [AU] of each planet from its place in DE421 after 30 days."""
    masses, x, v = zip(*table.DE421_START.values(), strict=True)
    # Eighth order, at ω dt = 0.06 of the Moon: 1e-10 of an orbit, far below Einstein's terms.
    with place.simulation(gravity(bodies(masses, x, v), {"kahan_li8": {"dt": 0.25}}, table.DE421_STRENGTH)) as simulation:
        simulation.run(until=DAYS)
        sound(simulation)
        off = simulation.snapshot().position - np.array(list(table.DE421_LATER.values()))
    return {name: float(np.linalg.norm(each)) for name, each in zip(table.DE421_LATER, off, strict=True)}


def _place(name: str, place: Place) -> Found:
    angle = 2.0 * math.pi * DAYS / TURN[name]
    printed = 1e-14 * 40.0 * (1.0 + angle)
    bound, why = EINSTEIN * angle + printed, f"Einstein's terms, 6 G M/c² = {EINSTEIN:.2g} AU for each of {angle:.2g} radians"
    if name == "moon":
        swing = 2.0 * math.pi * DAYS / 27.32
        bound += 3.0 * FLATTENING * swing * 0.00257
        why += f", and the flattening of the Earth, {FLATTENING:.2g} of its pull, with 3 times as much in the mean motion"
    return Found(_later(place)[name], bound, why)


def _place_case(name: str, **more):
    who = "The Moon" if name == "moon" else name.capitalize()
    title = f"{who} is in its place of the ephemeris after 30 days"
    return row(__name__, f"place_of_{name}", title, STANDISH, partial(_place, name), **more)


place_of_mercury = _place_case("mercury")
place_of_venus = _place_case("venus")
place_of_earth = _place_case("earth", quick=True)
place_of_moon = _place_case("moon", quick=True)
place_of_mars = _place_case("mars", quick=True)
place_of_jupiter = _place_case("jupiter", quick=True)
place_of_saturn = _place_case("saturn")
place_of_uranus = _place_case("uranus")
place_of_neptune = _place_case("neptune")

# The outer Solar System

MILLION = 1e6  # days
OUTER_TURN = {"jupiter": (4332.6, 5.2, 0.05), "saturn": (10759.0, 9.6, 0.06), "uranus": (30685.0, 19.2, 0.05),
              "neptune": (60190.0, 30.1, 0.01), "pluto": (90560.0, 39.5, 0.25)}  # fmt: skip
REFERENCE = 1.8e-11  # AU: by how much the two computations of the reference differ
OUTER_STEPS = 20_000  # of the adaptive method: 80 to each of Jupiter's 231 turns
WANNER = (
    "E. Hairer, C. Lubich and G. Wanner, Geometric Numerical Integration, 2nd ed. (2006) table I.2.2; places after a million "
    "days by IAS15 of REBOUND 5.2"
)


@cache
def _outer(place: Place) -> dict[str, float]:
    """Distance [AU] of each planet's place from the Sun after a million days from the place of the reference."""
    masses, x, v = zip(*table.OUTER_START.values(), strict=True)
    scene = gravity(bodies(masses, x, v), {"taylor": {"dt": 500.0}}, table.OUTER_STRENGTH)
    with place.simulation(scene) as simulation:
        simulation.run(until=MILLION)
        sound(simulation)
        at = simulation.snapshot().position
    off = at[1:] - at[0] - np.array(list(table.OUTER_LATER.values()))
    return {name: float(np.linalg.norm(each)) for name, each in zip(table.OUTER_LATER, off, strict=True)}


def _outer_place(name: str, place: Place) -> Found:
    turn, axis, eccentricity = OUTER_TURN[name]
    leverage = 1.0 / (1.0 - eccentricity)
    bound, why = rounding(place, steps=OUTER_STEPS, stages=TERMS, phase=2.0 * math.pi * MILLION / turn, leverage=leverage)
    return Found(_outer(place)[name], axis * bound + REFERENCE, f"{axis} AU times {why}; {REFERENCE:.1g} AU of the reference")


def _outer_case(name: str):
    title = f"{name.capitalize()} is in its place after a million days"
    return row(__name__, f"million_days_of_{name}", title, WANNER, partial(_outer_place, name))


million_days_of_jupiter = _outer_case("jupiter")
million_days_of_saturn = _outer_case("saturn")
million_days_of_uranus = _outer_case("uranus")
million_days_of_neptune = _outer_case("neptune")
million_days_of_pluto = _outer_case("pluto")
