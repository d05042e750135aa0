"""Hard cases of gravity: eccentric and plunging orbits, softening, coincident bodies, extreme masses, places far away."""

import math
from typing import Any

import numpy as np

from mpp_taichi.verify.bounds import rounding
from mpp_taichi.verify.case import Found, case
from mpp_taichi.verify.cases._two_bodies import orbit, period, separation
from mpp_taichi.verify.place import Place, sound

KEPLER = "Kepler's equation, solved by Newton's method in double precision"
ADAPTIVE = {"taylor": {"dt": 0.05}}
EIGHTH_ORDER, STAGES = "kahan_li8", 17
FIXED_STEPS = 400  # in a revolution: the error of the method of eighth order is far below rounding
NEAR_PERICENTRE = 10  # steps of an adaptive method in which most of the rounding of an orbit happens


def _orbit_error(place: Place, eccentricity: float, integrator: dict[str, Any], orbits: int) -> float:
    """Distance from Kepler's motion at the end of so many revolutions from apocentre, over the semi-major axis."""
    with place.simulation(orbit(eccentricity, integrator, from_apocentre=True)) as simulation:
        simulation.run(duration=orbits * period())
        sound(simulation)
        position = simulation.snapshot().position
        phase = 2.0 * math.pi * (simulation.time / period() - orbits) + math.pi
    return float(np.linalg.norm(position[1] - position[0] - separation(eccentricity, phase)))


def _pericentre_bound(place: Place, eccentricity: float, orbits: int) -> Found:
    """Rounding at the pericentres changes the energy, and with it the period: bound without a number reached."""
    energy = 2.0 * place.force_u / (1.0 - eccentricity) * math.sqrt(NEAR_PERICENTRE * orbits)
    why = (
        f"a rounding u = {place.force_u:.1g} at the pericentre changes the energy by 2u/(1 − e) of itself, at random "
        f"{NEAR_PERICENTRE} times in each of n = {orbits} orbits, and an energy wrong by δ shifts the body by 3π n δ axes"
    )
    return Found(math.nan, 3.0 * math.pi * orbits * energy, why)


def _within(reached: float, bound: Found) -> Found:
    return Found(reached, bound.bound, bound.because)


@case(
    "A body follows an orbit of eccentricity 0.5 with fixed steps", KEPLER, quick=True, solved_in=("f64", "f32", "ds", "f32c")
)
def fixed_steps(place: Place) -> Found:
    """One revolution by an eighth-order splitting."""
    reached = _orbit_error(place, 0.5, {EIGHTH_ORDER: {"dt": period() / FIXED_STEPS}}, 1)
    bound, why = rounding(place, steps=FIXED_STEPS, stages=STAGES, phase=2 * math.pi, leverage=2.0)
    return Found(reached, bound, why)


@case("A body follows an orbit of eccentricity 0.9 for ten revolutions", KEPLER, quick=True, solved_in=("f64", "f32"))
def eccentric(place: Place) -> Found:
    """By an adaptive method."""
    return _within(_orbit_error(place, 0.9, ADAPTIVE, 10), _pericentre_bound(place, 0.9, 10))


@case("A body follows an orbit of eccentricity 0.99 for ten revolutions", KEPLER, solved_in=("f64", "f32"))
def very_eccentric(place: Place) -> Found:
    """By an adaptive method."""
    return _within(_orbit_error(place, 0.99, ADAPTIVE, 10), _pericentre_bound(place, 0.99, 10))


@case(
    "A body follows an orbit of eccentricity 0.999 for ten revolutions, or the run says that it is inaccurate",
    KEPLER,
    quick=True,
)
def plunging(place: Place) -> Found:
    """By an adaptive method; in single precision the program has to say that the energy is wrong."""
    return _within(_orbit_error(place, 0.999, ADAPTIVE, 10), _pericentre_bound(place, 0.999, 10))


@case("A step far too long for a pericentre is told", "0.99 of eccentricity with 40 steps in a revolution", quick=True)
def step_too_long(place: Place) -> Found:
    """The run has to be refused, or to call itself inaccurate."""
    scene = orbit(0.99, {"leapfrog": {"dt": period() / 40}}, from_apocentre=True)
    told = place.refusal(scene, steps=400)
    return Found(0.0 if told else math.inf, 0.5, "0: the program says so in words; infinite: it says nothing")


@case("Two bodies fall into each other from rest", "r = cos² η, t = (η + ½ sin 2η)/2: the radial solution", quick=True)
def head_on(place: Place) -> Found:
    """Two masses of 1 at a distance of 1, until shortly before they meet at t = π/4."""
    bodies = [{"body": {"mass": 1.0, "position": [x, 0, 0]}} for x in (-0.5, 0.5)]
    forces = [{"newtonian_gravity": {"strength": 1.0}}]
    with place.simulation({"particles": bodies, "forces": forces, "integrator": ADAPTIVE}) as simulation:
        simulation.run(duration=0.75)
        sound(simulation)
        position, time = simulation.snapshot().position, simulation.time
    half = math.pi / 4
    for _ in range(200):  # bisection would do as well: t grows with η
        half -= (0.5 * (half + 0.5 * math.sin(2 * half)) - time) / (0.5 * (1 + math.cos(2 * half)))
    distance = math.cos(half) ** 2
    speed = 2.0 * math.sqrt(1.0 / distance - 1.0)
    bound = speed * time * (2.0 / distance) * math.sqrt(100) * place.force_u
    why = (
        f"100 steps round the energy by up to 2u/r of its size, u = {place.force_u:.1g}, which shifts the time by as much; "
        f"the speed is {speed:.2g}"
    )
    return Found(abs(float(np.linalg.norm(position[1] - position[0])) - distance), bound, why)


@case(
    "Two softened bodies fall through each other and return in a period",
    "period by Gauss–Legendre quadrature",
    quick=True,
    solved_in=("f64", "f32"),
)
def through_each_other(place: Place) -> Found:
    """Softening 0.1, from rest at a distance of 1; after the period both are where they began."""
    softening = 0.1
    time = _softened_period(softening)
    bodies = [{"body": {"mass": 1.0, "position": [x, 0, 0]}} for x in (-0.5, 0.5)]
    forces = [{"newtonian_gravity": {"strength": 1.0, "softening": softening}}]
    steps = 1000
    scene = {"particles": bodies, "forces": forces, "integrator": {EIGHTH_ORDER: {"dt": time / steps}}}
    with place.simulation(scene) as simulation:
        simulation.run(steps=steps)
        sound(simulation)
        reached = float(np.abs(simulation.snapshot().position - simulation.start.position).max())
    bound, why = rounding(place, steps=steps, stages=STAGES, phase=2 * math.pi, leverage=1.0 / softening)
    return Found(reached, bound, why)


def _softened_period(softening: float) -> float:
    """4 ∫ dr / ṙ over r from 0 to 1, with r = 1 − s² where ṙ is zero; ṙ² = 4 (1/√(r² + ε²) − 1/√(1 + ε²))."""
    at, weight = np.polynomial.legendre.leggauss(200)
    s, weight = 0.5 * (at + 1.0), 0.5 * weight
    r = 1.0 - s**2
    # The difference of the two inverse roots, without cancellation.
    near, far = np.sqrt(r**2 + softening**2), math.sqrt(1.0 + softening**2)
    squared = 4.0 * (1.0 - r**2) / (near * far * (near + far))
    return 4.0 * float(np.sum(weight * 2.0 * s / np.sqrt(squared)))


@case(
    "Coincident bodies are refused, and with a softening their pull is zero",
    "symmetry",
    quick=True,
    solved_in=("f64", "f32", "f32c", "ds"),
)
def coincident(place: Place) -> Found:
    """Without softening the scene has no force to compute; with it both bodies stay."""
    bodies = [{"body": {"mass": 1.0, "position": [0.25, 0.5, 0.75]}}] * 2
    scene = {"particles": bodies, "integrator": {"leapfrog": {"dt": 0.01}}}
    if not place.refusal(scene | {"forces": [{"newtonian_gravity": {"strength": 1.0}}]}, steps=1):
        return Found(math.inf, 0.0, "two bodies at one place without softening have to be refused")
    with place.simulation(scene | {"forces": [{"newtonian_gravity": {"strength": 1.0, "softening": 0.1}}]}) as simulation:
        simulation.run(steps=100)
        moved = float(np.abs(simulation.snapshot().position - simulation.start.position).max())
    return Found(moved, 0.0, "by symmetry no body moves, to the last bit")


@case(
    "A body without mass pulls nothing",
    "the same bits of the other body with and without it",
    quick=True,
    solved_in=("f64", "f32", "f32c", "ds"),
)
def massless(place: Place) -> Found:
    """Two bodies with and without a third, massless body."""
    scene = orbit(0.3, {"yoshida4": {"dt": 0.01}})
    third = {"body": {"mass": 0.0, "position": [0.5, 0.7, 0.1], "velocity": [-0.5, 0.3, 0.0]}}
    ends = []
    for particles in (scene["particles"], [*scene["particles"], third]):
        with place.simulation(scene | {"particles": particles}) as simulation:
            simulation.run(steps=300)
            ends.append(simulation.snapshot().position[:2])
    bound, why = rounding(place, steps=300, stages=3, phase=3.0, leverage=1.0 / 0.7)
    return Found(float(np.abs(ends[0] - ends[1]).max()), bound, f"a sum with a term of 0 may be added in another order: {why}")


@case("Masses in the ratio of 10²⁰ move as two bodies do", KEPLER, solved_in=("f64", "f32"))
def extreme_masses(place: Place) -> Found:
    """A light body on an orbit of eccentricity 0.3, a tenth of a revolution in 100 steps of eighth order."""
    steps, part, light = 100, 0.1, 1e-20
    time = part * period(light)
    with place.simulation(orbit(0.3, {EIGHTH_ORDER: {"dt": time / steps}}, ratio=light)) as simulation:
        simulation.run(steps=steps)
        sound(simulation)
        position = simulation.snapshot().position
    reached = float(np.linalg.norm(position[1] - position[0] - separation(0.3, 2 * math.pi * part)))
    bound, why = rounding(place, steps=steps, stages=STAGES, phase=2 * math.pi * part, leverage=1.0 / 0.7)
    return Found(reached, bound, why)


@case("An orbit is the same a million lengths from the origin", "the same orbit at the origin", solved_in=("f64",))
def far_away(place: Place) -> Found:
    """Bodies whose places have few digits left; the starting numbers are whole multiples of 2⁻⁶, which stay exact."""
    ends = []
    for shift in (0.0, 2.0**20):
        bodies = [
            {"body": {"mass": 1.0, "position": [shift, shift, 0], "velocity": [0, 0, 0]}},
            {"body": {"mass": 2.0**-10, "position": [shift + 1.0, shift, 0], "velocity": [0, 1.0, 0]}},
        ]
        scene = {"particles": bodies, "forces": [{"newtonian_gravity": {"strength": 1.0}}], "integrator": ADAPTIVE}
        with place.simulation(scene) as simulation:
            simulation.run(duration=6.25)
            sound(simulation)
            end = simulation.snapshot().position
        ends.append(end[1] - end[0])
    bound = 2.0**20 * 2.0 * place.u
    return Found(
        float(np.abs(ends[0] - ends[1]).max()),
        bound,
        "only the numbers at the end are rounded, by u times the distance from the origin",
    )


@case("A frame that moves changes nothing", "Galilean invariance", quick=True, solved_in=("f64", "f32"))
def moving_frame(place: Place) -> Found:
    """The same orbit at rest and with a velocity of 4 along y."""
    ends = []
    for speed in (0.0, 4.0):
        scene = orbit(0.5, {EIGHTH_ORDER: {"dt": period() / FIXED_STEPS}})
        for entry in scene["particles"]:
            entry["body"]["velocity"][1] += speed
        with place.simulation(scene) as simulation:
            simulation.run(steps=FIXED_STEPS)
            end = simulation.snapshot().position
        ends.append(end[1] - end[0])
    of_orbit, why = rounding(place, steps=FIXED_STEPS, stages=STAGES, phase=2 * math.pi, leverage=2.0)
    bound = (1.0 + 4.0 * period()) * of_orbit
    return Found(float(np.abs(ends[0] - ends[1]).max()), bound, f"{why}, times 1 + 8π, the largest place in the moving frame")
